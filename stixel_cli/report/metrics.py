"""Numbers and metrics as text, tables of a terminal; pages that need no template engine."""

import html
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from itertools import chain
from typing import Any

from stixel_cli.evaluation.metric_table import METRICS, NO_VALUE, SMOOTHED, main_first, metric
from stixel_cli.evaluation.scores import LabelScore

MAIN = (
    *("iou_mean", "iou_box_mean", "centre_rmse_m", "orientation_rmse_deg"),
    *("nees_position_mean", "nis_mean"),
)
"""The metrics that a run prints unless all are asked for."""


def shown_value(name: str, value: float | int | None) -> str:
    """The value of a metric as text, without its unit: in per cent where tables show that."""
    if metric(name).percent and value is not None:
        return f"{100.0 * value:.1f}"
    return number(value)


def in_order(metrics: Mapping[str, float | int | None]) -> dict[str, float | int | None]:
    """The metrics, overlap, centre, heading and loss first."""
    return {name: metrics[name] for name in main_first(metrics)}


def main_metrics(metrics: Mapping[str, float | int | None]) -> dict[str, float | int | None]:
    """Those of `MAIN` that exist, in that order, the user's own, those of the smoothed track."""
    own = [name for name in metrics if name not in METRICS and not name.startswith(SMOOTHED)]
    smoothed = [SMOOTHED + name for name in ("lag", *MAIN)]
    return {name: metrics[name] for name in (*MAIN, *own, *smoothed) if name in metrics}


LABEL_COLUMNS = (
    *("label", "range (m)", "speed (m/s)", "tracked frames", "found after (scans)", "box IoU"),
    *("centre error (m)", "tracks", "switches"),
)


def label_rows(labels: Iterable[LabelScore]) -> list[tuple[str, ...]]:
    """Cells of `LABEL_COLUMNS` for each label that moves or is tracked."""
    return [
        (
            one.label,
            f"{one.range_m:.1f}",
            f"{one.speed_m_s:.1f}",
            f"{one.tracked_frames} of {one.frames}",
            *(number(value) for value in (one.found_scans, one.iou_box, one.centre_m)),
            str(one.tracks),
            str(one.switches),
        )
        for one in labels
        if one.expected or one.tracked_frames
    ]


def smoothed_label(metrics: Mapping[str, float | int | None]) -> str:
    """`smoothed, lag 5`: what the metrics of the smoothed track are called; "" without one."""
    lag = metrics.get(f"{SMOOTHED}lag")
    return "" if lag is None else f"smoothed, lag {lag}"


def score_table(
    metrics: Mapping[str, float | int | None],
) -> tuple[tuple[str, ...], list[tuple[str, ...]], tuple[int, ...]]:
    """Columns, rows and right-aligned columns of the metrics with a value: name, value, unit.

    The values of a smoothed track are beside those of the filtered one.
    """
    known = {name: value for name, value in metrics.items() if value is not None}
    shown = {name: shown_value(name, value) for name, value in known.items()}
    smoothed = smoothed_label(metrics)
    rows = []
    for name in (name for name in shown if not name.startswith(SMOOTHED)):
        beside = [shown.get(SMOOTHED + name, "")] if smoothed else []
        rows.append((metric(name).label, shown[name], *beside, metric(name).shown_unit))
    if smoothed:
        return ("score", "filtered", smoothed, "unit"), rows, (1, 2)
    return ("score", "value", "unit"), rows, (1,)


MINUS = "\u2212"
_THIN = "\u202f"


def decimals(half: float | None) -> int | None:
    """Decimals, 0 to 3, that show two significant digits of an uncertainty; None without one."""
    if half is None or not math.isfinite(half) or half <= 0.0:
        return None
    return min(3, max(0, 1 - math.floor(math.log10(half))))


def number(value: float | int | None, places: int | None = None, sign: bool = False) -> str:
    """A number with the given decimals, by default three significant digits; a dash for None."""
    if value is None or not math.isfinite(value):
        return NO_VALUE
    if places is None and isinstance(value, int):
        places = 0
    elif places is None:
        places = min(4, max(0, 2 - math.floor(math.log10(abs(value))))) if value else 2
    shown = f"{value:+.{places}f}" if sign else f"{value:.{places}f}"
    if not any(digit in shown for digit in "123456789"):
        shown = shown.lstrip("+-")
    return shown.replace("-", MINUS)


def quantity(
    value: float | int | None, unit: str = "", places: int | None = None, sign: bool = False
) -> str:
    """A number with its unit."""
    shown = number(value, places, sign)
    if not unit or shown == NO_VALUE:
        return shown
    return shown + unit if unit == "°" else f"{shown}{_THIN}{unit}"


def with_interval(
    value: float | None, low: float | None, high: float | None, unit: str = "", sign: bool = False
) -> str:
    """A number with its interval in brackets, with the digits that the interval supports."""
    if value is None or low is None or high is None:
        return quantity(value, unit, sign=sign)
    places = decimals(0.5 * (high - low))
    ends = f"[{number(low, places)}, {number(high, places)}]"
    return f"{quantity(value, unit, places, sign)} {ends}"


def filled_page(package: str, name: str, title: str, data: Any, **files: Sequence[str]) -> str:
    """The file `templates/NAME` of a package, with a text in place of each mark such as ⟦title⟧.

    `data` becomes JSON; `files` are other marks with the files in the same folder that they mean.
    """

    def text(name: str) -> str:
        return (resources.files(package) / "templates" / name).read_text("utf-8")

    parts = {mark: "\n".join(map(text, names)) for mark, names in files.items()}
    parts |= {"title": html.escape(title), "data": json_in_html(data)}
    # Split the template once, so that inserted text is never searched for marks.
    first, *pieces = text(name).split("⟦")
    marks = (piece.partition("⟧") for piece in pieces)
    return "".join([first, *chain.from_iterable((parts[mark], rest) for mark, _, rest in marks)])


def json_in_html(value: Any) -> str:
    """JSON for a script element: in ASCII, without `<`, `>` and `&`; NaN is refused."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text
