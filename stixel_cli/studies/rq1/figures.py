"""RQ1: the figures. Their captions are in the template."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes

from stixel_cli.pictures import style
from stixel_cli.report.blocks import Figure
from stixel_cli.report.charts import DASHES, MARKERS, Panel, chart, line
from stixel_cli.report.statistics import Statistic
from stixel_cli.studies.rq1 import errors as of
from stixel_cli.validation.stage_errors import PHASES

CENTRES = 0.5 * (np.array(of.EDGES[1:]) + np.array(of.EDGES[:-1]))
_SETTINGS = {"axes.titlesize": 8.5, "axes.labelsize": 8.0}
_TITLE = 30
"""Characters of a line of a panel's title."""

Panels = Sequence[tuple[str, str, Mapping[str, of.Measure]]]
"""Title, unit, and what has a line of its own: a name, shown if there are several, to a measure."""

_HEIGHT = (
    ("Top row, bias (down is positive)", "px", {"": of.bias("top")}),
    ("Top row, RMS", "px", {"": of.rms("top")}),
    ("Height, bias", "m", {"": of.bias("height")}),
    ("Base row, RMS", "px", {"": of.rms("base")}),
)
_DEPTH = (
    ("Depth error, mean", "m", {"": of.BIAS}),
    ("RMS in disparity", "px", {"": of.RMS_PX}),
    ("Mean square of error / σ (1: consistent)", "", {"": of.NEES}),
    ("Lateral RMS", "m", {"": of.rms("lateral")}),
)
_COVERAGE = (
    ("Stixels on the target", "a frame", {"": of.STIXELS_A_FRAME}),
    ("Columns in no stixel", "share", {"": of.UNCOVERED}),
    ("Columns in a stixel elsewhere", "share", {"": of.ELSEWHERE}),
    ("Columns next to it that get its disparity", "per frame", {"": of.OVERHANG}),
)
_CONTRAST = (
    ("Density inside the target", "share", of.PIXELS["density"]),
    ("Disparity RMS inside the target", "px", of.PIXELS["RMS"]),
    ("RMS of the stixels in disparity", "px", of.RMS_PX),
    ("Columns in no stixel", "share", of.UNCOVERED),
)


def over_range(
    name: str,
    lines: Sequence[of.Errors],
    panels: Panels,
    add: Callable[[Axes], None] = lambda axes: None,
    row: float = 1.9,
    least: int = of.LEAST,
) -> Figure:
    """Panels over range, one line for each of `lines`; `add` draws more on each.

    Only the first measure has its interval as a band: several bands would hide each other.
    """
    parts = [[own.between(*ends) for ends in pairwise(of.EDGES)] for own in lines]

    def panel(i: int, title: str, unit: str, measures: Mapping[str, of.Measure]) -> Panel:
        def draw(axes: Axes) -> None:
            for colour, marker, own, ranges in zip(
                style.RUNS, MARKERS * 2, lines, parts, strict=False
            ):
                for dash, (what, measure) in zip(DASHES, measures.items(), strict=False):
                    label = f"{own.label}, {what}" if len(measures) > 1 else own.label
                    found = [part.estimate(measure, least) for part in ranges]
                    band = what == next(iter(measures))
                    look = {"linestyle": dash, "marker": marker}
                    line(axes, CENTRES, found, colour, label, band=band, **look)
            axes.set_xlim(of.EDGES[0] - 1, of.EDGES[-1] + 1)
            add(axes)

        x = "depth of the target (m)" if i >= len(panels) - 2 else ""
        return Panel(draw, title=fill(title, _TITLE), x=x, y=unit)

    drawn = [panel(i, *one) for i, one in enumerate(panels)]
    return chart(name, drawn, min(2, len(panels)), row, settings=_SETTINGS)


def chapter_figures(
    lines: Mapping[str, Sequence[of.Errors]],
    every_frame: Sequence[of.Errors],
    contrasts: Mapping[str, Sequence[of.Errors]],
) -> dict[str, Figure]:
    """The figures of the chapters, by name; arguments as of `tables.chapter_tables`."""
    users, matchers, grids, rigs = (lines[n] for n in ("users", "matchers", "grids", "rigs"))
    zones = {"inside": of.INSIDE, "border": of.AT_BORDER}
    return {
        "disparity": over_range("disparity", users, _disparity(zones)),
        "matchers": over_range("matchers", matchers, _disparity({"": of.INSIDE})),
        "locking": _locking(every_frame),
        "free_space": over_range("free_space", users, _columns({"path": "path", "grid": "grid"})),
        "grids": over_range("grids", grids, _columns({"": "path"})),
        "height": over_range("height", users, _HEIGHT),
        "depth": over_range("depth", users, _DEPTH),
        "normalised": _normalised(users),
        "coverage": over_range("coverage", users, _COVERAGE, least=1),
        "rigs": over_range(
            "rigs", rigs, [("RMS depth error of the stixels", "m", {"": of.RMS})], _stated, 3.1
        ),
        "contrast": _contrast(contrasts),
    }


