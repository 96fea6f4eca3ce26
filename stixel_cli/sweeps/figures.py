"""A figure for each axis of a sweep: the metrics over its values."""

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stixel_cli.evaluation.metric_table import metric, over_runs
from stixel_cli.pictures import style
from stixel_cli.report.charts import legend_handles
from stixel_cli.report.statistics import Statistic, statistic, summarise
from stixel_cli.sweeps.design import SEED
from stixel_cli.sweeps.results import heading

Run = tuple[Mapping[str, str], Mapping[str, float | int | None]]
"""The setting of a run, without the seed, and its metrics."""

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
MOST_LINES = 8
"""Combinations of the other axes with a line each; beyond this number their runs are pooled."""

_LONGEST_LABEL = 28
_LONGEST_NAME = 100
_LEGEND_WIDTH = 150
"""Characters that fit in a row of the legend."""


def axis_figures(
    runs: Sequence[Run],
    axes: Sequence[Sequence[str]],
    left_out: int = 0,
    kind: Literal["png", "svg"] = "png",
) -> dict[str, bytes]:
    """Images of a kind by file name, one for each axis except the seed's.

    An axis whose runs are pooled over the other axes has no figure if settings are incomplete: its
    means would not be over the same settings.

    `axes` has the keys of each axis; `left_out` is the number of incomplete settings, which are not
    in `runs`.
    """
    figures = {}
    for keys in axes:
        keys = [key for key in keys if key != SEED]
        others = list(dict.fromkeys(_label(setting, keys) for setting, _ in runs))
        if keys and (len(others) <= MOST_LINES or not left_out):
            lines = others if len(others) <= MOST_LINES else []
            write = style.png if kind == "png" else style.svg
            with style.drawing():
                figure = write(_figure(keys, runs, lines, left_out))
            figures[f"{_joined(keys, '+').replace('/', '.')}.{kind}"] = figure
    return figures


def _joined(keys: Sequence[str], sign: str = " + ") -> str:
    """The keys of an axis; of many zipped keys the first, and the number of others."""
    text = sign.join(keys)
    return text if len(text) <= _LONGEST_NAME else f"{keys[0]} + {len(keys) - 1} more"


def _figure(
    keys: Sequence[str], runs: Sequence[Run], others: Sequence[str], left_out: int
) -> Figure:
    """A figure over `keys` with a line for each label in `others`; one line if that is empty."""
    known = {name for _, metrics in runs for name in metrics}
    names = [name for name in DRAWN if name in known] or sorted(known)[:4]
    found = summarise(
        ((tuple(map(setting.get, keys)), _label(setting, keys) if others else ""), metrics)
        for setting, metrics in runs
    )
    values = list(dict.fromkeys(value for value, _ in found))
    numbers = _numbers(values)
    if numbers is not None:
        values = [value for _, value in sorted(zip(numbers, values, strict=True))]
        numbers = sorted(numbers)
    places = list(range(len(values))) if numbers is None else numbers
    log = numbers is not None and is_geometric(numbers)
    if log:
        places = [math.log(place) for place in places]
    steps = dodges(places, max(1, len(others)))
    clipped, counts = False, set()
    figure = style.new_figure(9.0, 2.9 * math.ceil(len(names) / 2), layout="constrained")
    for number, name in enumerate(map(over_runs, names)):
        axes = figure.add_subplot(math.ceil(len(names) / 2), 2, number + 1)
        for line, other in enumerate(others or [""]):
            rows = [found.get((v, other), {}).get(name, statistic(name, [])) for v in values]
            counts |= {row.n for row in rows}
            shifted = [place + steps[line] for place in places]
            if log:
                shifted = [math.exp(place) for place in shifted]
            joined = numbers is not None
            clipped |= draw_line(axes, shifted, rows, style.RUNS[line], other, joined)
        axes.set_title(heading(name))
        axes.set_xlabel(_joined(keys))
        axes.grid(True, axis="y")
        scale_values(axes, name)
        _mark_values(axes, [_shortened(" ".join(v)) for v in values], numbers, log)
    # A line may be missing where a metric has no value.
    legend = legend_handles(figure.axes)
    if len(legend) > 1:
        columns = max(1, _LEGEND_WIDTH // (8 + max(map(len, legend))))
        figure.legend(legend.values(), legend, loc="outside lower center", ncols=columns)
    text = caption(not others, len(others), clipped, left_out, counts)
    figure.suptitle(text, fontsize=9.0, x=0.01, ha="left")
    return figure


def _mark_values(
    axes: Axes, labels: Sequence[str], numbers: Sequence[float] | None, log: bool
) -> None:
    """Ticks of the swept values: at their `numbers`, if they are numbers."""
    if log:
        axes.set_xscale("log")
        axes.minorticks_off()
        axes.set_xticks(numbers, labels)
    if numbers is None:
        axes.set_xticks(range(len(labels)), labels)
        if len(labels) > 5:
            axes.tick_params("x", labelrotation=30)


def is_geometric(places: Sequence[float]) -> bool:
    """Whether ascending places have equal ratios rather than equal steps: then a log axis fits."""
    if len(places) < 3 or places[0] <= 0.0:
        return False
    ratios = [b / a for a, b in itertools.pairwise(places)]
    return max(ratios) <= 1.3 * min(ratios) and min(ratios) > 1.4


def scale_values(axes: Axes, name: str) -> None:
    """Scale the axis of a metric's values: logarithmic round 1, or with room above only zeros."""
    if metric(name).better == "one":
        axes.set_yscale("log")
        axes.axhline(1.0, color=style.UNUSED, linewidth=0.8, linestyle="--")
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.5), max(high, 2.0))
        style.log_axis(axes)
    elif axes.dataLim.y0 == axes.dataLim.y1 == 0.0:
        # Matplotlib's own limits would be ±0.055.
        axes.set_ylim(0.0, 1.0)


