"""A figure for each axis of a sweep: the metrics over its values."""

import itertools
import math
import textwrap
from collections.abc import Collection, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes

from stixel_cli.evaluation.metric_table import metric, over_runs
from stixel_cli.pictures import style
from stixel_cli.report.charts import Panel, chart, line, line_look
from stixel_cli.report.error_curves import FLATTENED, MOST_LINES, NARROW
from stixel_cli.report.intervals import LEAST_FREEDOM
from stixel_cli.report.statistics import Repetition, Statistic, summarise
from stixel_cli.sweeps.over import Setting
from stixel_cli.sweeps.results import heading

SHOWN = (
    "centre_rmse_m",
    "orientation_rmse_deg",
    "iou_mean",
    "iou_box_mean",
    "low_overlap_share",
    "track_lost",
)
DRAWN = (*SHOWN[:4], "nees_position_mean", "nis_mean", *SHOWN[4:])
"""Metrics of a figure."""

_TEXT_LINE = 0.16
"""in: height of a line of text."""
_LONGEST_LABEL = 28
_LONGEST_NAME = 100
_LETTERS = 56
"""To a line of a narrow figure."""
_LINES = ({}, {"linestyle": ""})
"""Looks of values that are numbers, and of others, which no line connects."""


def axis_figures(
    runs: Sequence[Repetition],
    axes: Sequence[Sequence[str]],
    left_out: int = 0,
    kind: Literal["png", "svg"] = "png",
    units: str = "seeds",
) -> dict[str, bytes]:
    """Images by name, one for each axis that is not averaged over; as SVG, one for each metric.

    Above `MOST_LINES` combinations of the other axes the lines are thin, and their mean is added,
    unless settings are incomplete: it would not be over the same settings.

    Args:
        runs: of complete settings.
        axes: the keys of each axis.
        left_out: number of incomplete settings.
        kind: of the images.
        units: what the means of a setting are over, in words.
    """
    figures: dict[str, bytes] = {}
    for keys in axes:
        keys = [key for key in keys if any(key in dict(setting) for setting, _, _ in runs)]
        if keys:
            figures |= _figures(keys, runs, left_out, units, kind)
    return figures


def _joined(keys: Sequence[str], sign: str = " + ") -> str:
    """The keys of an axis; of many zipped keys the first, and the number of others."""
    text = sign.join(keys)
    return text if len(text) <= _LONGEST_NAME else f"{keys[0]} + {len(keys) - 1} more"


def _figures(
    keys: Sequence[str], runs: Sequence[Repetition], left_out: int, units: str, kind: str
) -> dict[str, bytes]:
    """The figures over `keys` with a line for each combination of the other axes."""
    known = {name for _, _, metrics in runs for name in metrics}
    names = [over_runs(n) for n in ([n for n in DRAWN if n in known] or sorted(known)[:4])]
    found, looks = _lines(keys, runs, left_out)
    values = list(dict.fromkeys(value for value, _ in found))
    numbers = _numbers(values)
    if numbers is not None:
        values = [value for _, value in sorted(zip(numbers, values, strict=True))]
        numbers = sorted(numbers)
    places = list(range(len(values))) if numbers is None else numbers
    log = numbers is not None and is_geometric(numbers)
    if log:
        places = [math.log(place) for place in places]
    steps = dodges(places, len(looks)) if len(looks) <= MOST_LINES else [0.0] * len(looks)
    ticks = [textwrap.fill(" ".join(value), _LONGEST_LABEL) for value in values]

    def panel(name: str, legend: bool = True) -> Panel:
        def draw(axes: Axes) -> None:
            for (other, look), step in zip(looks.items(), steps, strict=True):
                rows = [found.get((v, other), {}).get(name, Statistic()) for v in values]
                at = [math.exp(p + step) if log else p + step for p in places]
                shown = {} if legend else {"label": ""}
                line(axes, at, rows, bars=True, **look | _LINES[numbers is None] | shown)
            scale_values(axes, name)
            axes.grid(False, axis="x")
            if log:
                axes.set_xscale("log")
                axes.minorticks_off()
            if log or numbers is None:
                axes.set_xticks(numbers or places, ticks)
            if numbers is None and len(ticks) > 5:
                axes.tick_params("x", labelrotation=30)

        return Panel(draw, heading(name), _joined(keys))

    counts = {row[name].n for row in found.values() for name in names if name in row} - {0}
    title = caption(units, len(looks), left_out, counts)
    row = 2.7 + _TEXT_LINE * max(label.count("\n") for label in ticks)
    if kind == "png":
        stem = _joined(keys, "+").replace("/", ".")
        return {f"{stem}.png": chart("", [*map(panel, names)], 2, row, 9.0, title, style.png).svg}
    title = textwrap.fill(title, _LETTERS)
    # The lines of all figures are those of the first one's legend.
    return {
        f"{heading(name)} over {_joined(keys)}": chart(
            "", [panel(name, legend=name == names[0])], 1, row, title=title, **NARROW
        ).svg
        for name in names
    }


