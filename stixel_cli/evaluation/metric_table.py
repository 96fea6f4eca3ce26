"""The scores of a track, and how to show them: errors over time and scalar metrics.

Each error over time and each metric has one row here. Tables, figures and pages read labels, units
and bounds from the row. The row of a metric also has the function that sums up the errors of a run.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

LOW_OVERLAP = 0.2
"""A scan has low overlap if its IoU is below this."""


@dataclass(frozen=True)
class Scores:
    """Errors over time and their summary.

    Attributes:
        times: (K,) s.
        centre_error: (K,) m.
        orientation_error: (K,) rad in (-pi, pi], estimated minus true; NaN if missing.
        iou: (K,) intersection over union of the estimated and the true contour, 0 … 1.
        nees_position: (K,) position NEES divided by 2: 1 is consistent.
        nis: (K,) NIS divided by its degrees of freedom: 1 is consistent; NaN for an empty scan.
        metrics: name to value; None if the metric has no value.
    """

    times: np.ndarray
    centre_error: np.ndarray
    orientation_error: np.ndarray
    iou: np.ndarray
    nees_position: np.ndarray
    nis: np.ndarray
    metrics: dict[str, float | int | None]


@dataclass(frozen=True)
class Series:
    """An error over time.

    Attributes:
        label: full name.
        short_label: name where space is short.
        unit: of the values shown; "" without one.
        factor: from the unit of the field of `Scores` to `unit`.
        bounds: least and greatest possible value; None where there is no bound.
        consistent: the value of a perfect or consistent filter, to mark; None to mark no value.
        ratio: whether the axis is logarithmic.
    """

    label: str
    short_label: str
    unit: str
    bounds: tuple[float | None, float | None]
    consistent: float | None = None
    factor: float = 1.0
    ratio: bool = False


SERIES = {
    "centre_error": Series("Centre error", "Centre error", "m", (0.0, None)),
    "orientation_error": Series(
        "Orientation error", "Orientation error", "°", (None, None), 0.0, float(np.degrees(1.0))
    ),
    "iou": Series("Intersection over union", "IoU", "", (0.0, 1.0)),
    "nees_position": Series(
        "Position NEES / 2", "Position NEES / 2", "", (0.0, None), 1.0, ratio=True
    ),
    "nis": Series("NIS / degrees of freedom", "NIS / d.o.f.", "", (0.0, None), 1.0, ratio=True),
}
"""Field of `Scores` to row, in the order in which figures show them."""

Better = Literal["less", "more", "one"]


@dataclass(frozen=True)
class ScanErrors:
    """Errors and counts of one track over its K scans.

    Attributes:
        centre: (K,) m.
        orientation: (K,) degrees in (-180, 180], estimated minus true.
        iou: (K,) intersection over union of the contours, 0 … 1.
        nees_position, nees_heading: (K,) NEES divided by its dimension; NaN without a valid
            covariance.
        nis: (K,) NIS divided by its degrees of freedom; NaN for an empty scan.
        points, points_used: (K,) points of the scan, and those that the tracker used.
    """

    centre: np.ndarray
    orientation: np.ndarray
    iou: np.ndarray
    nees_position: np.ndarray
    nees_heading: np.ndarray
    nis: np.ndarray
    points: np.ndarray
    points_used: np.ndarray


@dataclass(frozen=True)
class Metric:
    """A scalar metric of one run.

    Attributes:
        name: key in `metrics.json`, and column of tables.
        label: full name.
        short_label: name where space is short.
        unit: "" without one.
        better: which value is better: less, more, or the nearest to one (of a ratio that is 1
            where a tracker is consistent); None if no value is better.
        bounds: least and greatest possible value; None where there is no bound.
        over_scans: sums up the errors of a run; None or a value that is not finite where the metric
            has no value. Over runs, a metric is summed up by its mean.
    """

    name: str
    label: str
    short_label: str
    unit: str
    better: Better | None
    bounds: tuple[float | None, float | None]
    over_scans: Callable[[ScanErrors], float | int | None]

    def of_run(self, errors: ScanErrors) -> float | int | None:
        """The value of the metric; None where it has no value. Never NaN: JSON has no NaN."""
        value = self.over_scans(errors)
        return None if value is None or not np.isfinite(value) else value


def mean(values: np.ndarray) -> float | None:
    """Mean, or None if there is no value or one that is not finite."""
    values = np.asarray(values, dtype=np.float64)
    return float(values.mean()) if len(values) and np.isfinite(values).all() else None


def root_mean_square(values: np.ndarray) -> float | None:
    """Root of the mean square, or None if there is no value or one that is not finite."""
    square = mean(np.square(np.asarray(values, dtype=np.float64)))
    return None if square is None else float(np.sqrt(square))


def finite_mean(values: np.ndarray) -> float | None:
    """Mean of the finite values, or None if no value is finite."""
    return mean(values[np.isfinite(values)])


def second_half(values: np.ndarray) -> np.ndarray:
    """The values from scan K // 2 on."""
    return values[len(values) // 2 :]


_METRE = ("m", "less", (0.0, None))
_DEGREE = ("°", "less", (0.0, None))
_OVERLAP = ("", "more", (0.0, 1.0))
_SHARE = ("", "less", (0.0, 1.0))
_RATIO = ("", "one", (0.0, None))
_COUNT = ("", None, (0.0, None))

_TABLE = (
    Metric("centre_rmse_m", "centre error, RMSE", "centre RMSE",
           *_METRE, lambda e: root_mean_square(e.centre)),
    Metric("centre_mean_m", "centre error, mean", "mean centre error",
           *_METRE, lambda e: mean(e.centre)),
    Metric("centre_rmse_second_half_m", "centre error, RMSE of the second half",
           "centre RMSE, second half", *_METRE, lambda e: root_mean_square(second_half(e.centre))),
    Metric("centre_final_m", "centre error, last scan", "centre error, last scan",
           *_METRE, lambda e: mean(e.centre[-1:])),
    Metric("orientation_rmse_deg", "orientation error, RMSE", "orientation RMSE",
           *_DEGREE, lambda e: root_mean_square(e.orientation)),
    Metric("orientation_rmse_second_half_deg", "orientation error, RMSE of the second half",
           "orientation RMSE, second half",
           *_DEGREE, lambda e: root_mean_square(second_half(e.orientation))),
    Metric("iou_mean", "IoU, mean", "mean IoU", *_OVERLAP, lambda e: mean(e.iou)),
    Metric("iou_second_half", "IoU, mean of the second half", "mean IoU, second half",
           *_OVERLAP, lambda e: mean(second_half(e.iou))),
    Metric("iou_final", "IoU, last scan", "IoU, last scan", *_OVERLAP, lambda e: mean(e.iou[-1:])),
    Metric("low_overlap_share", f"share of scans with IoU < {LOW_OVERLAP}",
           "share of low overlap", *_SHARE, lambda e: mean(e.iou < LOW_OVERLAP)),
    Metric("nees_position_mean", "NEES of the position / 2, mean (1 is consistent)",
           "mean NEES / 2", *_RATIO, lambda e: finite_mean(e.nees_position)),
    Metric("nees_heading_mean", "NEES of the heading, mean (1 is consistent)", "mean NEES, heading",
           *_RATIO, lambda e: finite_mean(e.nees_heading)),
    Metric("nis_mean", "NIS / degrees of freedom, mean (1 is consistent)", "mean NIS / d.o.f.",
           *_RATIO, lambda e: finite_mean(e.nis)),
    Metric("scans", "scans", "scans", *_COUNT, lambda e: len(e.points)),
    Metric("empty_scans", "empty scans", "empty scans",
           *_COUNT, lambda e: int(np.sum(e.points == 0))),
    Metric("points_per_scan_mean", "points per scan, mean", "points per scan",
           *_COUNT, lambda e: mean(e.points)),
    Metric("points_used_mean", "points used per scan, mean", "points used per scan",
           *_COUNT, lambda e: mean(e.points_used)),
)  # fmt: skip

METRICS = {metric.name: metric for metric in _TABLE}
"""Name to row, in the order in which tables show them."""

_SUFFIXES = {"_m": "m", "_deg": "°", "_s": "s"}


def metric(name: str) -> Metric:
    """The row of a metric; for an unknown name, one with the name in words and its suffix's unit.

    Files of other versions can have metrics that this table does not have.
    """
    if name in METRICS:
        return METRICS[name]
    suffix = next((s for s in _SUFFIXES if name.endswith(s)), "")
    words = name.removesuffix(suffix).replace("_", " ")
    unit = _SUFFIXES.get(suffix, "")
    return Metric(name, words, words, unit, None, (None, None), lambda errors: None)
