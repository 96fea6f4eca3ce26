"""Figures of an answer: the values with the paired differences, and a metric over an axis.

That of a NEES is a reliability diagram: a mean is that of few scans that are far off.
"""

import io
from collections.abc import Callable, Mapping
from typing import Any

import matplotlib.figure
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from stixel_cli.answers.answer import Answer
from stixel_cli.answers.over_time import errors_of_runs
from stixel_cli.evaluation.intervals import LEAST_UNITS
from stixel_cli.pictures import style
from stixel_cli.report import charts

BEST, TIED = "★", "≈"
"""Before the best option, and before those that are not shown to differ from it."""
_COLOUR, _MIDDLE = style.RUNS[0], style.RUNS[1]

PROBABILITIES = np.linspace(0.05, 0.99, 48)
"""At which the stated covariance of the position is compared with its errors."""


def drawing(answer: Answer) -> bytes:
    """The figure of an answer on a page, an SVG."""
    reliable = reliability(answer) if answer.question.metric == "nees_position_mean" else None
    return reliable or differences(answer)


def legend(answer: Answer) -> str:
    """What the marks of the figure of `differences` mean, those that it has."""
    marks = {_mark(answer, option) for option in answer.values}
    bars = ", bars: 95 % intervals" if answer.units >= LEAST_UNITS else ""
    texts = {
        f"Grey: the units; dots: means{bars}": answer.units > 1,
        f"{BEST}: all others differ": BEST in marks,
        f"{TIED}: not shown to differ": TIED in marks,
    }
    return "; ".join(text for text, occurs in texts.items() if occurs)


def reliability(answer: Answer) -> bytes | None:
    """Share of scans whose true position is in the region that has the probability p, over p.

    The line of an option is the mean of the units, with its interval. Below the diagonal, errors
    are larger than stated. None without the runs' errors.
    """
    shares = {
        option: [
            np.mean([shares_inside(errors) for _, errors in own], axis=0) for own in units.values()
        ]
        for option, units in errors_of_runs(answer).items()
    }
    shares = {option: values for option, values in shares.items() if np.isfinite(values).any()}
    if not shares:
        return None

    def draw(axes: Axes) -> None:
        axes.plot([0.0, 1.0], [0.0, 1.0], color=style.TRUTH, linewidth=0.8, linestyle="--")
        for i, (option, values) in enumerate(shares.items()):
            look = charts.line_look(i) | {"label": option, "markevery": 0.2, "markersize": 3.5}
            charts.over_time(axes, PROBABILITIES, np.array(values), bounds=(0.0, 1.0), **look)

    x, y = "probability of the stated region", "share of positions in it"
    return charts.chart(
        [charts.Panel(draw, "Reliability of the position", x, y, limits=(0.0, 1.0))]
    )


def shares_inside(errors: Mapping[str, np.ndarray]) -> np.ndarray:
    """Share of a run's scans whose position is in the region of each of `PROBABILITIES`.

    It is where 1 - exp(-NEES / 2) is at most the probability: NEES is chi-square of two degrees.
    NaN without a NEES.
    """
    nees = errors.get("nees_position", np.empty(0))
    inside = 1.0 - np.exp(-nees[np.isfinite(nees), None]) <= PROBABILITIES
    return inside.mean(axis=0) if len(inside) else np.full(len(PROBABILITIES), np.nan)


