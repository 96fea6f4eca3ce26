"""RQ3: the figures of the points. Their captions are in the template."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from stixel_cli.pictures import style
from stixel_cli.report.blocks import Figure
from stixel_cli.report.charts import Panel, chart
from stixel_cli.studies.rq3.measures import FABRICATED, FITTED, SIMULATED
from stixel_cli.validation.point_errors import PointErrors
from stixel_cli.validation.point_statistics import correlogram

COLOURS = dict(zip((SIMULATED, FABRICATED, FITTED), style.RUNS, strict=False))
_LINES = {SIMULATED: "-", FABRICATED: "--", FITTED: "-."}
RANGE_CLASS = 4.0
"""m."""
LEAST_POINTS = 20
"""Least number of points of a class of range."""
_RANGES = np.arange(0.0, 80.0, RANGE_CLASS)
_LAGS = tuple(range(1, 25))
_INSIDE = np.arange(-8.0, 25.0, 2.0)
_DENSITY = np.linspace(-1.0, 1.0, 81)

Pools = Mapping[str, Mapping[str, Sequence[PointErrors]]]
"""Road user to sweep to the errors of its runs."""
Draw = Callable[[Axes, Sequence[PointErrors], dict], None]


def point_figures(pools: Pools) -> dict[str, Figure]:
    """The figures, a panel for each road user, by their name in the template."""
    return {
        "errors": _figure(
            "point_errors", pools, _histogram, "error of the disparity (px)", "density (1/px)"
        ),
        "range": _figure(
            "range_law", pools, _range_law, "true range (m)", "error along the ray (m)"
        ),
        "neighbours": _figure(
            "neighbours", pools, _neighbours, "columns between two points (px)", "correlation"
        ),
        "edges": _figure(
            "edges", pools, _edges, "columns inside the silhouette's end (px)", "share of the ends"
        ),
    }


def _figure(name: str, pools: Pools, draw: Draw, x: str, y: str) -> Figure:
    def panel(user: str) -> Panel:
        def of_user(axes: Axes) -> None:
            for sweep, runs in pools[user].items():
                line = {"color": COLOURS[sweep], "linestyle": _LINES[sweep], "label": sweep}
                draw(axes, runs, line)

        return Panel(of_user, title=user, x=x if user == list(pools)[-1] else "", y=y)

    return chart(name, list(map(panel, pools)), row=1.55, sharex=True)


def _histogram(axes: Axes, runs: Sequence[PointErrors], line: dict) -> None:
    """Density of the disparity's error."""
    values = joined(runs, "disparities")
    if len(values):
        width = _DENSITY[1] - _DENSITY[0]
        share = np.histogram(values, _DENSITY)[0] / (len(values) * width)
        axes.stairs(share, _DENSITY, **line)


def _range_law(axes: Axes, runs: Sequence[PointErrors], line: dict) -> None:
    """Mean error along the ray and its standard deviation over the true range."""
    places, error = joined(runs, "true_ranges"), joined(runs, "along")
    bins = np.digitize(places, _RANGES)
    rows = [
        (places[bins == i].mean(), error[bins == i].mean(), error[bins == i].std())
        for i in np.unique(bins)
        if np.count_nonzero(bins == i) >= LEAST_POINTS
    ]
    if rows:
        where, mean, spread = np.array(rows).T
        axes.plot(where, mean, marker=".", **line)
        shade = {"color": line["color"], "alpha": 0.12, "linewidth": 0.0}
        axes.fill_between(where, mean - spread, mean + spread, **shade)


def _neighbours(axes: Axes, runs: Sequence[PointErrors], line: dict) -> None:
    """Correlation of the disparity's errors over the columns between two points."""
    values = np.array([np.nan if c is None else c for c in correlogram(runs, _LAGS)])
    known = np.isfinite(values)
    axes.plot(np.array(_LAGS)[known], values[known], marker=".", **line)
    axes.axhline(0.0, color=style.UNUSED, linewidth=0.6)


def _edges(axes: Axes, runs: Sequence[PointErrors], line: dict) -> None:
    """Share of the silhouette's ends that the points reach, by column."""
    reach = np.concatenate([joined(runs, "reach_left"), joined(runs, "reach_right")])
    reach = reach[np.isfinite(reach)]
    if len(reach):
        axes.plot(_INSIDE, [np.mean(reach >= -inside) for inside in _INSIDE], **line)
        axes.axvline(0.0, color=style.UNUSED, linewidth=0.6)


def joined(runs: Sequence[PointErrors], name: str) -> np.ndarray:
    """The values of a field of all runs, one after the other."""
    return np.concatenate([np.zeros(0), *(getattr(run, name) for run in runs)])
