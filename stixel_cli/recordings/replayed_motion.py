"""The ego car's motion of `path=recorded`."""

from pathlib import Path

import numpy as np

from stixel_cli.recordings.labelled import planar_poses
from stixel_cli.recordings.tables import read_kitti_poses
from stixel_cli.scene.scenario import EgoMotion


def replayed_motion(
    files: tuple[Path, ...], first: int, count: int, sample_time: float
) -> EgoMotion:
    """Planar motion at `count` frames from number `first` on, (0, 0, pi/2) at the first of them.

    The recording's camera is taken as level. Its roll, its height and changes of its pitch are left
    out; nothing is smoothed.

    Args:
        files: the file of the poses.
        first: number of the first frame: its row in the file.
        count: number of frames.
        sample_time: time from one frame to the next, s.

    Raises:
        UserError: if the file is not valid.
    """
    poses = read_kitti_poses(files[0])[first : first + count]
    return EgoMotion(sample_time * np.arange(count), planar_poses(poses, np.eye(3)))
