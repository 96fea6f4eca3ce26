"""RQ3: runs with the errors of their points, the measures of a run, and the cost of a scan."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.report.blocks import Cell, Table
from stixel_cli.report.tables import chosen, names
from stixel_cli.studies.data import StudyRun, StudySweep, run_frame
from stixel_cli.studies.real_time import on_cores, seconds_a_scan, seconds_frame
from stixel_cli.validation.point_errors import PointErrors

if TYPE_CHECKING:
    import pandas as pd

SIMULATED, FABRICATED, FITTED = "simulated", "fabricated", "fitted"

SCAN = ["road_user", "path", "seed"]
"""Columns that determine the scans of a sweep."""
PAIR = [*SCAN, "tracker"]
"""Columns that are equal in runs that are compared."""

SHARED = ("ego_motion", "scenario")
"""Stages that both kinds of scan begin with; not counted as the cost of either."""
STAGES = ("render", "add_sensor_noise", "match", "free_space", "stixels", "scans")
"""Further stages of scans, in any pipeline of the study."""
DECADES = "log10 of mean "
"""Begin of the labels of measures in decades."""
THESIS = 60.0
"""The thesis states that simulated scans take more than this many times as long."""


@dataclass(frozen=True)
class Measure:
    """A number of a run.

    Attributes:
        label: its name.
        unit: its unit, "" if it has none.
        of: returns it; None for a missing value.
    """

    label: str
    unit: str
    of: Callable[[StudyRun, PointErrors], float | None]

    def __str__(self) -> str:
        return f"{self.label} ({self.unit})" if self.unit else self.label


def runs_of(sweep: StudySweep) -> "pd.DataFrame":
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


def by_noise(sweep: StudySweep) -> dict[str, StudySweep]:
    """The values of the swept keys of the measurement, to the part of the sweep that has them.

    Without such a key there is one part, and its name is empty.
    """
    parts: dict[str, list[StudyRun]] = {}
    for run in sweep.runs:
        keys = [key for key in run.setting if key.startswith("measurement")]
        parts.setdefault(", ".join(f"{key}={run.setting[key]}" for key in keys), []).append(run)
    return {name: replace(sweep, runs=tuple(runs)) for name, runs in parts.items()}


def cost_of(simulated: StudySweep, fabricated: StudySweep) -> dict[str, Any]:
    """The computational cost of a scan of both kinds.

    Returns:
        `simulated`, `fabricated`: stage to CPU seconds a scan, medians over the runs, including
        the stages of `SHARED`. `simulated_total`, `fabricated_total`: median of the runs' sums over
        the other stages; None if CPU seconds are missing. `ratio`: of the totals, or None.
        `quartiles`: first and third, of the ratios of runs with the same scan; None without any.
    """
    totals = []
    for sweep in (simulated, fabricated):
        seconds = seconds_frame(sweep.runs, STAGES)
        # A pipeline lacks some stages; a stage that was run has its seconds, or they are unknown.
        absent = [[stage not in run.cpu_seconds for stage in STAGES] for run in sweep.runs]
        total = seconds.mask(np.array(absent, bool).reshape(seconds.shape), 0.0).sum(
            axis=1, skipna=False
        )
        total = total.where(seconds["scans"].notna())
        frame = run_frame(sweep.runs)[SCAN].assign(total=total.to_numpy()).dropna()
        # Trackers of one scan count once.
        totals.append(frame.drop_duplicates(SCAN, keep="last").set_index(SCAN)["total"])
    one, other = totals
    ours, theirs = (float(total.median()) if len(total) else None for total in totals)
    ratios = (one / other[other > 0.0]).dropna()
    stages = (*SHARED, *STAGES)
    return {
        "simulated": seconds_a_scan(simulated.runs, stages),
        "fabricated": seconds_a_scan(fabricated.runs, stages),
        "simulated_total": ours,
        "fabricated_total": theirs,
        "ratio": ours / theirs if ours is not None and theirs else None,
        "quartiles": ratios.quantile([0.25, 0.75]).tolist() if len(ratios) else None,
    }


def cost_table(cost: dict[str, Any], runs: "dict[str, pd.DataFrame]") -> Table:
    """CPU seconds by stage, and of all stages that are not shared; then of the work in real time.

    `runs` are the frames of the simulated and the fabricated sweep. The work in real time is that
    from the images to the track, see `studies.real_time`. The last columns are relative to the
    sample time T.
    """
    kinds = (SIMULATED, FABRICATED)
    rows: dict[str, Sequence[float | None]] = {
        stage: [cost[kind].get(stage) for kind in kinds]
        for stage in dict.fromkeys((*cost[SIMULATED], *cost[FABRICATED]))
    }
    rows["sum without shared stages"] = [cost[f"{kind}_total"] for kind in kinds]
    for tracker in names(runs[SIMULATED], "tracker"):
        own = [chosen(runs[kind], tracker=tracker)["run"].tolist() for kind in kinds]
        seconds = [seconds_a_scan(one) for one in own]
        cores = [on_cores(one) if "track" in one else (None, None) for one in seconds]
        rows[f"track, {tracker}"] = [one.get("track") for one in seconds]
        for i, name in enumerate(("one core", "two cores at least")):
            rows[f"images to track, {tracker}, {name}"] = [one[i] for one in cores]
    sample_time = runs[SIMULATED]["run"].iloc[0].configuration.path.sample_time
    return Table.of("cost", (_cost_row(*row, sample_time) for row in rows.items()))


def _cost_row(stage: str, seconds: Sequence[float | None], sample_time: float) -> dict[str, Cell]:
    row: dict[str, Cell] = {"stage": stage, SIMULATED: seconds[0], FABRICATED: seconds[1]}
    over = (None if one is None else one / sample_time for one in seconds)
    return row | dict(zip((f"{SIMULATED} / T", f"{FABRICATED} / T"), over, strict=True))


def neighbour_columns(runs: Sequence[PointErrors]) -> float:
    """Median spacing of points, columns: the lag at which all kinds of scan are compared."""
    spacings = [run.spacing for run in runs if np.isfinite(run.spacing)]
    return float(np.median(spacings)) if spacings else 1.0


def correlogram(runs: Sequence[PointErrors], lags: Sequence[float]) -> list[float | None]:
    """Correlation of the disparity's error at lags, columns within half a column.

    The mean error of each run is subtracted; points outside the silhouette are left out.
    """
    products: list[list[np.ndarray]] = [[] for _ in lags]
    squares = []
    for run in runs:
        own = run.inside > 0.0
        if not own.any():
            continue
        rest = run.disparities - run.disparities[own].mean()
        squares.append(rest[own] ** 2)
        for step in range(1, len(rest)):
            apart = run.columns[step:] - run.columns[:-step]
            same = (run.scans[step:] == run.scans[:-step]) & own[step:] & own[:-step]
            if not same.any() or apart[same].min() > max(lags) + 0.5:
                break
            product = rest[step:] * rest[:-step]
            for i, lag in enumerate(lags):
                products[i].append(product[same & (np.abs(apart - lag) < 0.5)])
    power = float(np.concatenate(squares).mean()) if squares else 0.0
    found = [np.concatenate(p) if p else np.zeros(0) for p in products]
    # Blocks of columns are rarely closer than a block's width, which leaves too few pairs.
    fewest = max(2.0, 0.1 * max((len(p) for p in found), default=0))
    return [float(p.mean()) / power if len(p) >= fewest and power > 0.0 else None for p in found]


def _mean(values: np.ndarray) -> float | None:
    values = 1.0 * values
    values = values[np.isfinite(values)]
    return float(values.mean()) if len(values) else None


def _std(values: np.ndarray) -> float | None:
    return float(values.std(ddof=1)) if len(values) > 1 else None


def _scan_correlation(run: PointErrors) -> float | None:
    """Correlation of a scan's mean error with the next scan's; None without a spread."""
    count = np.bincount(run.scans, minlength=len(run.times))
    total = np.bincount(run.scans, weights=run.disparities, minlength=len(run.times))
    both = (count[1:] > 0) & (count[:-1] > 0)
    means = np.divide(total, count, out=np.zeros(len(count)), where=count > 0)
    if both.sum() < 3:
        return None
    one, other = means[:-1][both], means[1:][both]
    if one.std() < 1e-9 or other.std() < 1e-9:
        return None
    return float(np.corrcoef(one, other)[0, 1])


def _sideways(run: StudyRun, errors: PointErrors) -> float | None:
    """Shift of both ends to the right, m at the mean range."""
    shift = _mean(0.5 * (errors.reach_right - errors.reach_left))
    reach = _mean(errors.true_ranges)
    if shift is None or reach is None:
        return None
    return shift * reach / run.configuration.rig.focal


def point_measures(lag: float) -> dict[str, Measure]:
    """Measures of a run's points; neighbours are `lag` columns apart."""
    share, reach = "share of the target's columns without a point", "reach beyond the silhouette's"
    std = "standard deviation"
    ends = lambda e: np.concatenate([e.reach_left, e.reach_right])  # noqa: E731
    rows = {
        "bias_along": ("bias along the ray", "m", lambda e: _mean(e.along)),
        "bias_disparity": ("bias of the disparity", "px", lambda e: _mean(e.disparities)),
        "std": (f"{std} along the ray", "m", lambda e: _std(e.along)),
        "std_disparity": (
            "standard deviation of the disparity",
            "px",
            lambda e: _std(e.disparities),
        ),
        "bias_across": ("bias across the ray", "m", None),
        "neighbours": ("correlation of neighbours", "", lambda e: correlogram([e], [lag])[0]),
        "scans": ("correlation of successive scans' means", "", _scan_correlation),
        "reach": (f"{reach} ends", "px", lambda e: _mean(ends(e))),
        "beside": ("share of points outside the silhouette", "", lambda e: _mean(e.inside < 0.0)),
        "missed": (share, "", lambda e: _mean(1.0 - e.covered)),
        "points": ("points of the target in a scan", "", lambda e: len(e.scans) / len(e.times)),
        "clutter": ("clutter points in a scan", "", lambda e: _mean(e.clutter)),
    }
    return {
        name: Measure(label, unit, _sideways if of is None else lambda _, e, of=of: of(e))
        for name, (label, unit, of) in rows.items()
    }


def _metric(name: str) -> Measure:
    row = METRICS[name]
    return Measure(row.short_label, row.unit, lambda run, _: run.metrics.get(name))


def _decades(name: str) -> Measure:
    def of(run: StudyRun, _: PointErrors) -> float | None:
        value = run.metrics.get(name)
        return None if value is None or value <= 0.0 else float(np.log10(value))

    return Measure(f"log10 of {METRICS[name].short_label}", METRICS[name].unit, of)


TRACKER_MEASURES = {
    "centre": _metric("centre_rmse_m"),
    "orientation": _metric("orientation_rmse_deg"),
    "iou": _metric("iou_mean"),
    "iou_hull": _metric("iou_hull_mean"),
    "iou_box": _metric("iou_box_mean"),
    "nees": _decades("nees_position_mean"),
    "nis": _decades("nis_mean"),
}