def differences(
    answer: Answer, write: Callable[[matplotlib.figure.Figure], Any] = style.svg
) -> Any:
    """The units' values of each option with their mean, the best on top; below, the differences.

    Bars are 95 % intervals. Options without a value are left out. Returns what `write` makes of the
    figure.
    """
    order = [option for option in answer.order if option in answer.values]
    table, values = answer.table.loc[order], answer.values[order]
    paired = bool(table["minus"].notna().any())
    names = [f"{_mark(answer, option)} {option}".strip() for option in order]
    width = max(style.NARROW, 4.0 + 0.085 * max(map(len, names), default=0))
    with style.drawing({"axes.spines.left": False, **style.LEGIBLE}):
        height = (1 + paired) * (0.7 + 0.2 * len(order))
        figure = style.new_figure(width, height)
        sides = figure.subplots(1 + paired, sharey=True, squeeze=False)[:, 0]
        for place, option in enumerate(order):
            row, own = table.loc[option], values[option]
            sides[0].plot(own, np.full(len(own), place), ".", color=style.UNUSED, markersize=4.0)
            _bar(sides[0], place, *row[["mean", "low", "high"]])
            if paired and np.isfinite(row["minus"]):
                _bar(sides[1], place, *row[["minus", "minus_low", "minus_high"]])
        sides[0].set_xlabel(answer.question.heading)
        if _is_flattened(answer, values.to_numpy()):
            sides[0].set_xscale("log")
            sides[0].xaxis.set_major_formatter("{x:g}")
        if paired:
            reference = answer.question.reference
            of = answer.best if reference is None else reference
            sides[1].set_xlabel(f"{answer.question.heading}, minus {of}")
            sides[1].axvline(0.0, color=style.TRUTH, linewidth=0.9)
        sides[0].set_yticks(range(len(order)), names)
        sides[0].set_ylim(len(order) - 0.4, -0.6)
        for axes in sides:
            axes.tick_params("y", length=0.0)
            axes.grid(True, axis="x")
        style.place(figure, sides)
        return write(figure)


def over_axis(answer: Answer) -> bytes | None:
    """The mean over the values of the compared axis, an SVG; None unless these are three numbers or
    more with a value.

    The thick line is the mean of the units, over the scenarios and units that every value has, with
    its interval; thin lines are the scenarios.
    """
    if answer.values.empty:
        return None
    numbers = pd.to_numeric(pd.Series([*answer.values.columns]), errors="coerce")
    if len(numbers) < 3 or not np.isfinite(numbers).all() or len(answer.question.compare) > 1:
        return None
    order = np.argsort(numbers)
    columns, places = answer.values.columns[order], numbers.to_numpy(float)[order]
    scenes = answer.by_scenario().loc[[*answer.scenarios], columns]
    values, row = answer.values[columns].to_numpy(), answer.question.row

    def draw(axes: Axes) -> None:
        if len(scenes) > 1:
            axes.plot(places, scenes.to_numpy().T, color=style.UNUSED, linewidth=0.6)
        shown = values if answer.units >= LEAST_UNITS else values.mean(axis=0, keepdims=True)
        look = {"color": _COLOUR, "marker": "o", "markersize": 3.5}
        charts.over_time(axes, places, shown, bounds=row.bounds, **look)
        if places[0] > 0.0 and _is_geometric(places):
            axes.set_xscale("log")
            axes.minorticks_off()
            axes.set_xticks(places, [f"{place:g}" for place in places])

    x, y = answer.question.compare[0], answer.question.heading
    return charts.chart([charts.Panel(draw, "", x, y, ratio=row.better == "one")])


def pdf(figure: matplotlib.figure.Figure) -> bytes:
    """The figure as a PDF without a date, so that its bytes repeat."""
    buffer, dated = io.BytesIO(), ("CreationDate", "Creator", "Producer")
    figure.savefig(buffer, format="pdf", metadata=dict.fromkeys(dated))
    return buffer.getvalue()


def _mark(answer: Answer, option: object) -> str:
    if answer.best is None or answer.units < LEAST_UNITS or answer.question.reference is not None:
        return ""
    if option == answer.best:
        return BEST if answer.shown else TIED
    row = answer.table.loc[option]
    return TIED if row["minus_low"] <= 0.0 <= row["minus_high"] else ""


def _bar(axes: Axes, place: float, mean: float, low: float, high: float) -> None:
    if np.isfinite(low):
        axes.plot([low, high], [place] * 2, color=_COLOUR, linewidth=1.4)
    axes.plot(mean, place, "o", color=_MIDDLE, markersize=4.0)


def _is_flattened(answer: Answer, values: np.ndarray) -> bool:
    """Whether an error's greatest value would flatten the others on a linear axis."""
    values = values[np.isfinite(values)]
    if answer.question.row.bounds != (0.0, None) or len(values) == 0 or values.min() <= 0.0:
        return False
    return bool(values.max() > style.FLATTENED * np.median(values))


def _is_geometric(places: np.ndarray) -> bool:
    """Whether ascending places have equal ratios rather than equal steps: then a log axis fits."""
    ratios = places[1:] / places[:-1]
    return bool(ratios.max() <= 1.3 * ratios.min() and ratios.min() > 1.4)
