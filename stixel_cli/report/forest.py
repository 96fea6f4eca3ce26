"""Forest plot: differences with their intervals, a panel for each metric, a row for each class."""

from collections.abc import Sequence
from dataclasses import dataclass

from stixel_cli.evaluation.metric_table import Metric
from stixel_cli.pictures import style
from stixel_cli.report.blocks import Figure
from stixel_cli.report.statistics import Statistic
from stixel_cli.report.tables import number, with_interval

_TEXT = 9.0
"""Size of all letters, points."""
_LETTER = 0.56 * _TEXT / 72.0
"""in: mean width of a letter."""
_PLOT = 2.2
"""in: width of the axes."""
_ROW = 0.165
"""in: height of a row."""
_PANEL = 0.48
"""in: height of a panel's axis with its label."""
_MARGIN = 0.06
"""Of the greatest value: free space at both ends of an axis."""


@dataclass(frozen=True)
class Row:
    """One difference, or one error.

    Attributes:
        group: class of road user.
        series: what is compared; one colour each.
        metric, unit: of the value; rows of one metric are a panel.
        value: with its 95 % interval: `mean`, `low`, `high`, None where unknown.
        tested, significant: whether a test covers it, and, corrected for multiplicity, shows a
            difference.
        more_is_better: whether a positive difference is an improvement; the axis is then reversed.
    """

    group: str
    series: str
    metric: str
    unit: str
    value: Statistic
    tested: bool = False
    significant: bool = False
    more_is_better: bool = False


def difference_row(
    metric: Metric, sides: str, group: str, series: str, difference: Statistic, **test: bool
) -> Row:
    """The row of a metric's difference between two `sides`, such as "one − other"."""
    label, more = f"{metric.short_label}, {sides}", metric.better == "more"
    return Row(group, series, label, metric.unit, difference, **test, more_is_better=more)


def forest(name: str, rows: Sequence[Row], left: str = "", right: str = "") -> Figure | None:
    """The plot of rows in any order; None without a value.

    The lines at zero of all panels are one line, whose sides mean `left` and `right`. A filled mark
    is a tested value, and a star a significant one.
    """
    known = [row for row in rows if row.value.mean is not None]
    if not known:
        return None
    panels: dict[str, list[Row]] = {}
    for row in known:
        panels.setdefault(row.metric, []).append(row)
    series = list(dict.fromkeys(row.series for row in known))
    scales = {
        metric: max(abs(end) for row in own for end in _extent(row)) or 1.0
        for metric, own in panels.items()
    }
    ends = [_side(row) * end / scales[row.metric] for row in known for end in (*_extent(row), 0.0)]
    low, high = min(ends) - _MARGIN, max(ends) + _MARGIN
    heights = [_ROW * len(own) + _PANEL for own in panels.values()]
    total = sum(heights) + 0.1 + 0.22 * bool(left or right)
    before = _LETTER * max(len(label) for own in panels.values() for label in _labels(own, series))
    before += 0.12
    width = before + _PLOT + 0.12 + _LETTER * max(len(_numbers(row)) for row in known)
    with style.drawing({"axes.spines.left": False}):
        figure = style.new_figure(width, total)
        figure.patch.set_visible(False)
        top = total - 0.22 * bool(left or right) - 0.05
        for (metric, own), height in zip(panels.items(), heights, strict=True):
            bottom = top - height + _PANEL
            size = (before / width, bottom / total, _PLOT / width, (height - _PANEL) / total)
            axes = figure.add_axes(size)
            axes.patch.set_visible(False)
            _panel(axes, own, series, scales[metric], (low, high))
            top -= height
        if left or right:
            # At the line at zero, which is at the same place in every panel.
            at, height = (before - _PLOT * low / (high - low)) / width, 1.0 - 0.12 / total
            figure.text(at - 0.012, height, f"← {left}", ha="right", va="center", fontsize=_TEXT)
            figure.text(at + 0.012, height, f"{right} →", ha="left", va="center", fontsize=_TEXT)
        return Figure(name, "", style.svg(figure))


def _panel(
    axes, rows: Sequence[Row], series: Sequence[str], scale: float, limits: tuple[float, float]
) -> None:
    """The rows of one metric from the top down, with their numbers at the right."""
    side = _side(rows[0])
    axes.axvline(0.0, color=style.TRUTH, linewidth=0.9)
    for place, row in enumerate(rows):
        colour = style.RUNS[series.index(row.series) % len(style.RUNS)]
        low, value, high = row.value.low, row.value.mean, row.value.high
        if low is not None and high is not None:
            axes.plot([low, high], [place, place], color=colour, linewidth=1.6)
        mark = {"markerfacecolor": colour if row.tested else "#ffffff", "markersize": 5.0}
        axes.plot(value, place, "o", color=colour, **mark)
        where = axes.get_yaxis_transform()
        axes.text(1.03, place, _numbers(row), transform=where, va="center", fontsize=_TEXT)
    axes.set_yticks(range(len(rows)), _labels(rows, series))
    axes.tick_params("y", length=0.0, labelsize=_TEXT)
    axes.tick_params("x", labelsize=_TEXT)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    ends = (scale * limits[0], scale * limits[1])
    axes.set_xlim(*(ends if side > 0.0 else (-ends[0], -ends[1])))
    axes.locator_params("x", nbins=5)
    axes.xaxis.set_major_formatter(lambda value, _: number(value, 2 if scale < 1.0 else 1))
    axes.grid(True, axis="x")
    label = f"{rows[0].metric} ({rows[0].unit})" if rows[0].unit else rows[0].metric
    axes.set_xlabel(label + (", axis reversed" if side < 0.0 else ""), fontsize=_TEXT, labelpad=1.0)


def _numbers(row: Row) -> str:
    """The value with its interval, and the star of a significant one."""
    one = row.value
    text = with_interval(one.mean, one.low, one.high, row.unit, sign=True)
    return text + (" *" if row.significant else "")


def _labels(rows: Sequence[Row], series: Sequence[str]) -> list[str]:
    """A label for each row: its class, and its series if there are several."""
    if len(series) == 1:
        return [row.group for row in rows]
    return [f"{row.group}, {row.series}" for row in rows]


def _side(row: Row) -> float:
    """-1 if the metric's axis is reversed, so that worse is at the same side in all panels."""
    return -1.0 if row.more_is_better else 1.0


def _extent(row: Row) -> tuple[float, ...]:
    ends = (row.value.mean, row.value.low, row.value.high)
    return tuple(end for end in ends if end is not None)
