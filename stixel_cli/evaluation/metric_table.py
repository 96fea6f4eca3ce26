"""The one table of scalar metrics: how to compute each from the errors of a run, and to show it.

Tables, figures and pages read label, unit, bounds and the better direction from the row.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from stixel_cli.evaluation import scores
from stixel_cli.tracking.track import REPORTED

NO_VALUE = "–"
"""Shown in the place of a missing value."""

Better = Literal["less", "more", "one"]


@dataclass(frozen=True)
class Metric:
    """A scalar metric of one run.

    Attributes:
        name: key in `metrics.json`, and column of tables.
        label: full name.
        short_label: name where space is short.
        unit: of the value; "" without one.
        better: which value is better: less, more, or the nearest to one (of a ratio that is 1
            where a tracker is consistent); None if no value is better.
        bounds: least and greatest possible value; None where there is no bound.
        over_scans: sums up the errors of a run; None or a value that is not finite where the metric
            has no value. Over runs, a metric is summed up by its mean. None for a metric that is
            not of one track.
        expected: least and greatest value that the verdict does not mention; None for no limit.
        percent: whether tables show the value in per cent.
        over_runs: name of the mean over runs, if it differs.
    """

    name: str
    label: str
    short_label: str
    unit: str
    better: Better | None
    bounds: tuple[float | None, float | None]
    over_scans: Callable[[scores.ScanErrors], float | int | None] | None = None
    expected: tuple[float | None, float | None] = (None, None)
    percent: bool = False
    over_runs: str = ""

    def of_run(self, errors: scores.ScanErrors) -> float | int | None:
        """The value of the metric; None where it has no value. Never NaN: JSON has no NaN."""
        value = self.over_scans(errors)
        return None if value is None or not np.isfinite(value) else value

    @property
    def heading(self) -> str:
        """The short label, with the unit."""
        return f"{self.short_label} ({self.unit})" if self.unit else self.short_label

    @property
    def shown_unit(self) -> str:
        """The unit of the value in tables."""
        return "%" if self.percent else self.unit


_METRE = ("m", "less", (0.0, None))
_DEGREE = ("°", "less", (0.0, None))
_OVERLAP = ("", "more", (0.0, 1.0))
_UPPER_BOUND = ("", None, (0.0, 1.0))
_SHARE = ("", "less", (0.0, 1.0))
_RATIO = ("", "one", (0.0, None))
_COUNT = ("", None, (0.0, None))
_INNOVATIONS = (1.0 / 3.0, 3.0)
"""Residuals are smaller or larger than assumed where a NIS is beyond these.

