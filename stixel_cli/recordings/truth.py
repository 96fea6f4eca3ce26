"""The ego car's motion from the poses of a recording, and the truth in its labels, in the world.

A label's contour is its rectangle. A frame counts for the scores if its label is neither truncated
nor occluded. `tables` say how the `files` of the poses or labels are written, and the first frame
in them. The ground plane is that of the level frame of `rig`.
"""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, planar_poses, rectangle
from stixel_cli.geometry.rig import Rig
from stixel_cli.geometry.rig_calibration import RigCalibration
from stixel_cli.recordings.tables import labels_of, poses_of_labels, read_labels, read_poses
from stixel_cli.recordings.types import LabelTruth, Tables
from stixel_cli.scene.parameters import CLASS_OF_KITTI_TYPE
from stixel_cli.scene.scenario import EgoMotion, Scenario

REACH = 20.0
"""The road is a straight line over this distance up to a frame, m: on real frames the pitch of the
images was as near as with 10 m before and 10 m after it, which a live camera does not have."""

LEAST_REACH = 5.0
"""A shorter way shows no direction, m: then pitch and height are those of the rig."""

HALF_WINDOW = 2
"""Rates are slopes over this many frames before and after, where they are labelled."""

LEAST_FRAMES = 3
"""Labelled frames that a rate needs: labels are keyframes joined by straight lines."""


def recorded_motion(
    files: tuple[Path, ...],
    tables: Tables,
    count: int,
    sample_time: float,
    rig: Rig | None = None,
    pose_scale: float | str = 1.0,
    calibration: RigCalibration | None = None,
) -> EgoMotion:
    """Planar motion at the first `count` frames, (0, 0, pi/2) at the first of them.

    Poses in space also give the pitch and the height of each frame. Nothing is smoothed.

    Args:
        files: () for a parked ego car.
        count: number of frames.
        sample_time: time from one frame to the next, s.
        rig: None for a replayed motion: the camera is taken as level; its roll, its height and
            changes of its pitch are left out.
        pose_scale: factor on the lengths of the poses; "estimated": of the `calibration`.
    """
    times = sample_time * np.arange(count)
    if not files:
        return EgoMotion(times, np.tile([0.0, 0.0, STRAIGHT_AHEAD], (count, 1)))
    poses, rows = read_poses(files, tables), slice(tables.first, tables.first + count)
    scale = calibration.length_ratio if pose_scale == "estimated" else pose_scale
    if np.isnan(scale):
        raise UserError(f"source.pose_scale: cannot be estimated: {calibration.text}")
    poses = poses * [1.0, 1.0, 1.0, scale]
    if rig is None:
        return EgoMotion(times, planar_poses(poses[rows], np.eye(3)))
    # The frames before the first show the road's direction there.
    pitches, heights = rocking(poses, rig.level_from_camera)
    planar = planar_poses(poses[rows], rig.level_from_camera)
    return EgoMotion(times, planar, pitches[rows], heights[rows])


def rocking(poses: np.ndarray, level_from_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pitches (K,) rad and heights (K,) m of a camera beyond those of its level frame.

    The road at a frame is the line through the camera's places up to it, by least squares: so a
    slope of the road is no pitch. No later pose counts. A pitch is positive with the nose down.
    The `poses` (K, 3, 4) are as in `planar_poses`; for the rotation (3, 3) see `Rig`.
    """
    pitches, heights = np.zeros(len(poses)), np.zeros(len(poses))
    steps = np.linalg.norm(np.diff(poses[:, :, 3], axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    for k in range(len(poses)):
        near = np.flatnonzero(way[: k + 1] >= way[k] - REACH)
        if np.ptp(way[near]) < LEAST_REACH:
            continue
        # In the level frame of this camera: x right, y down, z ahead.
        turn = poses[k, :, :3] @ level_from_camera.T
        places = (poses[near, :, 3] - poses[k, :, 3]) @ turn
        slope, offset = np.polyfit(way[near] - way[k], places[:, 1], 1)
        # Where the road ahead comes up (y falls), the nose is down.
        pitches[k] = -np.arctan(slope)
        heights[k] = offset
    return pitches, heights


def recorded_scenario(
    ego_motion: EgoMotion,
    files: tuple[Path, ...],
    rig: Rig,
    tables: Tables,
    target: int | str | None,
) -> Scenario:
    """Ground truth of one labelled target; NaN at the frames without its label.

    `target` is its track id; None for no truth, and no files.
    """
    count = len(ego_motion.times)
    poses, contour = np.full((count, 3), np.nan), np.zeros((0, 2))
    scored = np.zeros(count, dtype=bool)
    if target is not None:
        labels = labels_of(files, tables, target)
        rows, frames, known = poses_of_labels(ego_motion, labels, rig.level_from_camera, tables)
        poses[frames] = known
        scored[frames] = (labels.truncated[rows] == 0) & (labels.occluded[rows] == 0)
        _, width, length = np.median(labels.sizes[rows], axis=0)
        contour = rectangle(length, width)
    return Scenario(
        times=ego_motion.times,
        ego_poses_world=ego_motion.poses_world,
        target_poses_world=poses,
        target_rates_world=slopes(ego_motion.times, poses),
        contours_target=contour[None],
        only_box=True,
        scored=scored,
    )


def label_truths(
    ego_motion: EgoMotion, files: tuple[Path, ...], rig: Rig, tables: Tables
) -> tuple[LabelTruth, ...]:
    """The truth of each label in the frames of `ego_motion`; () without files.

    The arguments are those of `recorded_scenario`.
    """
    first, stop = tables.first, tables.first + len(ego_motion.times)
    truths = []
    for name, labels in read_labels(files, tables).items() if files else ():
        if np.any((labels.frames >= first) & (labels.frames < stop)):
            road_user = CLASS_OF_KITTI_TYPE.get(labels.kind, "other")
            scenario = recorded_scenario(ego_motion, files, rig, tables, name)
            truths.append(LabelTruth(str(name), road_user, scenario))
    return tuple(truths)


def slopes(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slope (K, n) of each column of `values` (K, n) at `times` (K,), by least squares.

    Over the rows without NaN among the `HALF_WINDOW` before and after; at an end of the labels,
    over the nearest `LEAST_FRAMES`. Fewer rows give NaN, and so does a row of NaN.
    """
    rates = np.full(values.shape, np.nan)
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    for k in known if len(known) >= LEAST_FRAMES else ():
        away = np.abs(known - k)
        near = known[(away <= HALF_WINDOW) | (away <= np.sort(away)[LEAST_FRAMES - 1])]
        rates[k] = np.polyfit(times[near] - times[k], values[near], 1)[0]
    return rates
