"""The scores of a run: errors over its scans, what sums them up, and those of tracks at labels."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

LOW_OVERLAP = 0.2
"""A scan has low overlap if the IoU of its outline is below this; a box that has is off."""

LOSS_DURATION = 1.0
"""A track is lost once it has been off the target for this long, s."""

DIVERGED_NIS = 9.0
"""A tracker has diverged where the mean NIS / degrees of freedom of a second is above this."""

SURE = 3.0
"""A tracker is sure that the target is not farther away than this, in standard deviations."""

THRESHOLDS = 21
"""Thresholds of the curves of success and of precision, as in lidar single-object tracking."""

FARTHEST_CENTRE = 2.0
"""The greatest threshold of the curve of precision, m."""


class ScanErrors(SimpleNamespace):
    """Errors and counts of one track over its K scans.

    The errors are (n,), at the n scans that count: those with a known truth, of a recording only
    those with a good one. `nis` and what follows it are (K,).

    Attributes:
        times: s since the first scan of the run.
        centre: m.
        orientation: degrees in (-180, 180], estimated minus true.
        iou, iou_box: intersection over union of the outlines, and of the boxes along the estimated
            and the true heading, 0 … 1. Where only the true box is known, the first is NaN.
        star_convex_upper_bound: the greatest IoU of the outline of a star-convex contour.
        length, width: of the box, m, estimated minus true.
        speed: m/s, estimated minus true.
        yaw_rate: degrees/s, estimated minus true.
        gaussian_wasserstein: distance of the areas' means and covariances, m.
        hausdorff, contour_distance: greatest and mean distance of the outlines, both ways, m.
        seen_contour: mean distance of the true outline's points that the ego car sees from the
            estimated outline, m; NaN if it sees no point. hidden_contour: of those that it does
            not see.
        band_coverage, hidden_band_coverage: share of the true outline's points, and of those that
            the ego car does not see, in the estimated 95 % band.
        iou_baseline: see `baseline_overlaps`; NaN at a scan without points of the target.
        lost: whether the estimate is off the target; see `evaluate.off_target`.
        out_of_view: whether the true centre is outside the sensor's field of view.
        nees_position, nees_orientation: NEES divided by its dimension; NaN without a valid
            covariance.
        nis: NIS divided by its degrees of freedom; NaN for an empty scan.
        points, points_used: points of the scan, and those that the tracker used.
        scan_times: s since the first scan of the run.
        points_beside: points near a used one that the tracker did not use, and
        size_deviations: see `Track`; both (K,), NaN if the tracker does not estimate a class's
            size.
        class_probabilities: class to (K,), see `Track`; NaN if that has none.
        class_wrong: whether the most probable class is not the road user's, 0 or 1; NaN if unknown.
        class_replaced: whether the reported class is not that of the prior, 0 or 1; NaN if that is
            unknown.
        uses_scans: see `Track`.
    """


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


def finite_median(values: np.ndarray) -> float | None:
    """Median of the finite values, or None if no value is finite."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else None


def share_of(part: np.ndarray, rest: np.ndarray) -> float | None:
    """Sum of `part` (K,) as a share of both sums; None if both are 0 or one is NaN."""
    total = part.sum() + rest.sum()
    return float(part.sum() / total) if total > 0.0 else None


def low_overlap_share(iou: np.ndarray) -> float | None:
    """Share of scans with an IoU below `LOW_OVERLAP`; None if an IoU is NaN."""
    return mean(np.where(np.isnan(iou), np.nan, iou < LOW_OVERLAP))


def sure_and_wrong_share(errors: ScanErrors) -> float | None:
    """Share of scans where the box has low overlap and the stated covariance excludes the centre.

    The centre's Mahalanobis distance is above `SURE`; None if there is no scan.
    """
    sure = np.sqrt(2.0 * errors.nees_position) > SURE
    return mean((sure & (errors.iou_box < LOW_OVERLAP)).astype(float))


def time_to_loss(times: np.ndarray, lost: np.ndarray) -> float | None:
    """The time, s, of the first of the scans that lose the track; None if never.

    `lost` (n,) is whether the estimate is off the target at `times` (n,). The track is lost if that
    lasts for `LOSS_DURATION`, from the first to the last of neighbouring scans.
    """
    start = None
    for time, off in zip(times, lost, strict=True):
        if not off:
            start = None
            continue
        start = time if start is None else start
        if time - start >= LOSS_DURATION - 1e-9:
            return float(start)
    return None


def time_to_divergence(errors: ScanErrors) -> float | None:
    """The time, s, at which the tracker's own output shows that it has diverged; None if never.

    It reads no truth. The track has diverged from the first of neighbouring scans with points that
    are not used over `LOSS_DURATION`, unless the tracker is one that uses no scan; or from the
    first second whose mean NIS over the degrees of freedom is above `DIVERGED_NIS`, far above χ².
    """
    times, measured = errors.scan_times, errors.points > 0
    found = []
    if errors.uses_scans:
        found.append(time_to_loss(times[measured], errors.points_used[measured] == 0))
    known = np.isfinite(errors.nis)
    nis, at = errors.nis[known], times[known]
    sums = np.concatenate([[0.0], np.cumsum(nis)])
    last = np.searchsorted(at, at + LOSS_DURATION - 1e-9)
    whole = np.flatnonzero(last < len(at))
    means = (sums[last[whole] + 1] - sums[whole]) / (last[whole] + 1 - whole)
    found += [*at[whole[means > DIVERGED_NIS]][:1]]
    return min((float(time) for time in found if time is not None), default=None)


