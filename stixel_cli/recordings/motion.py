"""The ego car's motion from the poses of a recording."""

from pathlib import Path

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.poses_file import read_poses
from stixel_cli.scene.scenario import EgoMotion


def recorded_motion(
    files: tuple[Path, ...], rig: Rig, first: int, count: int, sample_time: float
) -> EgoMotion:
    """Planar motion at `count` frames from number `first` on, (0, 0, pi/2) at the first of them.

    Args:
        files: the file of the poses; empty for a parked ego car.
        rig: the ground plane is that of its level frame.
        first: number of the first frame: its row in the file.
        count: number of frames.
        sample_time: time from one frame to the next, s.

    Raises:
        UserError: if the file is not valid.
    """
    times = sample_time * np.arange(count)
    if not files:
        return EgoMotion(times, np.tile([0.0, 0.0, STRAIGHT_AHEAD], (count, 1)))
    poses = read_poses(files[0])[first : first + count]
    return EgoMotion(times, planar_poses(poses, rig.level_from_camera))


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
