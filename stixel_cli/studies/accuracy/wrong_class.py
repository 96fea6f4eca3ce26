"""What the tracker `contour` loses with the prior of another class, or of no class."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.evaluation.metric_table import metric, over_runs
from stixel_cli.evaluation.verdict import misfits_class
from stixel_cli.studies.data import StudyRun, chosen, names, run_frame
from stixel_cli.studies.runs import metric_over_seeds, paired_difference
from stixel_cli.studies.tables import interval_columns, with_unit
from stixel_cli.studies.types import Table

if TYPE_CHECKING:
    import pandas as pd

MEASURES = ("iou_mean", "iou_box_mean")
"""Metrics with a loss."""

OTHERS = ("centre_rmse_m", "track_lost", "warned", "class_error")
"""Metrics without one; `warned` is the share of runs whose verdict warns of the class."""


def wrong_class_table(runs: Sequence[StudyRun]) -> Table:
    """One row for each road user and prior."""
    frame = run_frame(runs)
    frame = frame.assign(warned=[float(misfits_class(run.metrics)) for run in runs])
    if "class_error" not in frame:
        frame = frame.assign(class_error=np.nan)
    rows = []
    for user in names(frame, "road_user"):
        own = chosen(frame, road_user=user)
        right = chosen(own, prior=user)
        rows += [
            _row(user, prior, right, chosen(own, prior=prior)) for prior in names(own, "prior")
        ]
    columns: list = ["road user", "prior", "n"]
    for name in MEASURES:
        label = with_unit(metric(over_runs(name)))
        columns += interval_columns(label, label)
        columns += interval_columns(f"loss, {label}", f"loss, {label}")
    for name in OTHERS:
        label = "warned of the class" if name == "warned" else with_unit(metric(over_runs(name)))
        columns += interval_columns(label, label)
    return Table("wrong_class", "", tuple(columns), tuple(rows))


def _row(user: str, prior: str, right: "pd.DataFrame", own: "pd.DataFrame") -> tuple:
    cells: list = [user, prior, own["seed"].nunique()]
    for name in MEASURES:
        found = metric_over_seeds(own, name)
        cells += [found.mean, found.low, found.high]
        if prior == user:
            cells += [None] * 3
        else:
            loss = paired_difference(right, own, name)
            cells += [loss.mean, loss.low, loss.high]
    for name in OTHERS:
        found = metric_over_seeds(own, name)
        cells += [found.mean, found.low, found.high]
    return tuple(cells)