def success(iou: np.ndarray) -> float | None:
    """Area under the share of scans with an IoU of at least t, over t from 0 to 1; 0 … 1.

    Success of one-pass evaluation (Wu, Lim, Yang 2013, *Online object tracking: a benchmark*), with
    the thresholds and the trapezoidal rule of lidar single-object tracking (Giancola, Zarzar,
    Ghanem 2019, *Leveraging shape completion for 3D Siamese tracking*).
    """
    thresholds = np.linspace(0.0, 1.0, THRESHOLDS)
    return _area(np.asarray(iou)[:, None] >= thresholds, np.isfinite(iou))


def precision(centre: np.ndarray) -> float | None:
    """Area under the share of scans with a centre error of at most t m, over t from 0 to 2; 0 … 1.

    The area is divided by the greatest threshold; source as of `success`.
    """
    thresholds = np.linspace(0.0, FARTHEST_CENTRE, THRESHOLDS)
    return _area(np.asarray(centre)[:, None] <= thresholds, np.isfinite(centre))


def _area(passed: np.ndarray, finite: np.ndarray) -> float | None:
    """Area under the mean of `passed` (K, T) over thresholds, divided by their range."""
    if not len(finite) or not finite.all():
        return None
    shares = passed.mean(axis=0)
    return float(np.mean(0.5 * (shares[1:] + shares[:-1])))


@dataclass(frozen=True)
class LabelScore:
    """One label of the class, over the frames in which it is neither truncated nor occluded.

    Attributes:
        label: track id in the files.
        range_m: median distance from the camera, m; NaN without such a frame.
        speed_m_s: of the label, m/s.
        expected: 1 if a track is expected: it moves, and is in as many frames as a track needs.
        frames: number of these frames.
        tracked_frames: those of them with a track.
        found_scans: number of scans from the first that has a point of the label to the one that
            confirmed its first track; NaN without one.
        tracks: number of different tracks that match the label in any frame.
        switches: changes from one of them to another.
        iou_box: mean intersection over union of the boxes, in the tracked frames; NaN without one.
        centre_m: mean centre error there, m; NaN without one.
    """

    label: str
    range_m: float
    speed_m_s: float
    expected: int
    frames: int
    tracked_frames: int
    found_scans: float
    tracks: int
    switches: int
    iou_box: float
    centre_m: float


@dataclass(frozen=True)
class Scores:
    """Errors over time and their summary.

    Attributes:
        times: (K,) s.
        centre_error: (K,) m; and orientation_error: (K,) rad in (-pi, pi], estimated minus true.
        iou, iou_box, nees_position, nis: (K,) as those of `ScanErrors`, at all scans; NaN where the
            truth is unknown. Of several tracks `nis` is their mean.
        metrics: name to value; None if the metric has no value.
        labels: of the labels of the class, with several tracks.
    """

    times: np.ndarray
    centre_error: np.ndarray
    orientation_error: np.ndarray
    iou: np.ndarray
    iou_box: np.ndarray
    nees_position: np.ndarray
    nis: np.ndarray
    metrics: dict[str, float | int | None]
    labels: tuple[LabelScore, ...] = ()


@dataclass(frozen=True)
class Series:
    """An error over time."""

    label: str
    """Full name."""
    short_label: str
    """Name where space is short."""
    unit: str
    """Of the values shown; "" without one."""
    bounds: tuple[float | None, float | None]
    """Least and greatest possible value; None where there is no bound."""
    consistent: float | None = None
    """The value of a perfect or consistent filter, to mark; None to mark no value."""
    factor: float = 1.0
    """From the unit of the field of `Scores` to `unit`."""
    ratio: bool = False
    """Whether the axis is logarithmic."""


SERIES = {
    "centre_error": Series("Centre error", "Centre error", "m", (0.0, None)),
    "orientation_error": Series(
        "Orientation error", "Orientation error", "°", (None, None), 0.0, float(np.degrees(1.0))
    ),
    "iou": Series("IoU of the outline", "IoU, outline", "", (0.0, 1.0)),
    "iou_box": Series("IoU of the box", "IoU, box", "", (0.0, 1.0)),
    "nees_position": Series(
        "Position NEES / 2", "Position NEES / 2", "", (0.0, None), 1.0, ratio=True
    ),
    "nis": Series("NIS / degrees of freedom", "NIS / d.o.f.", "", (0.0, None), 1.0, ratio=True),
}
"""Field of `Scores` to row, in the order in which figures show them."""
