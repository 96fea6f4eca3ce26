"""Figures of an answer: its values with the paired differences, a metric over an axis, errors over
time; and the charts of panels that they are.

The figure of a NEES is a reliability diagram: a mean is that of few scans that are far off.
"""

import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib.figure
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from stixel_cli.answers.runs import FOLDER, LONGEST_NAME, MEAN, MINUS, STATUS, Answer
from stixel_cli.errors import UserError
from stixel_cli.evaluation.intervals import LEAST_UNITS, Bounds, mean_interval
from stixel_cli.evaluation.scores import LOW_OVERLAP, SERIES
from stixel_cli.pictures import style
from stixel_cli.report.page import drawing_for_page
from stixel_cli.results.result import DONE, read_series

_LETTERS, _MARK, _LINE, _ROW = 13.0, 7, 0.16, 2.25
"""Letters of a legend to an inch; the room of its marks, in letters; heights of a line and of a
panel, in."""
DASHES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v")


@dataclass(frozen=True)
class Panel:
    """One pair of axes of a chart."""

    draw: Callable[[Axes], None]
    """Adds lines to the axes."""
    title: str = ""
    x: str = ""
    y: str = ""
    """Labels; "" for none."""
    ratio: bool = False
    """Whether the axis is logarithmic, with a line at 1, the value of a consistent filter."""
    limits: tuple[float | None, float | None] = (None, None)
    """Of y; None where Matplotlib chooses."""


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


