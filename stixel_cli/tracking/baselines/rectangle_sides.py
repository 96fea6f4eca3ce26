"""What the tracker `rectangle` measures: the sides that the sensor sees, and where they end."""

from typing import NamedTuple

import numpy as np

from stixel_cli.geometry.pose import rotation, target_from_world, wrap_angle
from stixel_cli.measurements.scans import FieldOfView
from stixel_cli.tracking.association import uncut

NORMALS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""Outward normals of front, rear, left and right side in the target's frame."""

CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
"""Signs of the corners, counter-clockwise."""

ENDS_POINTS = 3
"""With fewer points than this, the distance of neighbouring rays is not known: no ends."""


class Rows(NamedTuple):
    """Linearised measurements: m scalars.

    Attributes:
        innovations: (m,) measured minus predicted.
        matrix: (m, 12) derivatives by the eight states and by the errors of the four sides.
        variances: (m,) of the errors that are independent.
    """

    innovations: np.ndarray
    matrix: np.ndarray
    variances: np.ndarray


def visible_sides(mean: np.ndarray, sensor_world: np.ndarray) -> np.ndarray:
    """Which sides (4,) of the rectangle `mean` (8,) a sensor at `sensor_world` (2,) m sees.

    A sensor inside of the rectangle sees all.
    """
    sensor = target_from_world(sensor_world[None], mean[:3])[0]
    seen = NORMALS @ sensor > 0.5 * mean[[6, 6, 7, 7]]
    return seen if seen.any() else ~seen


def sides_of(points_target: np.ndarray, size: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The nearest of the `seen` sides (4,) of each point (n, 2) m; `size` is length and width."""
    half = 0.5 * size
    outside = np.maximum(np.abs(points_target) - half, 0.0)[:, [1, 1, 0, 0]]
    away = points_target @ NORMALS.T - half[[0, 0, 1, 1]]
    return np.where(seen, np.hypot(away, outside), np.inf).argmin(axis=1)


def measure(
    mean: np.ndarray,
    points_world: np.ndarray,
    noises: np.ndarray,
    sensor_pose: np.ndarray,
    fullness: float,
    corner_std: float,
    field_of_view: FieldOfView | None,
) -> Rows:
    """The rows of points (n, 2) m with covariances (n, 2, 2) m², n > 0, at the state `mean` (8,).

    First one for each point, then the two ends of the target where they can be used.
    `sensor_pose` (3,) is that of the sensor in the world, `fullness` the area of the class's shape
    over that of its box, `field_of_view` as in `Scans`.
    """
    turn = rotation(mean[2])
    body = target_from_world(points_world, mean[:3])
    sides = sides_of(body, mean[6:], visible_sides(mean, sensor_pose[:2]))
    normals = NORMALS[sides]
    # The mean distance of a shape's side from its middle is this part of that of its box.
    half = 0.5 * fullness
    points = np.zeros((len(body), 12))
    points[:, :2] = -normals @ turn.T
    # The point in the target's frame turns back where the heading turns.
    points[:, 2] = normals[:, 0] * body[:, 1] - normals[:, 1] * body[:, 0]
    points[np.arange(len(body)), 6 + sides // 2] = -half
    points[np.arange(len(body)), 8 + sides] = -1.0
    distances = np.einsum("ni,ni->n", normals, body) - half * mean[6 + sides // 2]
    across = normals @ turn.T
    variances = np.einsum("ni,nij,nj->n", across, noises, across)

    ends = _ends(mean, points_world, noises, sensor_pose, corner_std, field_of_view)
    return joined(Rows(-distances, points, variances), ends)


def slip_row(mean: np.ndarray, slip: float) -> Rows:
    """The row of the velocity across the heading, which is 0 ± `slip`, m/s."""
    turn, row = rotation(mean[2]), np.zeros((1, 12))
    row[0, 2], row[0, 3:5] = -mean[3:5] @ turn[:, 0], turn[:, 1]
    return Rows(-row[:, 3:5] @ mean[3:5], row, np.array([slip**2]))


def joined(*rows: Rows) -> Rows:
    """All rows, in order."""
    return Rows(*(np.concatenate(parts) for parts in zip(*rows, strict=True)))


def _ends(
    mean: np.ndarray,
    points_world: np.ndarray,
    noises: np.ndarray,
    sensor_pose: np.ndarray,
    corner_std: float,
    field_of_view: FieldOfView | None,
) -> Rows:
    """The rows of the right and the left end of the target, as the sensor sees it."""
    if len(points_world) < ENDS_POINTS:
        return Rows(np.zeros(0), np.zeros((0, 12)), np.zeros(0))
    offsets = points_world - sensor_pose[:2]
    bearings = wrap_angle(np.arctan2(offsets[:, 1], offsets[:, 0]) - sensor_pose[2])
    gap = np.median(np.diff(np.sort(bearings))) * np.hypot(*offsets.T).mean()
    turn, body = rotation(mean[2]), 0.5 * CORNERS * mean[6:]
    corners = body @ turn.T + mean[:2] - sensor_pose[:2]
    last = np.array([bearings.argmin(), bearings.argmax()])
    innovations, matrix, variances = np.empty(2), np.zeros((2, 12)), np.empty(2)
    for i, side in enumerate((-1.0, 1.0)):
        ray = offsets[last[i]] / np.hypot(*offsets[last[i]])
        outwards = side * np.array([-ray[1], ray[0]])
        corner = np.arctan2(corners @ outwards, corners @ ray).argmax()
        innovations[i] = 0.5 * gap - outwards @ corners[corner]
        matrix[i, :2] = outwards
        matrix[i, 2] = outwards @ turn @ [-body[corner, 1], body[corner, 0]]
        matrix[i, 6:8] = 0.5 * CORNERS[corner] * (outwards @ turn)
        variances[i] = gap**2 / 12.0 + outwards @ noises[last[i]] @ outwards + corner_std**2
    kept = uncut(bearings[last], np.hypot(*offsets[last].T), field_of_view)
    return Rows(innovations[kept], matrix[kept], variances[kept])
