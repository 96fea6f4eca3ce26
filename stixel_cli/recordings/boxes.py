"""Boxes of labels in the image of the left camera."""

from collections.abc import Sequence

import numpy as np

from stixel_cli.geometry.pose import rectangle
from stixel_cli.recordings.types import Calibration

NEAREST = 0.5
"""Depth of a label's nearest corner, m: a nearer one is not seen."""


def seen_box(
    place: np.ndarray,
    yaw: float,
    size: Sequence[float],
    calibration: Calibration,
    image_size: tuple[int, int],
) -> tuple[np.ndarray, bool] | None:
    """The box (4,) px of a label in the image, and whether it is cut; None if it is not seen.

    `place` (3,) m of the bottom's centre is in the left camera's frame, `yaw` and `size` as in
    `Labels`.
    """
    height, width, length = size
    along, across = rectangle(length, width).T
    x = place[0] + np.cos(yaw) * along + np.sin(yaw) * across
    z = place[2] - np.sin(yaw) * along + np.cos(yaw) * across
    if z.min() < NEAREST:
        return None
    u = calibration.principal_u + calibration.focal_length * x / z
    y = place[1] - np.array([[0.0], [height]])
    v = calibration.principal_v + calibration.focal_length * y / z
    box = np.array([u.min(), v.min(), u.max(), v.max()])
    inside = np.clip(box, 0.0, np.array(image_size * 2) - 1.0)
    if inside[2] <= inside[0] or inside[3] <= inside[1]:
        return None
    return inside, bool((inside != box).any())
