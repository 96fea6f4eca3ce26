"""The ego car's motion from the poses of a recording."""

from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, planar_poses
from stixel_cli.geometry.rig import Rig
from stixel_cli.geometry.rig_calibration import RigCalibration
from stixel_cli.recordings.tables import read_poses
from stixel_cli.recordings.types import Tables
from stixel_cli.scene.scenario import EgoMotion


def recorded_motion(
    files: tuple[Path, ...],
    rig: Rig,
    tables: Tables,
    count: int,
    sample_time: float,
    pose_scale: float | str = 1.0,
    calibration: RigCalibration | None = None,
) -> EgoMotion:
    """Planar motion at the first `count` frames, (0, 0, pi/2) at the first of them.

    Poses in space also give the pitch and the height of each frame.

    Args:
        files: the files of the poses; empty for a parked ego car.
        rig: the ground plane is that of its level frame.
        tables: how the files are written, and the first frame in them.
        count: number of frames.
        sample_time: time from one frame to the next, s.
        pose_scale: factor on the lengths of the poses; "estimated": of the `calibration`.

    Raises:
        UserError: if the file is not valid, or shows no scale.
    """
    times = sample_time * np.arange(count)
    if not files:
        return EgoMotion(times, np.tile([0.0, 0.0, STRAIGHT_AHEAD], (count, 1)))
    poses, rows = read_poses(files, tables), slice(tables.first, tables.first + count)
    scale = calibration.length_ratio if pose_scale == "estimated" else pose_scale
    if np.isnan(scale):
        raise UserError(f"source.pose_scale: cannot be estimated: {calibration.text}")
    poses = poses * [1.0, 1.0, 1.0, scale]
    # The frames before the first show the road's direction there.
    pitches, heights = rocking(poses, rig.level_from_camera)
    planar = planar_poses(poses[rows], rig.level_from_camera)
    return EgoMotion(times, planar, pitches[rows], heights[rows])


def replayed_motion(
    files: tuple[Path, ...], tables: Tables, count: int, sample_time: float
) -> EgoMotion:
    """Planar motion at the first `count` frames, (0, 0, pi/2) at the first of them.

    The recording's camera is taken as level. Its roll, its height and changes of its pitch are left
    out; nothing is smoothed.

    The arguments are those of `recorded_motion`.
    """
    poses = read_poses(files, tables)[tables.first : tables.first + count]
    return EgoMotion(sample_time * np.arange(count), planar_poses(poses, np.eye(3)))


REACH = 20.0
"""The road is a straight line over this distance up to a frame, m: on real frames the pitch of the
images was as near as with 10 m before and 10 m after it, which a live camera does not have."""

LEAST_REACH = 5.0
"""A shorter way shows no direction, m: then pitch and height are those of the rig."""


def rocking(poses: np.ndarray, level_from_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pitches (K,) rad and heights (K,) m of a camera beyond those of its level frame.

    The road at a frame is the line through the camera's places up to it, by least squares: so a
    slope of the road is no pitch. No later pose counts. A pitch is positive with the nose down.

    Args:
        poses: (K, 3, 4) as in `planar_poses`.
        level_from_camera: (3, 3) rotation, see `Rig`.
    """
    pitches, heights = np.zeros(len(poses)), np.zeros(len(poses))
    way = np.concatenate(
        [[0.0], np.cumsum(np.linalg.norm(np.diff(poses[:, :, 3], axis=0), axis=1))]
    )
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
