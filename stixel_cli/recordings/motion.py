"""The ego car's motion from the poses of a recording."""

from pathlib import Path

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.planar import planar_poses
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
