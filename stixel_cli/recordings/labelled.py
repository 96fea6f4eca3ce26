"""Labels and ego poses on the ground plane, and the truth in the labels of one target."""

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, world_from_ego
from stixel_cli.geometry.rig import Rig
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


def planar_poses(poses: np.ndarray, level_from_camera: np.ndarray) -> np.ndarray:
    """Poses (K, 3) x m, y m, heading rad on the ground plane of the first camera pose.

    Args:
        poses: (K, 3, 4) poses of the camera (x right, y down, z forward) in any one frame, m.
            Their roll, height, and changes of pitch are left out.
        level_from_camera: (3, 3) rotation, see `Rig`.
    """
    turn, place = poses[0, :, :3] @ level_from_camera.T, poses[0, :, 3]
    places = (poses[:, :, 3] - place) @ turn
    ahead = poses[:, :, :3] @ level_from_camera[2] @ turn
    headings = np.unwrap(np.arctan2(ahead[:, 2], ahead[:, 0]))
    return np.stack([places[:, 0], places[:, 2], headings], axis=1)


def label_pose(place: np.ndarray, yaw: float, ego_pose: np.ndarray) -> np.ndarray:
    """Pose (3,) in the world of a label at `place` (3,) m in the level frame, turned by `yaw`."""
    x, y = world_from_ego(place[None, [0, 2]], ego_pose)[0]
    return np.array([x, y, ego_pose[2] - STRAIGHT_AHEAD - yaw])


def rectangle(length: float, width: float) -> np.ndarray:
    """Corners (4, 2) m of a rectangle about the origin, counter-clockwise, x along its length."""
    return 0.5 * np.array([[length, width], [-length, width], [-length, -width], [length, -width]])
