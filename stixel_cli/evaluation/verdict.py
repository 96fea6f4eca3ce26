"""What the metrics of a run mean, in words."""

from collections.abc import Mapping

from stixel_cli.evaluation.metric_table import METRICS, OF_SIZE, PROBABILITIES

Values = Mapping[str, float | int | None]

SHOWN_UPPER_BOUND = 0.995
"""A greater upper bound of the IoU is not mentioned: it would be printed as 1."""

LEAST_ODDS = 100.0
"""An unknown class is named if it is this many times as probable as any other."""


def verdict(metrics: Values) -> list[str]:
    """Sentences on a run, the most important first; at least one.

    The limits are the column `expected` of the table of metrics. A metric that is missing or has no
    value is not mentioned.
    """
    if metrics.get("scans") and metrics.get("scans") == metrics.get("empty_scans"):
        return ["The road user was never measured: every scan is empty."]
    sentences: list[str] = []
    lost_at = metrics.get("time_to_loss_s")
    if lost_at is not None:
        sentences.append(f"Track lost at {lost_at:.1f} s.")
    for name, what, short in (
        ("nees_position_mean", "", "position NEES/2"),
        ("nees_orientation_mean", " in the orientation", "NEES"),
    ):
        value = metrics.get(name)
        if _beyond(metrics, name):
            sure = "Over" if value > 1.0 else "Under"
            sentences.append(f"{sure}-confident{what}: {short} {_digits(value)}.")
    if _beyond(metrics, "nis_mean"):
        nis = metrics["nis_mean"]
        size = "larger" if nis > 1.0 else "smaller"
        text = f"Residuals are {size} than assumed (NIS {_digits(nis)})"
        if nis < 1.0 and _beyond(metrics, "nees_position_mean", above=True):
            text += " while the error is larger: the points share an error"
        sentences.append(f"{text}.")
    if _beyond(metrics, "band_coverage"):
        share = metrics["band_coverage"]
        sentences.append(f"The 95 % band covers only {100.0 * share:.0f} % of the true outline.")
    if _beyond(metrics, "diverged"):
        sentences.insert(0, _diverged(metrics.get("time_to_divergence_s")))
    if _beyond(metrics, "class_error"):
        sentences.append("The reported class is not that of the road user.")
    if misfits_class(metrics):
        sentences.append(
            "The points do not fit the prior's class; the road user may be of another class."
        )
    if metrics.get("tracks_found") is not None:
        return [_of_labels(metrics), *sentences]
    if metrics.get("track_lost") is None:
        why = "the metrics are of an older version" if "iou_mean" in metrics else "no truth"
        return [*(sentences or [f"No verdict: {why}."]), *_class(metrics)]
    if lost_at is None:
        place = int(_beyond(metrics, "diverged"))
        calm = "" if sentences else "; the stated uncertainty is consistent with the errors"
        sentences.insert(place, f"Tracked to the end{_accuracy(metrics)}{calm}.")
    upper_bound = metrics.get("iou_star_convex_upper_bound")
    if upper_bound is not None and upper_bound < SHOWN_UPPER_BOUND:
        sentences.append(
            f"The IoU of a star-convex contour has an upper bound of {upper_bound:.2f} here."
        )
    return [*sentences, *_class(metrics)]


def misfits_class(metrics: Values) -> bool:
    """Whether the tracker shows that the points do not fit the prior's class."""
    return any(_beyond(metrics, name) for name in (*OF_SIZE, "class_replaced_share"))


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


def _diverged(time: float | int | None) -> str:
    since = "" if time is None else f" from {time:.1f} s on"
    return (
        f"WARNING: the tracker diverged{since}: its residuals are far larger than it assumes, "
        "or it used no point for a second. Do not use these estimates."
    )


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


def _accuracy(metrics: Values) -> str:
    """`: IoU 0.81, mean centre error 0.19 m`; the box's IoU where only the true box is known."""
    parts = []
    for name, text in (("iou_mean", "IoU {:.2f}"), ("iou_box_mean", "IoU of the box {:.2f}")):
        if metrics.get(name) is not None:
            parts = [text.format(metrics[name])]
            break
    centre = metrics.get("centre_mean_m")
    parts += [] if centre is None else [f"mean centre error {centre:.2f} m"]
    return f": {', '.join(parts)}" if parts else ""


def badges(metrics: Values) -> dict[str, str]:
    """Short verdicts by field of `Scores`, of what the table of metrics does not expect."""
    found = {}
    lost_at = metrics.get("time_to_loss_s")
    if lost_at is not None:
        found["centre_error"] = f"lost at {lost_at:.1f} s"
    for name, field, more, less in (
        ("nees_position_mean", "nees_position", "over-confident", "under-confident"),
        ("nis_mean", "nis", "residuals larger", "residuals smaller"),
    ):
        if _beyond(metrics, name):
            value = metrics[name]
            found[field] = f"{more if value > 1.0 else less} × {_digits(value)}"
    return found


def _beyond(metrics: Values, name: str, above: bool = False) -> bool:
    """Whether a metric is beyond the limits of its row, or above the greater one."""
    value, (low, high) = metrics.get(name), METRICS[name].expected
    if value is None:
        return False
    return (high is not None and value > high) or (not above and low is not None and value < low)


def _digits(value: float) -> str:
    """Two significant digits, without an exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}" if value >= 0.01 else f"{value:.3f}"
