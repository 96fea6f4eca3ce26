"""RQ3: the points against the true contour, their measures and figures."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from stixel_cli.pictures import style
from stixel_cli.report.blocks import Figure
from stixel_cli.report.charts import Panel, chart
from stixel_cli.report.run_frame import run_frame
from stixel_cli.report.tables import chosen, names
from stixel_cli.studies.rq3.compare import FABRICATED, FITTED, PAIR, SCAN, SIMULATED, Measure
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.validation.point_errors import PointErrors
from stixel_cli.validation.point_statistics import correlogram, point_statistics

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

_REACH = "reach beyond the silhouette's"
POINT_MEASURES = {
    "bias_along": Measure("bias along the ray", "m"),
    "bias_disparity": Measure("bias of the disparity", "px"),
    "std": Measure("standard deviation along the ray", "m"),
    "std_disparity": Measure("standard deviation of the disparity", "px"),
    "bias_across": Measure("bias across the ray", "m"),
    "neighbours": Measure("correlation of neighbours", ""),
    "scans": Measure("correlation of successive scans' means", ""),
    "reach": Measure(f"{_REACH} ends", "px"),
    "beside": Measure("share of points outside the silhouette", ""),
    "missed": Measure("share of the target's columns without a point", ""),
    "points": Measure("points of the target in a scan", ""),
    "clutter": Measure("clutter points in a scan", ""),
}

Pools = Mapping[str, Mapping[str, Sequence[PointErrors]]]
"""Road user to sweep to the errors of its runs."""
Draw = Callable[[Axes, Sequence[PointErrors], dict], None]


def runs_of(sweep: SweepResult) -> pd.DataFrame:
    """The frame of a sweep's runs, with the errors of their points as `errors`.

    The runs of several trackers on the same scans share one object.
    """
    runs = run_frame(sweep.runs).drop_duplicates(PAIR, keep="last")
    first = runs.drop_duplicates(SCAN)
    errors = {
        key: run.load("point_errors")
        for key, run in zip(first[SCAN].itertuples(index=False), first["run"], strict=True)
    }
    return runs.assign(errors=[errors[key] for key in runs[SCAN].itertuples(index=False)])


def point_values(runs: pd.DataFrame, lag: float) -> pd.DataFrame:
    """`POINT_MEASURES` of the runs, with `PAIR` as index; neighbours are `lag` columns apart.

    All trackers have the same points: the index has "" in the place of their names.
    """
    first = runs[runs["tracker"] == names(runs, "tracker")[0]].assign(tracker="")
    rows = [
        point_statistics(errors, run.configuration.rig.focal, lag)
        for run, errors in zip(first["run"], first["errors"], strict=True)
    ]
    index = pd.MultiIndex.from_frame(first[PAIR])
    return pd.DataFrame(rows, index, [*POINT_MEASURES], dtype=float)


def pools_of(sweeps: dict[str, pd.DataFrame]) -> Pools:
    """The errors of each road user and sweep, of one tracker: the others have the same."""
    first = names(sweeps[SIMULATED], "tracker")[0]
    return {
        user: {
            sweep: chosen(runs, road_user=user, tracker=first)["errors"].tolist()
            for sweep, runs in sweeps.items()
        }
        for user in names(sweeps[SIMULATED], "road_user")
    }


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