def _lines(
    keys: Sequence[str], runs: Sequence[Repetition], left_out: int
) -> tuple[dict[tuple, dict[str, Statistic]], dict[str, dict[str, Any]]]:
    """Statistics by value of `keys` and line, and the look of each line by its name."""
    each = [(tuple(map(dict(s).get, keys)), _label(s, keys), *rest) for s, *rest in runs]
    found = summarise(((value, other), *rest) for value, other, *rest in each)
    others = list(dict.fromkeys(other for _, other in found))
    if len(others) <= MOST_LINES:
        looks = [line_look(i) | {"markersize": 3.5, "linewidth": 1.2} for i in range(len(others))]
        return found, {
            other: look | {"label": other} for other, look in zip(others, looks, strict=True)
        }
    looks = {key: {"color": style.UNUSED, "linewidth": 0.5, "marker": ""} for key in others}
    if not left_out:
        found |= summarise(((value, ""), *rest) for value, _, *rest in each)
        looks |= {"": line_look(0) | {"label": "mean of all lines"}}
    return found, looks


def is_geometric(places: Sequence[float]) -> bool:
    """Whether ascending places have equal ratios rather than equal steps: then a log axis fits."""
    if len(places) < 3 or places[0] <= 0.0:
        return False
    ratios = [b / a for a, b in itertools.pairwise(places)]
    return max(ratios) <= 1.3 * min(ratios) and min(ratios) > 1.4


def is_flattened(name: str, values: np.ndarray) -> bool:
    """Whether an error's greatest value would flatten the others on a linear axis."""
    values = values[np.isfinite(values)]
    if metric(name).bounds != (0.0, None) or len(values) == 0 or values.min() <= 0.0:
        return False
    return bool(values.max() > FLATTENED * np.median(values))


def scale_values(axes: Axes, name: str) -> None:
    """Scale the axis of a metric's values: logarithmic round 1, or with room above only zeros.

    Logarithmic also where one bad row would flatten all others.
    """
    heights = np.concatenate([np.asarray(line.get_ydata(), float) for line in axes.lines] or [[]])
    if metric(name).better == "one":
        axes.set_yscale("log")
        axes.axhline(1.0, color=style.UNUSED, linewidth=0.8, linestyle="--")
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.5), max(high, 2.0))
        style.log_axis(axes)
    elif is_flattened(name, heights):
        style.log_axis(axes)
    elif axes.dataLim.y0 == axes.dataLim.y1 == 0.0:
        # Matplotlib's own limits would be ±0.055.
        axes.set_ylim(0.0, 1.0)


def caption(units: str, lines: int, left_out: int, counts: Collection[int]) -> str:
    """What a figure shows; `counts` are the n of its means over `units`."""
    least, most = min(counts, default=1), max(counts, default=1)
    n = f"{most}" if least == most else f"{least} to {most}"
    what = f"mean over n = {n} {units}" if most > 1 else f"one run of each setting ({units}: 1)"
    notes = ["bars: 95 % intervals"] if most > LEAST_FREEDOM else []
    notes += ["ticks: the runs"] if any(1 < n <= LEAST_FREEDOM for n in counts) else []
    many = lines > MOST_LINES
    notes += ["thin lines: combinations of the other axes"] if many else []
    notes += ["lines shifted sideways"] if lines > 1 and not many else []
    settings = "setting" if left_out == 1 else "settings"
    notes += [f"without {left_out} incomplete {settings}"] if left_out else []
    return "; ".join([what, *notes])


def dodges(places: Sequence[float], lines: int) -> list[float]:
    """Shift of each line to the right, so that error bars do not overlap.

    All lines together take a quarter of the least distance between two places.
    """
    width = 0.25 * min((b - a for a, b in itertools.pairwise(sorted(places))), default=1.0)
    return [width * ((line + 0.5) / lines - 0.5) for line in range(lines)]


def _label(setting: Setting, keys: Sequence[str]) -> str:
    """`key=value …` of a setting without `keys`."""
    return " ".join(f"{k}={v}" for k, v in setting if k not in keys)


def _numbers(values: Sequence[tuple[str, ...]]) -> list[float] | None:
    """The values as finite numbers; None if any is not, or there are several keys."""
    try:
        numbers = [float(value) for (value,) in values]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None
