"""RQ3: runs by what they share, and the measures that a pair of runs is compared in."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.studies.field_names import tracker_name
from stixel_cli.studies.types import StudyRun, StudySweep
from stixel_cli.validation.point_errors import PointErrors

SIMULATED, FABRICATED, FITTED = "simulated", "fabricated", "fitted"


@dataclass(frozen=True)
class Pairing:
    """What runs of a pair have in common."""

    road_user: str
    path: str
    seed: int
    tracker: str


@dataclass(frozen=True)
class Measure:
    """A number that a run has.

    Attributes:
        label: what it is called.
        unit: its unit, "" if it has none.
        of: gives it; None where a run has none.
    """

    label: str
    unit: str
    of: Callable[[StudyRun, PointErrors], float | None]


Runs = Mapping[Pairing, StudyRun]


def runs_of(sweep: StudySweep) -> dict[Pairing, StudyRun]:
    """A sweep's runs by what they share with those of other sweeps."""
    return {pairing(point): point for point in sweep.runs}


def pairing(point: StudyRun) -> Pairing:
    """What a run shares with its partners; names as they were typed, or else the kinds."""
    configuration = point.configuration
    return Pairing(
        point.setting.get("road_user", configuration.road_user.kind),
        point.setting.get("path", configuration.path.kind),
        point.seed,
        tracker_name(point.setting.get("tracker", configuration.tracker.kind), configuration),
    )


def names(runs: Runs, attribute: str) -> list:
    """The values that an attribute of the pairings has, in the order of the runs."""
    return list(dict.fromkeys(getattr(key, attribute) for key in runs))


class Errors:
    """The errors of the points of runs, each read once: trackers of one scan share them."""

    def __init__(self) -> None:
        self._known: dict[tuple, PointErrors] = {}

    def of(self, sweep: str, point: StudyRun) -> PointErrors:
        """Those of one run of a sweep."""
        key = pairing(point)
        name = (sweep, key.road_user, key.path, key.seed)
        if name not in self._known:
            self._known[name] = point.load("point_errors")
        return self._known[name]


def neighbour_columns(runs: Sequence[PointErrors]) -> float:
    """Median spacing of points, columns: at which neighbours are compared in all kinds of scan."""
    spacings = [run.spacing for run in runs if np.isfinite(run.spacing)]
    return float(np.median(spacings)) if spacings else 1.0


def correlogram(runs: Sequence[PointErrors], lags: Sequence[float]) -> list[float | None]:
    """Correlation of the disparity's error at lags, columns within half a column.

    The mean error of each run is taken off; points beside the silhouette are left out.
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
    # Blocks of columns are rarely apart by less than a block's width: too few pairs say nothing.
    fewest = max(2.0, 0.1 * max((len(p) for p in found), default=0))
    return [float(p.mean()) / power if len(p) >= fewest and power > 0.0 else None for p in found]


def _mean(values: np.ndarray) -> float | None:
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


def _sideways(point: StudyRun, run: PointErrors) -> float | None:
    """Shift of both ends to the right, m at the mean range."""
    shift, reach = _mean(0.5 * (run.reach_right - run.reach_left)), _mean(run.true_ranges)
    if shift is None or reach is None:
        return None
    return shift * reach / point.configuration.rig.focal


def point_measures(lag: float) -> dict[str, Measure]:
    """Measures of a run's points; neighbours are `lag` columns apart."""
    return {
        "bias_along": Measure("bias along the ray", "m", lambda _, e: _mean(e.along)),
        "bias_disparity": Measure("bias of the disparity", "px", lambda _, e: _mean(e.disparities)),
        "std": Measure("standard deviation along the ray", "m", lambda _, e: _std(e.along)),
        "std_disparity": Measure(
            "standard deviation of the disparity", "px", lambda _, e: _std(e.disparities)
        ),
        "bias_across": Measure("bias across the ray", "m", _sideways),
        "neighbours": Measure(
            "correlation of neighbours", "", lambda _, e: correlogram([e], [lag])[0]
        ),
        "scans": Measure(
            "correlation of successive scans' means", "", lambda _, e: _scan_correlation(e)
        ),
        "reach": Measure(
            "reach beyond the silhouette's ends",
            "px",
            lambda _, e: _mean(np.concatenate([e.reach_left, e.reach_right])),
        ),
        "beside": Measure(
            "share of points beside the silhouette", "", lambda _, e: _mean(1.0 * (e.inside < 0.0))
        ),
        "missed": Measure(
            "share of the target's columns without a point", "", lambda _, e: _mean(1.0 - e.covered)
        ),
        "points": Measure(
            "points of the target in a scan", "", lambda _, e: len(e.scans) / len(e.times)
        ),
        "clutter": Measure("clutter points in a scan", "", lambda _, e: _mean(1.0 * e.clutter)),
    }


def _metric(name: str) -> Measure:
    row = METRICS[name]
    return Measure(row.short_label, row.unit, lambda point, _: point.metrics.get(name))


def _decades(name: str) -> Measure:
    def of(point: StudyRun, _: PointErrors) -> float | None:
        value = point.metrics.get(name)
        return None if value is None or value <= 0.0 else float(np.log10(value))

    return Measure(f"log10 of {METRICS[name].short_label}", METRICS[name].unit, of)


TRACKER_MEASURES = {
    "centre": _metric("centre_rmse_m"),
    "orientation": _metric("orientation_rmse_deg"),
    "iou": _metric("iou_mean"),
    "nees": _decades("nees_position_mean"),
    "nis": _decades("nis_mean"),
}
