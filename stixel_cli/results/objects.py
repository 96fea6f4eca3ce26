"""The table of the objects: clusters of stixels."""

from collections.abc import Sequence

import numpy as np

from stixel_cli.geometry.pose import world_from_ego
from stixel_cli.stixels.objects import Objects


def object_columns(
    objects: Sequence[Objects], times: np.ndarray, ego_poses_world: np.ndarray
) -> dict[str, np.ndarray]:
    """One row per object of chunks in order: its stixels, its box in the image and on the ground.

    k, t (s), object (number in the frame, from 0), stixels, left, right, top, base (px, columns
    left … right - 1, rows top … base), and in the world frame x, y (m, the centre), length and
    width (m), heading (rad, along the length; either end may be the front).

    Args:
        objects: chunks in the order of their frames.
        times: (K,) s.
        ego_poses_world: (K, 3).
    """
    counts = np.concatenate([np.diff(one.offsets) for one in objects])
    k = np.repeat(np.arange(len(counts)), counts)
    left, right, top, base = np.concatenate([one.boxes for one in objects]).T
    corners = [
        world_from_ego(one.corners_ego[row], ego_poses_world[one.first + i])
        for one in objects
        for i in range(len(one.offsets) - 1)
        for row in range(one.offsets[i], one.offsets[i + 1])
    ]
    corners_world = np.array(corners).reshape(-1, 4, 2)
    sides = corners_world[:, 1:3] - corners_world[:, :2]
    sizes = np.hypot(*np.moveaxis(sides, 2, 0))
    longer = sizes.argmax(axis=1)
    along = sides[np.arange(len(k)), longer]
    x, y = corners_world.mean(axis=1).T
    return {
        "k": k,
        "t": times[k],
        "object": np.concatenate([np.arange(n) for n in counts]),
        "stixels": np.concatenate([one.counts for one in objects]),
        "left": left,
        "right": right,
        "top": top,
        "base": base,
        "x": x,
        "y": y,
        "length": sizes.max(axis=1),
        "width": sizes.min(axis=1),
        "heading": np.arctan2(along[:, 1], along[:, 0]),
    }
