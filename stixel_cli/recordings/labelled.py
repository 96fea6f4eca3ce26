"""The truth in the labels of one target, moved into the world by the ego poses."""

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.box import rectangle
from stixel_cli.recordings.planar import label_pose
from stixel_cli.recordings.types import Labels
from stixel_cli.scene.scenario import EgoMotion, Scenario

HALF_WINDOW = 2
"""Rates are slopes over this many frames before and after, where they are labelled."""

LEAST_FRAMES = 3
"""Labelled frames that a rate needs: labels are keyframes joined by straight lines."""


def labelled_scenario(
    ego_motion: EgoMotion,
    labels: Labels,
    rig: Rig,
    first: int,
    left_camera: tuple[float, float, float],
) -> Scenario:
    """Ground truth of one label; see `scenario.recorded_scenario`."""
    count = len(ego_motion.times)
    poses = np.full((count, 3), np.nan)
    scored = np.zeros(count, dtype=bool)
    inside = (labels.frames >= first) & (labels.frames < first + count)
    for k, row in zip(labels.frames[inside] - first, np.flatnonzero(inside), strict=True):
        place = rig.level_from_camera @ (labels.places[row] - left_camera)
        poses[k] = label_pose(place, labels.yaws[row], ego_motion.poses_world[k])
        scored[k] = labels.truncated[row] == 0 and labels.occluded[row] == 0
    known = np.isfinite(poses[:, 2])
    poses[known, 2] = np.unwrap(poses[known, 2])
    _, width, length = np.median(labels.sizes[inside], axis=0)
    return box_scenario(ego_motion, poses, rectangle(length, width), scored)


def box_scenario(
    ego_motion: EgoMotion, poses: np.ndarray, contour: np.ndarray, scored: np.ndarray
) -> Scenario:
    """Ground truth of a target with the box `contour` (M, 2) m at `poses` (K, 3); only the box is
    known. `scored` (K,) are the scans that count."""
    return Scenario.rigid(
        times=ego_motion.times,
        ego_poses_world=ego_motion.poses_world,
        target_poses_world=poses,
        target_rates_world=slopes(ego_motion.times, poses),
        contour_target=contour,
        only_box=True,
        scored=scored,
    )


def slopes(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slope (K, n) of each column of `values` (K, n) at `times` (K,), by least squares.

    Over the rows without NaN among the `HALF_WINDOW` before and after; at an end of the labels,
    over the nearest `LEAST_FRAMES`. Fewer rows give NaN, and so does a row of NaN.
    """
    found = np.full(values.shape, np.nan)
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    for k in known if len(known) >= LEAST_FRAMES else ():
        away = np.abs(known - k)
        near = known[(away <= HALF_WINDOW) | (away <= np.sort(away)[LEAST_FRAMES - 1])]
        found[k] = np.polyfit(times[near] - times[k], values[near], 1)[0]
    return found
