"""The truth of a recording: its labels, moved into the world by the ego poses."""

from pathlib import Path

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.labelled import box_scenario, labelled_scenario
from stixel_cli.recordings.tables import labels_of
from stixel_cli.recordings.types import KITTI, TableLayout
from stixel_cli.scene.scenario import EgoMotion, Scenario


def recorded_scenario(
    ego_motion: EgoMotion,
    files: tuple[Path, ...],
    rig: Rig,
    first: int,
    left_camera: tuple[float, float, float],
    target: int | str | None,
    layout: TableLayout = KITTI,
) -> Scenario:
    """Ground truth of one labelled target; NaN at the frames without its label.

    The contour is the rectangle of the label. A frame counts for the scores if the label is
    neither truncated nor occluded.

    Args:
        ego_motion: at the frames of the recording.
        files: the files of the labels; empty without target.
        rig: the ground plane is that of its level frame.
        first: number of the first frame.
        left_camera: place of the left camera in the frame of the labels, m.
        target: its track id; None for no truth.
        layout: of the files.

    Raises:
        UserError: if the file is not valid, or has no such target.
    """
    if target is None:
        count = len(ego_motion.times)
        unknown, scored = np.full((count, 3), np.nan), np.zeros(count, dtype=bool)
        return box_scenario(ego_motion, unknown, np.zeros((0, 2)), scored)
    return labelled_scenario(ego_motion, labels_of(files, layout, target), rig, first, left_camera)