def _disparity(zones: Mapping[str, int]) -> Panels:
    """Disparity on the target in zones."""
    titles = {"bias": ("Bias", "px"), "RMS": ("RMS", "px")}
    titles |= {"gross": ("Gross share", "share"), "density": ("Density", "share")}
    return [
        (*title, {name: of.of_pixels(zone)[measure] for name, zone in zones.items()})
        for measure, title in titles.items()
    ]


def _columns(steps: Mapping[str, str]) -> Panels:
    """The target's columns after steps."""
    return [
        (title, unit, {label: of.of_columns(value, step, root) for label, step in steps.items()})
        for title, unit, value, root in (
            ("Bias", "px", "px", False),
            ("RMS", "px", "px", True),
            ("RMS in depth", "m", "m", True),
            ("Columns missed", "share", "missed", False),
        )
    ]


def _stated(axes: Axes) -> None:
    """The std that The Stixel World states, and the same disparity error at other depths.

    The dashed line through that std at its depth is proportional to z². It is the same for all
    rigs.
    """
    z = np.linspace(of.EDGES[0], of.EDGES[-1], 50)
    label = f"The Stixel World: {of.SW_STD:g} m at {of.SW_DEPTH:g} m"
    law = {"color": "#777777", "linestyle": "--", "linewidth": 1.0}
    axes.plot(
        z, of.SW_STD * (z / of.SW_DEPTH) ** 2, label="one disparity error, through that", **law
    )
    star = {"color": style.TRUTH, "marker": "*", "markersize": 11, "linestyle": "none"}
    axes.plot([of.SW_DEPTH], [of.SW_STD], label=label, **star)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")


def _locking(lines: Sequence[of.Errors]) -> Figure:
    """Mean disparity error by the fractional part of the true disparity, a panel a zone."""
    places = (np.arange(PHASES) + 0.5) / PHASES

    def panel(title: str, zone: int, y: str) -> Panel:
        def draw(axes: Axes) -> None:
            for colour, marker, own in zip(style.RUNS, MARKERS, lines, strict=False):
                found = [phase_error(own, zone, i) for i in range(PHASES)]
                line(axes, places, found, colour, own.label, marker=marker)
            axes.axhline(0.0, color=style.TRUTH, linewidth=0.7)
            axes.set_xlim(0, 1)

        return Panel(draw, title=title, x="fraction of the true disparity (px)", y=y)

    panels = [
        panel("inside the target", of.INSIDE, "mean error (px)"),
        panel("inside other obstacles", of.OTHERS, ""),
    ]
    return chart("locking", panels, len(panels), 2.05, settings=_SETTINGS, sharey=True)


def phase_error(own: of.Errors, zone: int, i: int) -> Statistic:
    """Mean error of the disparities of a fractional part; no value from fewer than `LEAST`."""
    measure = of.phase(zone, i)
    enough = own.rows(measure)[measure.per].sum() >= of.LEAST
    return own.estimate(measure) if enough else Statistic()


def _normalised(lines: Sequence[of.Errors]) -> Figure:
    """Histogram of the stixels' depth error over its stated σ, with the standard normal."""
    edges = np.linspace(-4.0, 4.0, 33)

    def draw(axes: Axes) -> None:
        for colour, own in zip(style.RUNS, lines, strict=False):
            ratio = own.tables["stixels"]["ratio"].to_numpy()
            if len(ratio) >= of.LEAST:
                # The outermost bins include all larger values.
                density, _ = np.histogram(np.clip(ratio, -3.99, 3.99), edges, density=True)
                axes.stairs(density, edges, color=colour, label=own.label, linewidth=1.4)
        z = np.linspace(-4.0, 4.0, 161)
        normal = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi)
        axes.plot(z, normal, color=style.TRUTH, ls="--", lw=1.1, label="standard normal")
        axes.set_xlim(-4.0, 4.0)

    panel = Panel(draw, x="depth error / stated σ", y="density")
    return chart("normalised", [panel], row=2.45, settings=_SETTINGS)


def _contrast(users: Mapping[str, Sequence[of.Errors]]) -> Figure:
    """Disparities and stixels over the contrast of the paint, one line for each road user."""

    def panel(i: int, title: str, unit: str, measure: of.Measure) -> Panel:
        def draw(axes: Axes) -> None:
            for colour, marker, (label, parts) in zip(
                style.RUNS, MARKERS, users.items(), strict=False
            ):
                x, found = [float(own.label) for own in parts], [p.estimate(measure) for p in parts]
                line(axes, x, found, colour, label, marker=marker)
            axes.set_xlim(0.0, 1.05)
            axes.set_ylim(0.0, 1.08 * max(axes.get_ylim()[1], 1e-9))

        return Panel(draw, fill(title, _TITLE), "contrast of the paint" if i > 1 else "", unit)

    drawn = [panel(i, *one) for i, one in enumerate(_CONTRAST)]
    return chart("contrast", drawn, 2, 1.9, settings=_SETTINGS)
