"""What the metrics of a run are called, their units, and which value is better."""

import math
from dataclasses import dataclass
from typing import Literal

Better = Literal["less", "more", "one"]

NO_VALUE = "–"


@dataclass(frozen=True)
class Metric:
    """How a metric is shown.

    Attributes:
        label: what it is called.
        unit: its unit, "" if it has none.
        better: which value is better; "one" if the nearest to 1; None if none is.
    """

    label: str
    unit: str
    better: Better | None


METRICS = {
    "centre_rmse_m": Metric("centre error, RMSE", "m", "less"),
    "centre_mean_m": Metric("centre error, mean", "m", "less"),
    "centre_rmse_second_half_m": Metric("centre error, RMSE of the second half", "m", "less"),
    "centre_final_m": Metric("centre error, last scan", "m", "less"),
    "orientation_rmse_deg": Metric("orientation error, RMSE", "°", "less"),
    "orientation_rmse_second_half_deg": Metric(
        "orientation error, RMSE of the second half", "°", "less"
    ),
    "iou_mean": Metric("IoU, mean", "", "more"),
    "iou_second_half": Metric("IoU, mean of the second half", "", "more"),
    "iou_final": Metric("IoU, last scan", "", "more"),
    "low_overlap_share": Metric("share of low overlap, IoU < 0.2", "", "less"),
    "nees_position_mean": Metric("NEES of the position / 2, mean (1 is consistent)", "", "one"),
    "nees_heading_mean": Metric("NEES of the heading, mean (1 is consistent)", "", "one"),
    "nis_mean": Metric("NIS / degrees of freedom, mean (1 is consistent)", "", "one"),
    "scans": Metric("scans", "", None),
    "empty_scans": Metric("empty scans", "", None),
    "points_per_scan_mean": Metric("points in a scan, mean", "", None),
    "points_used_mean": Metric("points used of a scan, mean", "", None),
}

_SUFFIXES = {"_m": "m", "_deg": "°", "_s": "s"}


def metric(name: str) -> Metric:
    """How the metric `name` is shown; one that is not known by its name and its suffix's unit."""
    if name in METRICS:
        return METRICS[name]
    suffix = next((s for s in _SUFFIXES if name.endswith(s)), "")
    return Metric(
        name.removesuffix(suffix).replace("_", " "), _SUFFIXES.get(suffix, ""), better=None
    )


def format_value(value: float | int | None) -> str:
    """A value with three or four significant digits; a dash if there is none."""
    if value is None or not math.isfinite(value):
        return NO_VALUE
    if isinstance(value, int):
        return str(value)
    if value == 0.0 or 0.001 <= abs(value) < 1000.0:
        digits = 3 if abs(value) < 10.0 else 2 if abs(value) < 100.0 else 1
        return f"{value:.{digits}f}"
    return f"{value:.3g}"


def best(name: str, values: list[float | int | None]) -> list[bool]:
    """Which of the values are the best; none if they are all alike or none is better."""
    direction = metric(name).better
    known = [v for v in values if v is not None]
    if direction is None or len(set(known)) < 2:
        return [False] * len(values)
    ranks = [None if v is None else _rank(v, direction) for v in values]
    least = min(r for r in ranks if r is not None)
    return [r == least for r in ranks]


def _rank(value: float, direction: Better) -> float:
    if direction == "one":
        return abs(math.log(value)) if value > 0.0 else math.inf
    return value if direction == "less" else -value
