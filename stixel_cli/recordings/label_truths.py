"""The truth of all labels of a recording, for the scores of the tracks of moving objects."""

from pathlib import Path

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.labelled import labelled_scenario
from stixel_cli.recordings.tables import read_labels
from stixel_cli.recordings.types import KITTI, LabelTruth, TableLayout
from stixel_cli.scene.classes import CLASS_OF_KITTI_TYPE
from stixel_cli.scene.scenario import EgoMotion


def label_truths(
    ego_motion: EgoMotion,
    files: tuple[Path, ...],
    rig: Rig,
    first: int,
    left_camera: tuple[float, float, float],
    layout: TableLayout = KITTI,
) -> tuple[LabelTruth, ...]:
    """The truth of each label in the frames of `ego_motion`; () without files.

    The arguments are those of `scenario.recorded_scenario`.

    Raises:
        UserError: if a file is not valid.
    """
    stop = first + len(ego_motion.times)
    return tuple(
        LabelTruth(
            str(name),
            CLASS_OF_KITTI_TYPE.get(labels.kind, "other"),
            labelled_scenario(ego_motion, labels, rig, first, left_camera),
        )
        for name, labels in (read_labels(files, layout).items() if files else ())
        if np.any((labels.frames >= first) & (labels.frames < stop))
    )
