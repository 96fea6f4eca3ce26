"""What the tracker `contour` loses with the prior of another class, or of no class."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stixel_cli.evaluation.verdict import misfits_class
from stixel_cli.studies.accuracy.effects import Effects, effects_table
from stixel_cli.studies.data import StudyRun, names, run_frame
from stixel_cli.studies.types import Table

WARNED = "warned_of_the_class"
"""The share of runs whose verdict warns of the class."""

EFFECTS = Effects(
    name="wrong_class",
    column="prior",
    heading="prior",
    effect="loss",
    measures=("iou_mean", "iou_box_mean"),
    others=("centre_rmse_m", "track_lost", WARNED, "class_error"),
)


def wrong_class_table(name: str, runs: Sequence[StudyRun]) -> Table:
    """One row for each road user and prior."""
    frame = run_frame(runs)
    frame = frame.assign(**{WARNED: [float(misfits_class(run.metrics)) for run in runs]})
    if "class_error" not in frame:
        frame = frame.assign(class_error=np.nan)
    references = {user: user for user in names(frame, "road_user")}
    return effects_table(replace(EFFECTS, name=name), frame, references)
