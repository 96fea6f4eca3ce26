"""Errors over time of several runs or settings, as drawings of a page."""

from collections.abc import Iterable, Mapping

import numpy as np
from matplotlib.axes import Axes

from stixel_cli.evaluation.scan_errors import LOW_OVERLAP
from stixel_cli.evaluation.scores import SERIES
from stixel_cli.pictures import style
from stixel_cli.report import charts
from stixel_cli.report.page import Drawing, drawing_for_page

MOST_LINES = 8
"""Most lines of a panel: so many have colours and marks of their own."""

Errors = tuple[np.ndarray, Mapping[str, np.ndarray]]
"""Times (K,), s, and each of the `SERIES` that is known, (n, K) of n runs, in its own unit."""


def error_curves(lines: Mapping[str, Errors], x: str) -> list[tuple[str, Drawing]]:
    """(title, drawing) of each error that a line has, first those that a page shows at once.

    A line is the mean of its runs, with its interval at each time, see `charts.over_time`. The
    i-th line has colour `var(--run-i)`. `x` is the label of the times.
    """
    looks = {label: charts.line_look(i) | {"linewidth": 1.6} for i, label in enumerate(lines)}
    for label, look in looks.items():
        name = label if len(lines) > 1 else ""
        look |= {"label": name, "markevery": 0.25, "markersize": 3.5}
    drawn = []
    for error in sorted(SERIES, key=lambda error: error not in ("iou", "centre_error")):
        known = [(t, of[error], looks[label]) for label, (t, of) in lines.items() if error in of]
        if known:
            parts = [known[i : i + MOST_LINES] for i in range(0, len(known), MOST_LINES)]
            panels = [_panel(error, part, _limits(error, known), x) for part in parts]
            svg = charts.chart(panels)
            drawn.append((SERIES[error].label, drawing_for_page(svg, f"t{len(drawn)}")))
    return drawn


def _limits(error: str, known: Iterable[tuple]) -> charts.Bounds:
    """Limits of the axis: those of the error, or below the values of an outlier."""
    highest = [np.nanquantile(values, 0.95) for _, values, _ in known]
    if SERIES[error].ratio:
        return None, None
    cut = max(highest) > style.FLATTENED * np.median(highest) > 0.0
    return (0.0, style.FLATTENED * float(np.median(highest))) if cut else SERIES[error].bounds


def _panel(error: str, part: Iterable[tuple], limits: charts.Bounds, x: str) -> charts.Panel:
    series = SERIES[error]
    mark = LOW_OVERLAP if error == "iou" else None if series.ratio else series.consistent

    def draw(axes: Axes) -> None:
        if mark is not None:
            axes.axhline(mark, color=style.TRUTH, linewidth=0.7, linestyle=(0, (4, 3)))
        for times, values, look in part:
            bounds = (0.0, series.bounds[1])
            charts.over_time(axes, times, values, series.ratio, bounds, **look)
        axes.margins(x=0.01)

    cut = limits not in (series.bounds, (None, None))
    title = series.label + (" (consistent: 1)" if series.ratio else ", axis cut" if cut else "")
    y = series.unit or series.short_label
    return charts.Panel(draw, title, x, y, series.ratio, limits)
