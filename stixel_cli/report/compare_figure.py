"""Error curves of several runs in one plot each, as SVG with the colours of the page."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.evaluation.scores import LOW_OVERLAP
from stixel_cli.report import style
from stixel_cli.results.result import RunResult

LINE_STYLES = ("-", "--", "-.", ":")

# Placeholders for colours of the page, which is light or dark.
_INK, _GRID = "#010203", "#020304"


@dataclass(frozen=True)
class Curve:
    """One error over time: its series, title, unit, and how its axis is drawn."""

    series: str
    title: str
    unit: str
    factor: float = 1.0
    logarithmic: bool = False
    limits: tuple[float | None, float | None] = (None, None)
    line: float | None = None


CURVES = (
    Curve("centre_error", "Centre error", "m", limits=(0.0, None)),
    Curve("orientation_error", "Orientation error", "degrees", float(np.degrees(1.0)), line=0.0),
    Curve("iou", "Intersection over union", "IoU", limits=(0.0, 1.0), line=LOW_OVERLAP),
    Curve("nees_position", "Position NEES / 2 (consistent: 1)", "ratio", 1.0, True, line=1.0),
    Curve("nis", "NIS / degrees of freedom (consistent: 1)", "ratio", 1.0, True, line=1.0),
)


def run_colour(i: int) -> str:
    """Colour of the i-th run."""
    return style.RUNS[i % len(style.RUNS)]


def line_style(i: int) -> str:
    """Line style of the i-th run: style and colour are unique among the first 32 runs."""
    return LINE_STYLES[(i + i // len(style.RUNS)) % len(LINE_STYLES)]


def error_curves(runs: Sequence[RunResult]) -> list[tuple[str, str]]:
    """(title, SVG element) of each error that a run has; the i-th run has colour `var(--run-i)`.

    On the HTML page, text and axes use `currentColor`, the grid uses `var(--grid)`.
    """
    drawn = []
    with style.drawing({"text.color": _INK, "axes.edgecolor": _INK, "axes.labelcolor": _INK}):
        for curve in CURVES:
            if any(np.isfinite(getattr(run.scores, curve.series)).any() for run in runs):
                drawn.append((curve.title, _for_page(_curve_svg(curve, runs), len(drawn))))
    return drawn


def _curve_svg(curve: Curve, runs: Sequence[RunResult]) -> str:
    figure = style.new_figure(5.0, 2.7)
    figure.patch.set_visible(False)
    axes = figure.add_axes((0.115, 0.165, 0.87, 0.72))
    axes.patch.set_visible(False)
    axes.tick_params(colors=_INK)
    axes.grid(True, color=_GRID)
    if curve.logarithmic:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.minorticks_off()
    if curve.line is not None:
        axes.axhline(curve.line, color=_INK, linewidth=0.7, linestyle=(0, (4, 3)))
    for i, run in enumerate(runs):
        values = curve.factor * getattr(run.scores, curve.series)
        if curve.logarithmic:
            values = np.where(values > 0.0, values, np.nan)
        axes.plot(
            run.scores.times, values, color=run_colour(i), linestyle=line_style(i), linewidth=1.6
        )
    axes.set_ylim(*curve.limits)
    if curve.logarithmic:
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.08), max(high, 12.5))
    axes.margins(x=0.01)
    axes.set_title(curve.title)
    axes.set(xlabel="t (s)", ylabel=curve.unit)
    return style.svg(figure).decode()


def _for_page(text: str, number: int) -> str:
    """An SVG file as an element of a page, with unique ids and the colours of the page."""
    text = text[text.index("<svg") :]
    text = re.sub(r'\sxmlns(:xlink)?="[^"]*"', "", text)
    text = re.sub(r'(<svg\b[^>]*?)\swidth="[^"]*"\sheight="[^"]*"', r"\1", text, count=1)
    text = text.replace("xlink:href=", "href=")
    # Matplotlib derives ids from content, so two figures of a page may share them.
    text = re.sub(r'\bid="', f'id="c{number}-', text)
    text = re.sub(r'(url\(|href=")#', rf"\1#c{number}-", text)
    colours = {_INK: "currentColor", _GRID: "var(--grid)"}
    colours |= {colour: f"var(--run-{i})" for i, colour in enumerate(style.RUNS)}
    for colour, name in colours.items():
        text = text.replace(colour, name)
    return text
