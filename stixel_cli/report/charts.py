"""Charts of reports: panels with one legend, lines with bands or bars, and errors over time."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from stixel_cli.evaluation.intervals import LEAST_UNITS, Bounds, mean_interval
from stixel_cli.pictures import style

_LETTERS, _MARK, _LINE, _ROW = 13.0, 7, 0.16, 2.25
"""Letters of a legend to an inch; the room of its marks, in letters; heights of a line and of a
panel, in."""
DASHES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v")


@dataclass(frozen=True)
class Panel:
    """One pair of axes of a chart.

    Attributes:
        draw: adds lines to the axes.
        title, x, y: labels; "" for none.
        ratio: whether the axis is logarithmic, with a line at 1, the value of a consistent filter.
        limits: of y; None where Matplotlib chooses.
    """

    draw: Callable[[Axes], None]
    title: str = ""
    x: str = ""
    y: str = ""
    ratio: bool = False
    limits: tuple[float | None, float | None] = (None, None)


def chart(panels: Sequence[Panel]) -> bytes:
    """An SVG of panels one below the other, with one legend of every label below them."""
    with style.drawing({"axes.grid": True, **style.LEGIBLE}):
        height = 0.45 + _ROW * len(panels)
        figure = style.new_figure(style.NARROW, height)
        # The colour of the page is behind an SVG.
        figure.patch.set_visible(False)
        grid = figure.subplots(len(panels), squeeze=False).ravel()
        for axes, panel in zip(grid, panels, strict=True):
            axes.patch.set_visible(False)
            axes.set(title=panel.title, xlabel=panel.x, ylabel=panel.y)
            panel.draw(axes)
            # Even without a limit, this would end the automatic choice, which a log axis needs.
            if panel.limits != (None, None):
                axes.set_ylim(*panel.limits)
            if panel.ratio:
                axes.axhline(1.0, color=style.UNUSED, linewidth=0.8, linestyle="--")
                style.log_axis(axes)
        found = (zip(*axes.get_legend_handles_labels(), strict=True) for axes in grid)
        handles = {label: handle for one in found for handle, label in one}
        below = 0.0
        if handles:
            labels = [fill(label, int(_LETTERS * style.NARROW)) for label in handles]
            beside = max(1, int(_LETTERS * style.NARROW / (_MARK + max(map(len, labels)))))
            lines = math.ceil(sum(1 + label.count("\n") for label in labels) / beside)
            below = 0.1 + _LINE * lines
            figure.set_figheight(height + _LINE * (lines - 1))
            look = {"loc": "lower center", "ncols": min(beside, len(labels))}
            figure.legend(handles.values(), labels, **look)
        style.place(figure, grid, below)
        return style.svg(figure)


def line_look(i: int) -> dict[str, Any]:
    """Colour, line style and mark of the i-th line: it is known without its colour, too.

    Line style and colour are unique among the first 32 lines.
    """
    dash = DASHES[(i + i // len(style.RUNS)) % len(DASHES)]
    marker = MARKERS[i % len(MARKERS)]
    return {"color": style.RUNS[i % len(style.RUNS)], "linestyle": dash, "marker": marker}


def over_time(
    axes: Axes,
    times: np.ndarray,
    values: np.ndarray,
    ratio: bool = False,
    bounds: Bounds = (0.0, None),
    **look: Any,
) -> None:
    """Mean of values (n, K) of n runs at each time (K,), without NaN.

    `look` has Matplotlib's arguments of the line. The band is the 95 % interval between `bounds`,
    if all runs have a value at every time; too few runs for an interval are thin lines. A ratio
    has neither, and no value that is not positive: its axis is logarithmic.
    """
    known = np.isfinite(values)
    n, total = known.sum(axis=0), np.where(known, values, 0.0).sum(axis=0)
    mean = np.divide(total, n, where=n > 0, out=np.full(len(n), np.nan))
    if ratio:
        mean = np.where(mean > 0.0, mean, np.nan)
    axes.plot(times, mean, **look)
    runs = len(values)
    if ratio or runs == 1:
        return
    if runs < LEAST_UNITS:
        axes.plot(times, values.T, **look | {"label": "", "marker": "", "linewidth": 0.5})
    elif (n == runs).all():
        ends = mean_interval(pd.DataFrame(values), bounds)
        axes.fill_between(times, ends.low, ends.high, color=look["color"], alpha=0.2, linewidth=0.0)