A NEES has no such limits, nor has the band. If an error stays all run, the NEES of a consistent
filter is beyond these in 33 % of the runs for the position, in 52 % for the orientation. They are
judged over seeds.
"""

_TABLE = (
    Metric("track_lost", "track lost (1) or not (0)", "track lost", *_SHARE,
           lambda e: int(scores.time_to_loss(e.times, e.lost) is not None)
           if len(e.lost) else None, over_runs="track_loss_rate"),
    Metric("time_to_loss_s", "time to track loss", "time to loss",
           "s", "more", (0.0, None), lambda e: scores.time_to_loss(e.times, e.lost)),
    # Only of scans whose sensor's borders are known.
    Metric("time_out_of_view_s", "time at which the road user leaves the field of view",
           "leaves the view", "s", None, (0.0, None),
           lambda e: scores.time_to_loss(e.times, e.out_of_view)),
    Metric("sure_and_wrong_share", "share of scans with IoU of the box < "
           f"{scores.LOW_OVERLAP} and centre error > {scores.SURE:g} σ",
           "sure and wrong", *_SHARE, scores.sure_and_wrong_share),
    Metric("diverged", "diverged (1) or not (0)", "diverged", *_SHARE,
           lambda e: int(scores.time_to_divergence(e) is not None), (None, 0.0)),
    Metric("time_to_divergence_s", "time to divergence", "time to divergence",
           "s", "more", (0.0, None), scores.time_to_divergence),
    Metric("centre_rmse_m", "centre error, RMSE", "centre RMSE",
           *_METRE, lambda e: scores.root_mean_square(e.centre)),
    Metric("centre_mean_m", "centre error, mean", "mean centre error",
           *_METRE, lambda e: scores.mean(e.centre)),
    Metric("orientation_rmse_deg", "orientation error, RMSE", "orientation RMSE",
           *_DEGREE, lambda e: scores.root_mean_square(e.orientation)),
    Metric("speed_error_m_s", "speed error, RMSE", "speed RMSE",
           "m/s", "less", (0.0, None), lambda e: scores.root_mean_square(e.speed)),
    Metric("yaw_rate_error_deg_s", "yaw-rate error, RMSE", "yaw-rate RMSE",
           "°/s", "less", (0.0, None), lambda e: scores.root_mean_square(e.yaw_rate)),
    Metric("iou_mean", "IoU of the outline, mean", "mean IoU",
           *_OVERLAP, lambda e: scores.mean(e.iou)),
    Metric("iou_star_convex_upper_bound", "IoU of the outline, upper bound: star-convex contour",
           "upper bound, star-convex",
           *_UPPER_BOUND, lambda e: scores.mean(e.star_convex_upper_bound)),
    Metric("iou_baseline", "IoU of the true outline, moved to the mean of its points, mean",
           "IoU, baseline", *_UPPER_BOUND, lambda e: scores.finite_mean(e.iou_baseline)),
    Metric("iou_box_mean", "IoU of the box, mean", "mean IoU, box",
           *_OVERLAP, lambda e: scores.mean(e.iou_box)),
    Metric("low_overlap_share",
           f"share of scans with IoU of the outline < {scores.LOW_OVERLAP}",
           "share of low overlap", *_SHARE, lambda e: scores.low_overlap_share(e.iou)),
    Metric("success", "success, area under the curve of the box's IoU", "success",
           *_OVERLAP, lambda e: scores.success(e.iou_box), percent=True),
    Metric("precision", f"precision, area under the curve of the centre error to "
           f"{scores.FARTHEST_CENTRE:g} m", "precision",
           *_OVERLAP, lambda e: scores.precision(e.centre), percent=True),
    Metric("length_error_m", "length error, RMSE", "length RMSE",
           *_METRE, lambda e: scores.root_mean_square(e.length)),
    Metric("width_error_m", "width error, RMSE", "width RMSE",
           *_METRE, lambda e: scores.root_mean_square(e.width)),
    Metric("gaussian_wasserstein_m", "Gaussian-Wasserstein distance, mean", "Gaussian-Wasserstein",
           *_METRE, lambda e: scores.mean(e.gaussian_wasserstein)),
    Metric("hausdorff_m", "Hausdorff distance of the outlines, mean", "Hausdorff distance",
           *_METRE, lambda e: scores.mean(e.hausdorff)),
    Metric("contour_distance_m", "distance of the outlines, mean", "contour distance",
           *_METRE, lambda e: scores.mean(e.contour_distance)),
    Metric("seen_contour_error_m", "distance of the outlines on the seen side, mean",
           "contour error, seen side", *_METRE, lambda e: scores.finite_mean(e.seen_contour)),
    Metric("hidden_contour_error_m", "distance of the outlines on the hidden side, mean",
           "contour error, hidden side",
           *_METRE, lambda e: scores.finite_mean(e.hidden_contour)),
    Metric("band_coverage", "true outline in the estimated 95 % band, share", "band coverage",
           "", None, (0.0, 1.0), lambda e: scores.mean(e.band_coverage)),
    Metric("hidden_band_coverage",
           "hidden side of the true outline in the estimated 95 % band, share",
           "band coverage, hidden side",
           "", None, (0.0, 1.0), lambda e: scores.finite_mean(e.hidden_band_coverage)),
    Metric("nees_position_mean", "NEES of the position / 2, mean (1 is consistent)",
           "mean NEES / 2", *_RATIO, lambda e: scores.finite_mean(e.nees_position)),
    Metric("nees_orientation_mean", "NEES of the orientation, mean (1 is consistent)",
           "mean NEES, orientation",
           *_RATIO, lambda e: scores.finite_mean(e.nees_orientation)),
    Metric("nis_mean", "NIS / degrees of freedom, mean (1 is consistent)", "mean NIS / d.o.f.",
           *_RATIO, lambda e: scores.finite_mean(e.nis), _INNOVATIONS),
    Metric("scans", "scans", "scans", *_COUNT, lambda e: len(e.points)),
    # Only of a recording: all scans of a rendered run count.
    Metric("scored_scans", "scored scans (usable ground truth)", "scored scans",
           *_COUNT, lambda e: len(e.centre)),
    Metric("empty_scans", "empty scans", "empty scans",
           *_COUNT, lambda e: int(np.sum(e.points == 0))),
    Metric("points_per_scan_mean", "points per scan, mean", "points per scan",
           *_COUNT, lambda e: scores.mean(e.points)),
    Metric("points_used_mean", "points used per scan, mean", "points used per scan",
           *_COUNT, lambda e: scores.mean(e.points_used)),
    # Only of a tracker that estimates the size of a class.
    Metric("size_deviation", "size minus the class's, standard deviations of the class, median",
           "size deviation", "", "less", (0.0, None),
           lambda e: scores.finite_median(e.size_deviations[len(e.points) // 2 :]),
           (None, 3.5)),
    Metric("points_beside_share", "share of nearby points not used",
           "points beside", "", None, (0.0, 1.0),
           lambda e: scores.share_of(e.points_beside, e.points_used), (None, 0.1)),
    # Only of a track with probabilities of the classes.
    *(Metric(f"{name}_probability", f"probability of the class {name}, last scan",
             f"probability, {name}", "", None, (0.0, 1.0),
             lambda e, name=name: scores.mean(e.class_probabilities[name][-1:]))
      for name in REPORTED),
    Metric("class_error", "class of the last scan is not the road user's (1) or is (0)",
           "class error", *_SHARE, lambda e: scores.mean(e.class_wrong[-1:]), (None, 0.0)),
    Metric("class_replaced_share", "scans of which another class than the prior's is reported, "
           "share", "class replaced", "", None, (0.0, 1.0),
           lambda e: scores.mean(e.class_replaced), (None, 0.0)),
)  # fmt: skip

MAIN = ("iou_box_mean", "iou_mean", "centre_rmse_m", "orientation_rmse_deg", "track_lost")
"""What is said first of a run, and of many: overlap, centre, heading, loss."""

OF_SIZE = ("size_deviation", "points_beside_share")
"""The metrics that only a tracker of a class's size has."""