def caption(
    together: bool, lines: int, clipped: bool, left_out: int, counts: Collection[int]
) -> str:
    """What a figure shows, and how it was made readable; `counts` are the n of its means."""
    least, most = min(counts, default=0), max(counts, default=0)
    n = f"{most}" if least == most else f"{least} to {most}"
    what = f"mean over n = {n} " + ("runs (seeds and all other axes)" if together else "seeds")
    what += ", with the 95 % interval (Student's t)" if most > 1 else ", no interval"
    notes = ["lines shifted sideways"] if lines > 1 else []
    notes += ["intervals clipped to possible values"] if clipped else []
    settings = "setting" if left_out == 1 else "settings"
    notes += [f"without {left_out} incomplete {settings}"] if left_out else []
    return "; ".join([what, *notes])


def dodges(places: Sequence[float], lines: int) -> list[float]:
    """Shift of each line to the right, so that error bars do not overlap.

    All lines together take a quarter of the least distance between two places.
    """
    width = 0.25 * min((b - a for a, b in itertools.pairwise(sorted(places))), default=1.0)
    return [width * ((line + 0.5) / lines - 0.5) for line in range(lines)]


def draw_line(
    axes: Axes,
    places: Sequence[float],
    rows: Sequence[Statistic],
    colour: str,
    label: str,
    joined: bool,
) -> bool:
    """Draw means and intervals at places, `joined` by a line; return whether one was clipped."""
    known = [(x, row) for x, row in zip(places, rows, strict=True) if row.mean is not None]
    if not known:
        return False
    mean = np.array([row.mean for _, row in known])
    low, high = np.transpose([drawn_interval(row) for _, row in known])
    errors = np.stack([mean - low, high - mean])
    axes.errorbar(
        [x for x, _ in known],
        mean,
        yerr=errors if errors.any() else None,
        marker="o",
        markersize=3.5,
        capsize=2.5,
        linewidth=1.2 if joined else 0.0,
        elinewidth=1.0,
        color=colour,
        label=_shortened(label, 3 * _LONGEST_LABEL),
    )
    shown = zip((row for _, row in known), low, high, strict=True)
    return any(row.low is not None and [row.low, row.high] != ends for row, *ends in shown)


def drawn_interval(row: Statistic) -> tuple[float, float]:
    """The drawn ends of the interval, clipped to the metric's bounds."""
    if row.low is None:
        return row.mean, row.mean
    least, most = metric(row.metric).bounds
    low = row.low if least is None else max(least, row.low)
    if metric(row.metric).better == "one":
        # The axis is logarithmic.
        low = max(low, 0.1 * row.mean)
    return low, row.high if most is None else min(most, row.high)


def _label(setting: Mapping[str, str], keys: Sequence[str]) -> str:
    """`key=value …` of a setting without `keys`."""
    return " ".join(f"{k}={v}" for k, v in setting.items() if k not in keys)


def _numbers(values: Sequence[tuple[str, ...]]) -> list[float] | None:
    """The values as finite numbers; None if any is not, or there are several keys."""
    try:
        numbers = [float(value) for (value,) in values]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None


def _shortened(text: str, longest: int = _LONGEST_LABEL) -> str:
    return text if len(text) <= longest else text[: longest - 1] + "…"