def mean_line(
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


MOST_ROWS, MOST_LINES = 20, 8
"""Most lines of the names in a figure of differences; most lines of a panel, which have colours and
marks of their own."""

Errors = tuple[np.ndarray, Mapping[str, np.ndarray]]
"""Times (K,), s, and each of the `SERIES` that is known, (n, K) of n runs, in its own unit."""


def error_curves(lines: Mapping[str, Errors], x: str) -> list[tuple[str, dict[str, Any]]]:
    """(title, drawing) of each error that a line has, first those that a page shows at once.

    A line is the mean of its runs, with its interval at each time, see `mean_line`. The
    i-th line has colour `var(--run-i)`. `x` is the label of the times.
    """
    looks = {label: line_look(i) | {"linewidth": 1.6} for i, label in enumerate(lines)}
    for label, look in looks.items():
        name = label if len(lines) > 1 else ""
        look |= {"label": name, "markevery": 0.25, "markersize": 3.5}
    drawn = []
    for error in sorted(SERIES, key=lambda error: error not in ("iou", "centre_error")):
        known = [(t, of[error], looks[label]) for label, (t, of) in lines.items() if error in of]
        if known:
            parts = [known[i : i + MOST_LINES] for i in range(0, len(known), MOST_LINES)]
            panels = [_panel(error, part, _limits(error, known), x) for part in parts]
            svg = chart(panels)
            drawn.append((SERIES[error].label, drawing_for_page(svg, f"t{len(drawn)}")))
    return drawn


def _limits(error: str, known: Iterable[tuple]) -> Bounds:
    """Limits of the axis: those of the error, or below the values of an outlier."""
    highest = [np.nanquantile(values, 0.95) for _, values, _ in known]
    if SERIES[error].ratio:
        return None, None
    cut = max(highest) > style.FLATTENED * np.median(highest) > 0.0
    return (0.0, style.FLATTENED * float(np.median(highest))) if cut else SERIES[error].bounds


def _panel(error: str, part: Iterable[tuple], limits: Bounds, x: str) -> Panel:
    series = SERIES[error]
    mark = LOW_OVERLAP if error == "iou" else None if series.ratio else series.consistent

    def draw(axes: Axes) -> None:
        if mark is not None:
            axes.axhline(mark, color=style.TRUTH, linewidth=0.7, linestyle=(0, (4, 3)))
        for times, values, look in part:
            bounds = (0.0, series.bounds[1])
            mean_line(axes, times, values, series.ratio, bounds, **look)
        axes.margins(x=0.01)

    cut = limits not in (series.bounds, (None, None))
    title = series.label + (" (consistent: 1)" if series.ratio else ", axis cut" if cut else "")
    y = series.unit or series.short_label
    return Panel(draw, title, x, y, series.ratio, limits)


SHARES = np.linspace(0.0, 1.0, 101)
"""Shares of a run at which errors over time are compared where the runs have different times."""
MOST_READ = 400
"""Most runs whose errors over time a page reads: two seconds."""

Series = dict[str, np.ndarray]
"""Fields of `Scores` to their values over time."""


def over_time(answer: Answer) -> dict[str, Errors]:
    """Errors over time of the best options: of each, the mean of each unit's runs.

    Over the time, if all runs have the same times; else over the share of each run. {} where
    `errors_of_runs` is.
    """
    found = errors_of_runs(answer)
    every = [one for units in found.values() for own in units.values() for one in own]
    if not every:
        return {}
    same = all(np.array_equal(every[0][0], times) for times, _ in every)
    names = set.intersection(*(set(series) for _, series in every))
    return {
        option: (every[0][0] if same else SHARES, _stacked(units, names, same))
        for option, units in found.items()
    }


def errors_of_runs(answer: Answer) -> dict[str, dict[Any, list[tuple[np.ndarray, Series]]]]:
    """Times and errors of the runs of each unit of the best options.

    They are of the scenarios and units that the means are over. {} without folders, with too many
    of them, or if a file cannot be read.
    """
    runs, options = answer.runs, answer.order[:MOST_LINES]
    balanced = runs["scenario"].isin(answer.scenarios) & runs["unit"].isin(answer.values.index)
    runs = runs[balanced & runs["option"].isin(options) & (runs[STATUS] == DONE)]
    if FOLDER not in runs or len(runs) > MOST_READ:
        return {}
    found: dict[str, dict[Any, list[tuple[np.ndarray, Series]]]] = {}
    for option in options:
        for _, run in runs[runs["option"] == option].iterrows():
            try:
                errors = read_series(Path(str(run[FOLDER])) / "scores.npz")
            except UserError:
                return {}
            found.setdefault(str(option), {}).setdefault(run["unit"], []).append(errors)
    return found


def _stacked(units: Mapping, names: set[str], same: bool) -> dict[str, np.ndarray]:
    def resampled(times: np.ndarray, series: Series, name: str) -> np.ndarray:
        if same or len(times) < 2:
            return series[name]
        return np.interp(SHARES, (times - times[0]) / (times[-1] - times[0]), series[name])

    stacked = {}
    for name in names:
        rows = [np.mean([resampled(*one, name) for one in own], axis=0) for own in units.values()]
        of_units = SERIES[name].factor * np.stack(rows)
        stacked[name] = np.abs(of_units) if name == "orientation_error" else of_units
    return {name: values for name, values in stacked.items() if np.isfinite(values).any()}


BEST, TIED = "★", "≈"
"""Before the best option, and before those that are not shown to differ from it."""
_COLOUR, _MIDDLE = style.RUNS[0], style.RUNS[1]

PROBABILITIES = np.linspace(0.05, 0.99, 48)
"""At which the stated covariance of the position is compared with its errors."""


def drawing(answer: Answer) -> tuple[bytes, str]:
    """The figure of an answer on a page, an SVG, and its legend."""
    if answer.question.metric == "nees_position_mean" and (reliable := reliability(answer)):
        return reliable, "Below the dashes, errors are larger than stated; bands: 95 % intervals"
    return differences(answer), legend(answer)


def legend(answer: Answer) -> str:
    """What the marks of the figure of `differences` mean, those that it has."""
    marks = {_mark(answer, option) for option in answer.values}
    bars = ", bars: 95 % intervals" if answer.units >= LEAST_UNITS else ""
    shown, of = len(_names(answer)), answer.values.shape[1]
    texts = {
        f"The best {shown} of {of} options": of > shown,
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
            look = line_look(i) | {"label": option, "markevery": 0.2, "markersize": 3.5}
            mean_line(axes, PROBABILITIES, np.array(values), bounds=(0.0, 1.0), **look)

    x, y = "probability of the stated region", "share of positions in it"
    return chart([Panel(draw, "Reliability of the position", x, y, limits=(0.0, 1.0))])


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
    """The units' values of each option with their mean, the best on top, and the differences.

    Bars are 95 % intervals, without which there are no differences. Returns what `write` makes of
    the figure.
    """
    named = _names(answer)
    order, names = [*named], [*named.values()]
    table, values = answer.table.loc[order], answer.values[order].to_numpy()
    # Without intervals nothing is compared.
    paired = bool(table["minus_low"].notna().any())
    lines = len(names) * max((1 + name.count("\n") for name in names), default=1)
    # Many options are seen at once where the differences are beside the values, not below them.
    beside = paired and lines > MOST_LINES
    rows, heading = 1 + (paired and not beside), answer.question.row.heading
    with style.drawing({"axes.spines.left": False, **style.LEGIBLE}):
        height = rows * (0.7 + 0.2 * lines)
        figure = style.new_figure(style.NARROW + 1.5 * beside, height)
        sides = figure.subplots(rows, 1 + beside, sharey=True, squeeze=False).ravel()
        places = np.arange(len(order))
        sides[0].plot(values.T, places, ".", color=style.UNUSED, markersize=4.0)
        for axes, (mean, *ends) in zip(sides, (MEAN, MINUS), strict=False):
            known = table[ends].notna().all(axis=1)
            low, high = table.loc[known, ends].to_numpy().T
            axes.hlines(places[known], low, high, color=_COLOUR, linewidth=1.4)
            axes.plot(table[mean], places, "o", color=_MIDDLE, markersize=4.0)
        sides[0].set_xlabel(heading)
        if _is_flattened(answer, values):
            sides[0].set_xscale("log")
            sides[0].xaxis.set_major_formatter("{x:g}")
        if paired:
            minus = f"minus {answer.against}"
            sides[1].set_xlabel(minus if beside else f"{heading}, {minus}", loc="right")
            sides[1].axvline(0.0, color=style.TRUTH, linewidth=0.9)
        sides[0].set_yticks(range(len(order)), names)
        sides[0].set_ylim(len(order) - 0.4, -0.6)
        for axes in sides:
            if axes.get_xscale() == "linear":
                axes.locator_params("x", nbins=3)
            axes.tick_params("y", length=0.0)
            axes.grid(True, axis="x")
        style.place(figure, sides[:rows])
        return write(figure)


def _names(answer: Answer) -> dict[object, str]:
    """The options of a figure, the best first, with their names in lines; none without a value."""
    order = [option for option in answer.order if option in answer.values]
    names = [fill(f"{_mark(answer, one)} {one}".strip(), LONGEST_NAME) for one in order]
    lines = max((1 + name.count("\n") for name in names), default=1)
    return dict(zip(order[: max(1, MOST_ROWS // lines)], names, strict=False))


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
        mean_line(axes, places, shown, bounds=row.bounds, **look)
        if places[0] > 0.0 and _is_geometric(places):
            axes.set_xscale("log")
            axes.minorticks_off()
            axes.set_xticks(places, [f"{place:g}" for place in places])

    x, y = answer.question.compare[0], answer.question.row.heading
    return chart([Panel(draw, "", x, y, ratio=row.better == "one")])


def pdf(figure: matplotlib.figure.Figure) -> bytes:
    """The figure as a PDF without a date, so that its bytes repeat."""
    buffer, dated = io.BytesIO(), ("CreationDate", "Creator", "Producer")
    figure.savefig(buffer, format="pdf", metadata=dict.fromkeys(dated))
    return buffer.getvalue()


FORMATS = {"svg": style.svg, "pdf": pdf, "png": style.png}
"""Format of a figure to what writes it."""


def _mark(answer: Answer, option: object) -> str:
    if answer.best is None or answer.units < LEAST_UNITS or answer.question.reference is not None:
        return ""
    if option == answer.best:
        return BEST if answer.shown else TIED
    return "" if answer.differs[option] else TIED


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