PROBABILITIES = {name: f"{name}_probability" for name in REPORTED}
"""Class to the metric of its probability."""

OF_CLASSES = (*PROBABILITIES.values(), "class_error", "class_replaced_share")
"""The metrics that only a track with probabilities of the classes has."""

METRICS: dict[str, Metric] = {metric.name: metric for metric in _TABLE}
"""Name to row, in the order in which tables show them."""

SMOOTHED = "smoothed_"
"""Begins the names of a smoothed track's metrics; one is its `lag`, the number of later scans."""

OF_ESTIMATES = (
    *("track_lost", "centre_rmse_m", "centre_mean_m", "orientation_rmse_deg", "speed_error_m_s"),
    *("yaw_rate_error_deg_s", "iou_mean", "iou_box_mean", "length_error_m"),
    *("width_error_m", "band_coverage", "nees_position_mean", "nees_orientation_mean"),
)
"""The metrics that a smoothed track has."""

LOSS_RATE = "track_loss_rate"
"""The share of runs that lost the track: the mean over runs of `track_lost`."""

# `LabelScores.metrics` has the values.
_OF_LABELS = (
    Metric("labels_expected", "labels of the class that move", "moving labels", *_COUNT),
    Metric("labels_tracked", "labels of the class that move and are tracked", "tracked labels",
           "", "more", (0.0, None)),
    Metric("labels_found_scans_mean", "scans until these are found, mean", "scans until found",
           "", "less", (0.0, None)),
    Metric("labels_tracked_share", "frames of these labels with a track, share",
           "tracked frames of labels", *_OVERLAP),
    Metric("labels_iou_box_mean", "IoU of the box with the labels, mean", "mean IoU, labels",
           *_OVERLAP),
    Metric("labels_centre_mean_m", "centre error at the labels, mean", "centre error, labels",
           *_METRE),
    Metric("label_switches", "changes of a label's track", "switches", "", "less", (0.0, None)),
    Metric("tracks_found", "tracks of moving objects", "tracks", *_COUNT),
    Metric("tracks_false", "tracks without a label in most of their scans", "false tracks",
           "", "less", (0.0, None)),
)  # fmt: skip
OF_LABELS = {row.name: row for row in _OF_LABELS}
"""Metrics that only a recording with labels and `source.target=auto` has."""

_LOSS_RATE = Metric(LOSS_RATE, "track loss rate, share of runs", "track loss rate", *_SHARE)
_KNOWN = {**METRICS, **OF_LABELS, LOSS_RATE: _LOSS_RATE}

_SUFFIXES = {"_deg_s": "°/s", "_m_s": "m/s", "_m": "m", "_deg": "°", "_s": "s"}


BASELINES = {
    **dict.fromkeys(
        ("iou_mean", "iou_box_mean"),
        "iou_baseline of the same run: the true outline, moved to the mean of its points",
    ),
    "centre_rmse_m": "that of the mean of the used points, on the page of the run",
    "orientation_rmse_deg": "that of the motion of the used points, on the page of the run",
    **{name: "1, a consistent filter" for name, row in METRICS.items() if row.better == "one"},
}
"""Metric to what a value is compared with, in words."""


def over_runs(name: str) -> str:
    """The name of a metric's mean over runs."""
    return metric(name).over_runs or name


def main_first(names: Iterable[str]) -> list[str]:
    """The names, those of `MAIN` first."""
    return sorted(names, key=lambda name: (*MAIN, name).index(name))


def metric(name: str) -> Metric:
    """The row of a metric; for an unknown name, one with the name in words and its suffix's unit.

    Files of other versions can have metrics that this table does not have.
    """
    if name in _KNOWN:
        return _KNOWN[name]
    if name.startswith(SMOOTHED):
        row = metric(name.removeprefix(SMOOTHED))
        labels = {field: f"{getattr(row, field)}, smoothed" for field in ("label", "short_label")}
        return replace(row, name=name, **labels, over_runs="")
    suffix = next((s for s in _SUFFIXES if name.endswith(s)), "")
    words = name.removesuffix(suffix).replace("_", " ").replace("iou", "IoU")
    bounds = (0.0, 1.0) if name.endswith("_share") or name.startswith("iou_") else (None, None)
    return Metric(name, words, words, _SUFFIXES.get(suffix, ""), None, bounds)
