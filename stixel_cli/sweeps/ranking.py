"""The settings of a sweep from the best to the worst by one metric: in words, and drawn."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from stixel_cli.errors import counted
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.pictures import style
from stixel_cli.report.error_curves import NARROW
from stixel_cli.report.intervals import LEAST_FREEDOM
from stixel_cli.report.metrics import capital, with_interval
from stixel_cli.report.statistics import Statistic
from stixel_cli.report.tables import with_unit
from stixel_cli.results.reader import listed
from stixel_cli.sweeps.figures import is_flattened
from stixel_cli.sweeps.over import Setting, marks
from stixel_cli.sweeps.results import SweepResult

MARKS = {"best": "★ ", "tied": "≈ ", "": ""}
"""Before the best setting, and before those that are not shown to be behind."""
MOST_NAMED = 4


def label_of(setting: Setting) -> str:
    """The values of a setting."""
    return " ".join(value for _, value in setting) or "all runs"


def ranked(result: SweepResult, name: str) -> list[Setting]:
    """The settings with a value, the best first; in their order where no value is better."""
    known = {s: row[name].mean for s, row in result.statistics.items() if row[name].n}
    sign = {"more": -1.0, "less": 1.0}.get(metric(name).better, 0.0)
    return sorted(known, key=lambda setting: sign * known[setting])


def answer(result: SweepResult, name: str) -> str:
    """Which setting is best by a metric, or which are not shown to be behind, in one sentence."""
    order, row, behind = ranked(result, name), metric(name), result.behind[name]
    first = [setting for setting in order if setting in marks(behind)] or order

    def value(setting: Setting) -> str:
        one = result.statistics[setting][name]
        return f"{label_of(setting)} ({_interval(one, row.unit)})"

    shown = [value(setting) for setting in first[:MOST_NAMED]]
    shown += [f"{len(first) - MOST_NAMED} more"] if len(first) > MOST_NAMED else []
    text = f"{capital(row.short_label)}: {listed(shown)}"
    if order[1:] and len(first) == 1:
        apart = _interval(behind[order[1]], row.unit, sign=True)
        return f"{text} is the best; {value(order[1])} is next, {apart}."
    others = counted(len(order) - len(first), "other setting")
    text += "; no difference is shown between them" if behind else ""
    return f"{text}; {others} behind." if len(order) > len(first) else f"{text}."


def _interval(one: Statistic, unit: str, sign: bool = False) -> str:
    return with_interval(one.mean, one.low, one.high, unit, sign)


def ranking_figure(result: SweepResult, name: str) -> bytes:
    """SVG: boxes of the units' values, the best setting on top, and differences from the best."""
    order, behind, marked = ranked(result, name), result.behind[name], marks(result.behind[name])
    rows = [result.statistics[setting][name] for setting in order]
    names = [MARKS[marked.get(setting, "")] + label_of(setting) for setting in order]
    width, count = 4.0 + 0.085 * max(map(len, names)), 1 + bool(behind)
    # One above the other: side by side they are too small on a telephone.
    with style.drawing({"axes.spines.left": False, **NARROW["settings"]}):
        figure = style.new_figure(
            max(width, NARROW["width"]), count * (0.7 + 0.2 * len(order)), layout="constrained"
        )
        sides = figure.subplots(count, sharey=True, squeeze=False)[:, 0]
        places = range(len(order))
        for place, row in enumerate(rows):
            _box(sides[0], place, row.values)
        sides[0].set_xlabel(with_unit(metric(name)))
        if behind:
            sides[1].set_xlabel(f"{with_unit(metric(name))}, minus the best")
            sides[1].axvline(0.0, color=style.TRUTH, linewidth=0.9)
            for place, one in enumerate(behind[setting] for setting in order):
                if one.low is not None:
                    sides[1].plot([one.low, one.high], [place] * 2, color=style.RUNS[0])
                sides[1].plot(one.mean, place, "o", color=style.RUNS[0], markersize=4.0)
            sizes = np.abs([one.mean for one in behind.values() if one.mean])
            if is_flattened(name, sizes):
                sides[1].set_xscale("symlog", linthresh=float(np.median(sizes)))
        values = np.concatenate([row.values for row in rows])
        if is_flattened(name, values):
            sides[0].set_xscale("log")
            sides[0].xaxis.set_major_formatter("{x:g}")
        sides[0].set_yticks(places, names)
        sides[0].set_ylim(len(order) - 0.4, -0.6)
        for axes in sides:
            axes.tick_params("y", length=0.0)
            axes.grid(True, axis="x")
        return style.svg(figure)


def _box(axes: Axes, place: float, values: Sequence[float]) -> None:
    """A box of the quartiles with the median, whiskers to the ends, and the values as points."""
    if len(values) > LEAST_FREEDOM:
        low, first, median, third, high = np.quantile(values, [0.0, 0.25, 0.5, 0.75, 1.0])
        look = {"edgecolor": style.RUNS[0], "facecolor": "none", "linewidth": 1.0}
        axes.barh(place, third - first, 0.55, first, **look)
        axes.plot([low, high], [place, place], color=style.RUNS[0], linewidth=0.8, zorder=0)
        axes.plot([median] * 2, [place - 0.27, place + 0.27], color=style.RUNS[1], linewidth=1.6)
    axes.plot(values, np.full(len(values), place), ".", color=style.RUNS[0], markersize=3.0)
