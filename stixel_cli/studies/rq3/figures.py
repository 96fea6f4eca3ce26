"""RQ3: the figures. Their captions are in the template."""

from collections.abc import Mapping, Sequence

import numpy as np

from stixel_cli.report import style
from stixel_cli.studies.rq3.compare import Comparison
from stixel_cli.studies.rq3.runs import FABRICATED, FITTED, SIMULATED, correlogram
from stixel_cli.studies.types import Figure
from stixel_cli.validation.point_errors import PointErrors

WIDTH = 5.4
COLOURS = dict(zip((SIMULATED, FABRICATED, FITTED), style.RUNS, strict=False))
_LINES = {SIMULATED: "-", FABRICATED: "--", FITTED: "-."}
RANGE_CLASS = 4.0
"""m."""
LEAST_POINTS = 20
"""Least number of points of a class of range."""
_RANGES = np.arange(0.0, 80.0, RANGE_CLASS)
_LAGS = tuple(range(1, 25))
_INSIDE = np.arange(-8.0, 25.0, 2.0)

Pools = Mapping[str, Mapping[str, Sequence[PointErrors]]]
"""Road user to sweep to the errors of its runs."""


def error_histograms(pools: Pools) -> Figure:
    """Density of the disparity's error, a panel a road user."""
    edges = np.linspace(-1.0, 1.0, 81)

    def draw(axes, sweep: str, runs: Sequence[PointErrors]) -> None:
        values = _all(runs, "disparities")
        if len(values):
            share = np.histogram(values, edges)[0] / (len(values) * (edges[1] - edges[0]))
            axes.stairs(share, edges, color=COLOURS[sweep], linestyle=_LINES[sweep], label=sweep)

    return _panels(
        "point_errors",
        pools,
        draw,
        "error of the disparity (px)",
        "density (1/px)",
    )


def range_law(pools: Pools) -> Figure:
    """Mean error along the ray and its standard deviation over the true range."""

    def draw(axes, sweep: str, runs: Sequence[PointErrors]) -> None:
        places, error = _all(runs, "true_ranges"), _all(runs, "along")
        bins = np.digitize(places, _RANGES)
        rows = [
            (places[bins == i].mean(), error[bins == i].mean(), error[bins == i].std())
            for i in np.unique(bins)
            if np.count_nonzero(bins == i) >= LEAST_POINTS
        ]
        if rows:
            where, mean, spread = np.array(rows).T
            axes.plot(where, mean, _LINES[sweep], color=COLOURS[sweep], marker=".", label=sweep)
            axes.fill_between(
                where, mean - spread, mean + spread, color=COLOURS[sweep], alpha=0.12, linewidth=0.0
            )

    return _panels(
        "range_law",
        pools,
        draw,
        "true range (m)",
        "error along the ray (m)",
    )


def neighbours(pools: Pools) -> Figure:
    """Correlation of the disparity's errors over the columns between two points."""

    def draw(axes, sweep: str, runs: Sequence[PointErrors]) -> None:
        values = [np.nan if c is None else c for c in correlogram(runs, _LAGS)]
        known = np.isfinite(values)
        axes.plot(
            np.array(_LAGS)[known],
            np.array(values)[known],
            _LINES[sweep],
            color=COLOURS[sweep],
            marker=".",
            label=sweep,
        )
        axes.axhline(0.0, color=style.UNUSED, linewidth=0.6)

    return _panels(
        "neighbours",
        pools,
        draw,
        "columns between two points (px)",
        "correlation",
    )


def edges(pools: Pools) -> Figure:
    """Share of the silhouette's ends that the points reach, by column."""

    def draw(axes, sweep: str, runs: Sequence[PointErrors]) -> None:
        reach = np.concatenate([_all(runs, "reach_left"), _all(runs, "reach_right")])
        reach = reach[np.isfinite(reach)]
        if len(reach):
            share = [np.mean(reach >= -inside) for inside in _INSIDE]
            axes.plot(_INSIDE, share, _LINES[sweep], color=COLOURS[sweep], label=sweep)
            axes.axvline(0.0, color=style.UNUSED, linewidth=0.6)

    return _panels(
        "edges",
        pools,
        draw,
        "columns inside the silhouette's end (px)",
        "share of the ends",
    )


def tracker_differences(found: Sequence[Comparison]) -> Figure:
    """Paired differences with their intervals, a panel a measure."""
    measures = list(dict.fromkeys(one.measure.label for one in found))
    rows = list(dict.fromkeys((one.road_user, one.tracker) for one in found))
    with style.drawing():
        figure = style.new_figure(WIDTH, 0.5 + (0.55 + 0.24 * len(rows)) * len(measures))
        figure.set_layout_engine("constrained")
        grid = figure.subplots(len(measures), 1, squeeze=False)[:, 0]
        for axes, label in zip(grid, measures, strict=True):
            for one in (c for c in found if c.measure.label == label):
                place = rows.index((one.road_user, one.tracker))
                for shift, sweep in ((-0.15, FABRICATED), (0.15, FITTED)):
                    apart = one.apart[sweep]
                    if apart.mean is None:
                        continue
                    if apart.low is not None:
                        ends = [apart.low, apart.high]
                        axes.plot(ends, [place + shift] * 2, color=COLOURS[sweep], linewidth=1.4)
                    mark = "o" if sweep == FABRICATED else "s"
                    axes.plot(apart.mean, place + shift, mark, color=COLOURS[sweep], markersize=4)
            unit = next(c.measure.unit for c in found if c.measure.label == label)
            axes.axvline(0.0, color=style.UNUSED, linewidth=0.8)
            axes.set_yticks(range(len(rows)), [f"{user}, {tracker}" for user, tracker in rows])
            axes.set_ylim(len(rows) - 0.5, -0.5)
            axes.set_xlabel(f"{label} ({unit})" if unit else label, fontsize=8.0)
            axes.grid(True, axis="x")
        for sweep, mark in ((FABRICATED, "o"), (FITTED, "s")):
            grid[0].plot([], [], mark, color=COLOURS[sweep], label=f"{sweep} − simulated")
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return Figure("tracker_differences", "", style.svg(figure))


def _panels(name: str, pools: Pools, draw, x_label: str, y_label: str) -> Figure:
    with style.drawing():
        figure = style.new_figure(WIDTH, 0.5 + 1.55 * len(pools))
        figure.set_layout_engine("constrained")
        grid = figure.subplots(len(pools), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (user, sweeps) in zip(grid, pools.items(), strict=True):
            for sweep, runs in sweeps.items():
                draw(axes, sweep, runs)
            axes.set_title(user)
            axes.set_ylabel(y_label, fontsize=8.0)
            axes.grid(True)
        grid[-1].set_xlabel(x_label)
        handles: dict[str, object] = {}
        for axes in grid:
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        if handles:
            figure.legend(
                handles.values(), handles.keys(), loc="outside upper center", ncols=len(handles)
            )
        return Figure(name, "", style.svg(figure))


def _all(runs: Sequence[PointErrors], name: str) -> np.ndarray:
    return np.concatenate([np.zeros(0), *(getattr(run, name) for run in runs)])
