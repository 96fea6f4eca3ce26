"""What the metrics of a run mean, in words.

The word of a run has fixed limits; docs/theory.md has them, and the words of runs that were
disturbed by a known amount.
"""

from collections.abc import Mapping

from stixel_cli.evaluation.metric_table import METRICS, OF_SIZE, PROBABILITIES

Values = Mapping[str, float | int | None]

WORDS = ("lost", "poor", "fair", "good")
"""The words of the verdict, the worst first."""

LIMITS = {"fair": 0.25, "good": 0.7}
"""Least share of the way from the baseline's IoU to the upper bound that a word stands for."""

LEAST_WAY = 0.1
"""The baseline is taken as this far, at least, below the upper bound."""

FAR_SIDE = 0.1
"""An error of the hidden side, m, above which it has a sentence of its own."""

LEAST_ODDS = 100.0
"""An unknown class is named if it is this many times as probable as any other."""


def word(metrics: Values) -> str | None:
    """One of `WORDS`; None if there is no truth, or if the metrics are of an older version.

    `lost` is a track that is lost at any time; one that has diverged is at most `poor`. The others
    compare the mean IoU of the outline, or of the box where only that is known, with those of the
    baseline and of the upper bound.
    """
    if metrics.get("track_lost"):
        return "lost"
    (_, iou), bound = _overlap(metrics), _upper_bound(metrics)
    baseline = metrics.get("iou_baseline")
    if metrics.get("track_lost") is None or iou is None or baseline is None:
        return None
    if _has_diverged(metrics):
        return "poor"
    way = (iou - baseline) / max(bound - baseline, LEAST_WAY)
    return next((one for one in reversed(LIMITS) if way >= LIMITS[one]), "poor")


def verdict(metrics: Values) -> list[str]:
    """Sentences on a run, at least one.

    The first begins with the run's `word` and says why it has it; the second, if any, says what to
    try; `uncertainty: …` compares the stated uncertainty with the errors, by the limits in the
    column `expected` of the table of metrics. A metric without a value is not mentioned, and a
    cause is named only if a metric shows it. Before all comes that the road user leaves the view,
    or a warning of a divergence before that.
    """
    if metrics.get("scans") and metrics.get("scans") == metrics.get("empty_scans"):
        return [f"{'lost' if metrics.get('track_lost') else 'No verdict'}: every scan is empty."]
    first = []
    if metrics.get("time_out_of_view_s") is not None:
        first = [
            f"The road user leaves the field of view at {metrics['time_out_of_view_s']:.1f} s: "
            "from then on the estimates are predictions."
        ]
    if _has_diverged(metrics):
        time = metrics.get("time_to_divergence_s")
        first = [
            f"WARNING: the tracker diverged{'' if time is None else f' from {time:.1f} s on'}: its "
            "residuals are far larger than it assumes, or it used no point for a second. Do not "
            "use these estimates."
        ]
    if metrics.get("tracks_found") is not None:
        return [*first, _of_labels(metrics), *_uncertainty(metrics)]
    rest = [*_to_try(metrics), *_uncertainty(metrics), *_class(metrics)]
    if metrics.get("track_lost") is None:
        why = "the metrics are of an older version" if "iou_mean" in metrics else "no truth"
        return [*(first or [f"No verdict: {why}."]), *rest]
    begin = word(metrics)
    why = _accuracy(metrics)
    if metrics.get("time_to_loss_s") is not None:
        at = metrics["time_to_loss_s"]
        why = f"off the target from {'the first scan' if at == 0.0 else f'{at:.1f} s'} on; {why}"
    said = f"{begin}: {why}." if begin else f"{why[:1].upper()}{why[1:]}."
    return [*first, said.replace("; .", "."), *rest]


def misfits_class(metrics: Values) -> bool:
    """Whether the tracker shows that the points do not fit the prior's class."""
    return any(_beyond(metrics, name) for name in (*OF_SIZE, "class_replaced_share"))


def _overlap(metrics: Values) -> tuple[str, float | None]:
    """Name and value of the mean IoU: of the outline, or of the box where only that is known."""
    if metrics.get("iou_mean") is not None:
        return "IoU", metrics["iou_mean"]
    return "IoU of the box", metrics.get("iou_box_mean")


def _upper_bound(metrics: Values) -> float:
    """The greatest IoU of a star-convex outline; 1 for a box, and where it is unknown."""
    bound = metrics.get("iou_star_convex_upper_bound")
    return 1.0 if bound is None or metrics.get("iou_mean") is None else bound


def _accuracy(metrics: Values) -> str:
    """`IoU 0.81 (baseline 0.35, upper bound 1.00), mean centre error 0.19 m, near side 6 cm off,
    far side 25 cm, heading 12° off`, as far as it is known; a heading only if its error matters."""
    (name, iou), baseline = _overlap(metrics), metrics.get("iou_baseline")
    near, far = metrics.get("seen_contour_error_m"), metrics.get("hidden_contour_error_m")
    centre, heading = metrics.get("centre_mean_m"), metrics.get("orientation_rmse_deg")
    parts = [] if iou is None else [f"{name} {iou:.2f}"]
    if parts and baseline is not None:
        parts[0] += f" (baseline {baseline:.2f}, upper bound {_upper_bound(metrics):.2f})"
    if centre is not None:
        parts.append(f"mean centre error {centre:.2f} m")
    if near is not None and far is not None:
        parts.append(f"near side {100.0 * near:.0f} cm off, far side {100.0 * far:.0f} cm")
    if heading is not None and heading >= 10.0:
        parts.append(f"heading {heading:.0f}° off")
    return ", ".join(parts)


