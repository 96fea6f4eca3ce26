"""The thesis's study: the frame of its runs, and the tables."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.config.experiments import experiment_sources
from stixel_cli.config.folders import EXPERIMENT
from stixel_cli.evaluation.metric_table import METRICS, Metric
from stixel_cli.studies.data import GROUPS, StudySweep, chosen, names, run_frame
from stixel_cli.studies.runs import contour_distances, metric_over_seeds, of_runs, quantity
from stixel_cli.studies.tables import over_seeds, std_columns, with_ends
from stixel_cli.studies.types import Table
from stixel_cli.sweeps.statistics import Statistic

if TYPE_CHECKING:
    import pandas as pd

MEASURES = tuple(METRICS[name] for name in ("centre_rmse_m", "orientation_rmse_deg", "iou_mean"))
"""The three measures of the thesis (3.1.2)."""
_CONSISTENCY = (
    *("nees_position_mean", "nis_mean"),
    *("iou_hull_mean", "iou_box_mean", "low_overlap_share", "track_lost"),
)
KERNELS = {"thesis": "the demo's kernel", "thesis_priors": "our priors"}
NEAR = 2.0
"""Points within this distance of the true contour, m, are taken for the target's."""


def frame_of(sweep: StudySweep, level: str = "") -> "pd.DataFrame":
    """The frame of a sweep's runs, as `data.run_frame`, with three columns set.

    `ego`: kind of the ego car's motion. `tracker`: the kernel, which depends on the option of
    `experiment`. `measurement`: its kind; further swept keys but the noise `level` follow.
    """
    runs = run_frame(sweep.runs)
    known = {*GROUPS, EXPERIMENT, "ego", "stereo", level}
    measured, kernels = [], []
    for run in runs["run"]:
        further = [f"{key} {value}" for key, value in run.setting.items() if key not in known]
        measured.append(", ".join([run.configuration.measurement.kind, *further]))
        option = run.setting.get(EXPERIMENT, "thesis")
        kernels.append(KERNELS.get(option, option))
    egos = [run.configuration.ego.kind for run in runs["run"]]
    return runs.assign(ego=egos, measurement=measured, tracker=kernels)


def statistics(runs: "pd.DataFrame") -> list[Statistic]:
    """The `MEASURES` over the seeds of some runs."""
    return [metric_over_seeds(runs, metric.name) for metric in MEASURES]


def tracking_table(name: str, runs: "pd.DataFrame", keys: Sequence[str]) -> Table:
    """One row for each combination of `keys`, and the measures of each kernel with intervals."""
    kernels = names(runs, "tracker")
    rows = []
    for values, own in _grouped(runs, keys):
        cells = [cell for kernel in kernels for cell in _cells(chosen(own, tracker=kernel))]
        rows.append((*values, own["seed"].nunique(), *cells))
    columns = with_ends(f"{_heading(metric)}, {k}" for k in kernels for metric in MEASURES)
    return Table(name, "", (*map(_name, keys), "n", *columns), tuple(rows))


def _grouped(
    runs: "pd.DataFrame", keys: Sequence[str]
) -> "list[tuple[tuple[str, ...], pd.DataFrame]]":
    """The runs by their values of `keys`, ordered as the values of each key first appear."""
    order = {key: names(runs, key) for key in keys}
    groups = list(runs.groupby(list(keys), sort=False))
    return sorted(
        groups,
        key=lambda group: [order[k].index(value) for k, value in zip(keys, group[0], strict=True)],
    )


def _heading(metric: Metric) -> str:
    """Short label and unit, without the statistic."""
    return f"{quantity(metric)} ({metric.unit})" if metric.unit else quantity(metric)


def _name(key: str) -> str:
    return key.replace("_", " ")


def _cells(runs: "pd.DataFrame") -> Iterable[float | None]:
    for metric in MEASURES:
        if runs.empty:
            yield from (None, None, None)
        else:
            one = metric_over_seeds(runs, metric.name)
            yield from (one.mean, one.low, one.high)


def consistency_table(name: str, runs: "pd.DataFrame", keys: Sequence[str]) -> Table:
    """The metrics `_CONSISTENCY` of each kernel, means over the seeds."""
    kernels = names(runs, "tracker")
    metrics = [METRICS[name] for name in _CONSISTENCY]
    rows = []
    for values, own in _grouped(runs, keys):
        cells = [
            metric_over_seeds(chosen(own, tracker=kernel), metric.name).mean
            for kernel in kernels
            for metric in metrics
        ]
        rows.append((*values, *cells))
    columns = (f"{_heading(of_runs(metric))}, {kernel}" for kernel in kernels for metric in metrics)
    return Table(name, "", (*map(_name, keys), *columns), tuple(rows))


def scans_table(name: str, runs: "pd.DataFrame") -> Table:
    """Points and their distances from the true contour, by measurement and ego motion."""
    rows = []
    for values, own in runs.groupby(["measurement", "ego"], sort=False):
        counts, biases, spreads, empty = [], [], [], []
        for run in own["run"]:
            scans = run.load("scans")
            away = contour_distances(scans, run.load("scenario"))
            near = np.abs(away) < NEAR
            k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
            points = np.bincount(k[near], minlength=len(scans))
            counts.append(float(points.mean()))
            empty.append(float((points == 0).mean()))
            biases.append(float(away[near].mean()) if near.any() else None)
            spreads.append(float(np.sqrt(np.mean(away[near] ** 2))) if near.any() else None)
        cells = [(one.mean, one.std) for one in map(over_seeds, (counts, biases, spreads))]
        rows.append((*values, *(cell for pair in cells for cell in pair), over_seeds(empty).mean))
    columns = (
        *("measurement", "ego"),
        *std_columns("points on the target", "points"),
        *std_columns("mean distance from the contour (m)", "mean distance"),
        *std_columns("RMS distance (m)", "RMS distance"),
        "share of scans without points",
    )
    return Table(name, "", columns, tuple(rows))


def level_table(name: str, runs: "pd.DataFrame", key: str, label: str) -> Table:
    """The measures by noise level `key`, road user and kernel."""
    return tracking_table(name, runs.assign(**{label: runs[key]}), ("road_user", label))


def settings_table(name: str, options: Sequence[str], road_users: Sequence[str]) -> Table:
    """Every choice and value of the experiments with its source, as their files state it."""
    sources = [experiment_sources(option) for option in options]
    keys = list(dict.fromkeys(key for own in sources for key in own))
    rows = []
    for key in keys:
        values = [_value(option, key, road_users) for option in options]
        source = dict.fromkeys(own[key] for own in sources if key in own)
        rows.append((key, *values, "; ".join(source)))
    columns = ("option or key", *(KERNELS.get(option, option) for option in options), "source")
    return Table(name, "", columns, tuple(rows))


def _value(option: str, key: str, road_users: Sequence[str]) -> str:
    """The choice or value that an experiment gives; "by class" if the road users differ."""
    found = []
    for road_user in road_users:
        chosen_options = [f"{EXPERIMENT}={option}", f"road_user={road_user}"]
        composed = compose([*chosen_options, "measurement=fabricated"])
        if key == "measurement.noise.disparity_std":
            # A key of the other noise.
            composed = compose([*composed.overrides, "measurement/noise=stereo"])
        found.append(composed.value(key))
    if len(set(map(str, found))) > 1:
        return "by class"
    value = found[0]
    return "null" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
