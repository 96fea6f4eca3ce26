"""RQ3: the measures of a run: of its points against the true contour, and of its track."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.report.run_frame import run_frame
from stixel_cli.report.tables import names
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.validation.point_statistics import point_statistics

SIMULATED, FABRICATED, FITTED = "simulated", "fabricated", "fitted"

SCAN = ["road_user", "path", "seed"]
"""Columns that determine the scans of a sweep."""
PAIR = [*SCAN, "tracker"]
"""Columns that are equal in runs that are compared."""


@dataclass(frozen=True)
class Measure:
    """A number of a run: its name, and its unit, "" if it has none."""

    label: str
    unit: str

    def __str__(self) -> str:
        return f"{self.label} ({self.unit})" if self.unit else self.label


_REACH = "reach beyond the silhouette's"
POINT_MEASURES = {
    "bias_along": Measure("bias along the ray", "m"),
    "bias_disparity": Measure("bias of the disparity", "px"),
    "std": Measure("standard deviation along the ray", "m"),
    "std_disparity": Measure("standard deviation of the disparity", "px"),
    "bias_across": Measure("bias across the ray", "m"),
    "neighbours": Measure("correlation of neighbours", ""),
    "scans": Measure("correlation of successive scans' means", ""),
    "reach": Measure(f"{_REACH} ends", "px"),
    "beside": Measure("share of points outside the silhouette", ""),
    "missed": Measure("share of the target's columns without a point", ""),
    "points": Measure("points of the target in a scan", ""),
    "clutter": Measure("clutter points in a scan", ""),
}
_METRICS = {
    "centre": "centre_rmse_m",
    "orientation": "orientation_rmse_deg",
    "iou": "iou_mean",
    "iou_hull": "iou_hull_mean",
    "iou_box": "iou_box_mean",
    "nees": "nees_position_mean",
    "nis": "nis_mean",
}
DECADES = "log10 of "
"""Begin of the labels of metrics that are compared as log10."""
TRACKER_MEASURES = {
    name: Measure(
        (DECADES if METRICS[metric].better == "one" else "") + METRICS[metric].short_label,
        METRICS[metric].unit,
    )
    for name, metric in _METRICS.items()
}


def runs_of(sweep: SweepResult) -> pd.DataFrame:
    """The frame of a sweep's runs, with the errors of their points as `errors`.

    The runs of several trackers on the same scans share one object.
    """
    runs = run_frame(sweep.runs).drop_duplicates(PAIR, keep="last")
    first = runs.drop_duplicates(SCAN)
    errors = {
        key: run.load("point_errors")
        for key, run in zip(first[SCAN].itertuples(index=False), first["run"], strict=True)
    }
    return runs.assign(errors=[errors[key] for key in runs[SCAN].itertuples(index=False)])


def tracker_values(runs: pd.DataFrame) -> pd.DataFrame:
    """`TRACKER_MEASURES` of the runs, with `PAIR` as index."""
    columns = [*_METRICS.values()]
    values = runs.set_index(PAIR).reindex(columns=columns).set_axis([*_METRICS], axis=1)
    values = values.replace([np.inf, -np.inf], np.nan)
    for name, measure in TRACKER_MEASURES.items():
        if measure.label.startswith(DECADES):
            values[name] = np.log10(values[name].where(values[name] > 0.0))
    return values


def point_values(runs: pd.DataFrame, lag: float) -> pd.DataFrame:
    """`POINT_MEASURES` of the runs, with `PAIR` as index; neighbours are `lag` columns apart.

    All trackers have the same points: the index has "" in the place of their names.
    """
    first = runs[runs["tracker"] == names(runs, "tracker")[0]].assign(tracker="")
    rows = [
        point_statistics(errors, run.configuration.rig.focal, lag)
        for run, errors in zip(first["run"], first["errors"], strict=True)
    ]
    index = pd.MultiIndex.from_frame(first[PAIR])
    return pd.DataFrame(rows, index, [*POINT_MEASURES], dtype=float)