def _to_try(metrics: Values) -> list[str]:
    """At most one sentence, of what the metrics of this run speak for."""
    near, far = metrics.get("seen_contour_error_m"), metrics.get("hidden_contour_error_m")
    if metrics.get("class_error"):
        return ["The reported class is not that of the road user."]
    if (metrics.get("other_probability") or 0.0) > 0.5:
        return ["The target is of no known class: stixel new class learns one from meshes."]
    if misfits_class(metrics):
        return ["The points do not fit the prior's class: try prior=unknown."]
    if metrics.get("time_to_loss_s") == 0.0:
        return ["The start is off the target: try a smaller error (stixel describe start)."]
    own_class = metrics.get("size_deviation") is not None
    if near is not None and far is not None and far > max(FAR_SIDE, 2.0 * near) and not own_class:
        return ["Try tracker=contour: it knows the far side from the class."]
    return []


def _uncertainty(metrics: Values) -> list[str]:
    """One line on NEES, NIS and the band, with a NIS that is beyond the limits.

    One run does not tell whether a filter is consistent, as its errors persist: what is compared
    with the truth is a number. Seeds tell (`stixel study consistency`).
    """
    parts = []
    for name, label in (
        ("nees_position_mean", "NEES/2 of the position"),
        ("nees_orientation_mean", "NEES of the orientation"),
        ("nis_mean", "NIS"),
    ):
        value = metrics.get(name)
        if value is not None:
            found = f" ({_residuals(value)} than assumed)" if _beyond(metrics, name) else ""
            parts.append(f"{label} {_digits(value)}{found}")
    coverage = metrics.get("band_coverage")
    if coverage is not None:
        parts.append(f"95 % band covers {100.0 * coverage:.0f} %")
    return [f"uncertainty: {', '.join(parts)}."] if parts else []


def _residuals(nis: float | int) -> str:
    return "residuals larger" if nis > 1.0 else "residuals smaller"


def _class(metrics: Values) -> list[str]:
    """`Class: cyclist, 99 %.`, if the tracker compared classes; `unknown` below odds of 100."""
    values = {name: metrics.get(metric) for name, metric in PROBABILITIES.items()}
    known = {name: value for name, value in values.items() if value is not None}
    if not known:
        return []
    ordered = sorted(known, key=lambda one: known[one], reverse=True)
    best, *others = ordered
    uncertain = any(known[best] < LEAST_ODDS * known[one] for one in others)
    if uncertain and metrics.get("class_replaced_share") is None:
        shown = ", ".join(f"{one} {100.0 * known[one]:.0f} %" for one in ordered)
        return [f"Class: unknown ({shown})."]
    return [f"Class: {best}, {100.0 * known[best]:.0f} %."]


def _has_diverged(metrics: Values) -> bool:
    """Whether the tracker diverged in view: outside of it, nothing is measured."""
    since, left = metrics.get("time_to_divergence_s"), metrics.get("time_out_of_view_s")
    return bool(metrics.get("diverged")) and (left is None or since is None or since < left)


def _of_labels(metrics: Values) -> str:
    """How many of the labels that move are tracked, and how many tracks have no label."""
    expected, found = metrics.get("labels_expected"), metrics["tracks_found"]
    if expected is None:
        return f"{found} moving objects are tracked; there are no labels to compare them with."
    of_labels = f"{metrics['labels_tracked']} of {expected} labels that move are tracked"
    iou, centre = metrics.get("labels_iou_box_mean"), metrics.get("labels_centre_mean_m")
    if iou is not None and centre is not None:
        of_labels += f": IoU of the box {iou:.2f}, mean centre error {centre:.2f} m"
    return f"{of_labels}; {metrics['tracks_false']} of {found} tracks match no label."


def badges(metrics: Values) -> dict[str, str]:
    """Short verdicts by field of `Scores`, of what the table of metrics does not expect."""
    found = {}
    lost_at = metrics.get("time_to_loss_s")
    if lost_at is not None:
        found["centre_error"] = f"lost at {lost_at:.1f} s"
    if _beyond(metrics, "nis_mean"):
        value = metrics["nis_mean"]
        found["nis"] = f"{_residuals(value)} × {_digits(value)}"
    return found


def _beyond(metrics: Values, name: str) -> bool:
    """Whether a metric is beyond the limits of its row."""
    value, (low, high) = metrics.get(name), METRICS[name].expected
    if value is None:
        return False
    return (high is not None and value > high) or (low is not None and value < low)


def _digits(value: float) -> str:
    """Two significant digits, without an exponent."""
    # The form `#` keeps a 0 at the end, and a point behind 10.
    if 0.01 <= value < 10.0:
        return f"{value:#.2g}".rstrip(".")
    return f"{value:.0f}" if value >= 10.0 else f"{value:.3f}"
