"""RQ1: the figures. Their captions are in the template."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes

from stixel_cli.report import style
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.intervals import NONE, PHASE_BIAS, Estimate, estimate, phase_sums
from stixel_cli.studies.rq1.pool import AT_BORDER, EDGES, INSIDE, LEAST, SW_DEPTH, SW_STD, Group
from stixel_cli.studies.types import Figure
from stixel_cli.validation.stage_errors import GROSS
from stixel_cli.validation.stage_summary import in_range, phase_bias

CENTRES = 0.5 * (np.array(EDGES[1:]) + np.array(EDGES[:-1]))
WIDTH = 5.0
"""in: narrow enough that the text can be read on a phone."""

_SETTINGS = {"axes.grid": True, "axes.titlesize": 8.5, "axes.labelsize": 8.0}
_TITLE = 30
"""Characters of a line of a panel's title."""

STYLES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D", "v")

Values = Callable[[Group, float, float], Estimate]


def over_range(
    name: str,
    lines: Sequence[Group],
    panels: Sequence[tuple[str, str, dict[str, Values]]],
    prepare: Callable[[Sequence[Axes]], None] | None = None,
    log: bool = False,
) -> Figure:
    """Panels over range, one line for each group.

    Args:
        name: of the figure.
        lines: the groups.
        panels: title, unit, and the lines of each group: a name (shown if there are several, each
            with its own dash) to a function of the group and the ends of a range, m. Only the first
            has its interval as a band: several bands would hide each other.
        prepare: adds to the axes.
        log: whether the axis of the values is logarithmic.
    """
    with style.drawing(_SETTINGS):
        rows = -(-len(panels) // 2)
        height = 1.9 * rows + 0.45 if len(panels) > 1 else 3.6
        figure = style.new_figure(WIDTH, height, layout="constrained")
        axes = np.atleast_1d(figure.subplots(rows, min(2, len(panels)), squeeze=False)).ravel()
        for i, (place, (title, unit, drawn)) in enumerate(zip(axes, panels, strict=False)):
            for colour, marker, group in zip(style.RUNS, MARKERS * 2, lines, strict=False):
                for dash, (what, values) in zip(STYLES, drawn.items(), strict=False):
                    label = f"{group.label}, {what}" if len(drawn) > 1 else group.label
                    found = [values(group, low, high) for low, high in pairwise(EDGES)]
                    drawn_band = what == next(iter(drawn))
                    _line(place, CENTRES, found, colour, dash, marker, label, drawn_band)
            place.set(title=fill(title, _TITLE), ylabel=unit, xlim=(EDGES[0] - 1, EDGES[-1] + 1))
            if i >= len(panels) - 2:
                place.set_xlabel("depth of the target (m)")
            if log:
                place.set_yscale("log")
                place.yaxis.set_major_formatter("{x:g}")
        for place in axes[len(panels) :]:
            place.set_axis_off()
        if prepare is not None:
            prepare(axes)
        _legend(figure, axes[: len(panels)])
        return Figure(name, "", style.svg(figure))


def _line(
    axes: Axes, x, found: Sequence[Estimate], colour, dash, marker, label, band: bool = True
) -> None:
    """A line through the values, and their intervals as a band or, if `band` is not set, none."""
    options = {"color": colour, "linestyle": dash, "marker": marker, "markersize": 2.5}
    axes.plot(x, [one.value for one in found], label=label, **options)
    if band:
        low, high = [one.low for one in found], [one.high for one in found]
        axes.fill_between(x, low, high, color=colour, alpha=0.15, linewidth=0)


def _legend(figure, axes: Sequence[Axes]) -> None:
    """One legend below all panels, of every label once."""
    handles = {}
    for place in axes:
        for handle, label in zip(*place.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(
        handles.values(),
        handles.keys(),
        loc="outside lower center",
        ncols=3 if max(map(len, handles), default=0) < 22 else 1,
    )


def locking(lines: Sequence[Group], zones: dict[str, int]) -> Figure:
    """Mean disparity error by the fractional part of the true disparity, a panel a zone."""
    with style.drawing(_SETTINGS):
        figure = style.new_figure(WIDTH, 2.5, layout="constrained")
        axes = figure.subplots(1, len(zones), sharey=True, squeeze=False)[0]
        for place, (title, zone) in zip(axes, zones.items(), strict=True):
            for colour, marker, group in zip(style.RUNS, MARKERS, lines, strict=False):
                phase, _, count = phase_bias(group.errors.disparity, zone)
                found = [
                    estimate(group, phase_sums(group, zone, i), PHASE_BIAS) if n >= LEAST else NONE
                    for i, n in enumerate(count)
                ]
                _line(place, phase, found, colour, "-", marker, group.label)
            place.axhline(0.0, color=style.TRUTH, linewidth=0.7)
            place.set(title=title, xlabel="fraction of the true disparity (px)", xlim=(0, 1))
        axes[0].set_ylabel("mean error (px)")
        _legend(figure, axes)
        return Figure("locking", "", style.svg(figure))


def normalised(lines: Sequence[Group]) -> Figure:
    """Histogram of the stixels' depth error over its stated σ, with the standard normal."""
    with style.drawing(_SETTINGS):
        figure = style.new_figure(WIDTH, 2.9, layout="constrained")
        axes = figure.subplots()
        edges = np.linspace(-4.0, 4.0, 33)
        for colour, group in zip(style.RUNS, lines, strict=False):
            of = group.errors.stixels
            fine = (np.abs(of.disparity) <= GROSS) & in_range(of.true_depth, EDGES[0], EDGES[-1])
            ratio = of.depth[fine] / of.sigma[fine]
            if len(ratio) >= LEAST:
                # The outermost bins include all larger values.
                density, _ = np.histogram(np.clip(ratio, -3.99, 3.99), edges, density=True)
                axes.stairs(density, edges, color=colour, label=group.label, linewidth=1.4)
        z = np.linspace(-4.0, 4.0, 161)
        normal = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi)
        axes.plot(z, normal, color=style.TRUTH, ls="--", lw=1.1, label="standard normal")
        axes.set(xlabel="depth error / stated σ", ylabel="density", xlim=(-4.0, 4.0))
        _legend(figure, [axes])
        return Figure("normalised", "", style.svg(figure))


def contrast(lines: dict[str, list[tuple[float, Group]]]) -> Figure:
    """Disparities and stixels over the contrast of the paint, one line for each road user."""
    panels = (
        ("Density inside the target", "share", _inside, by_pose.PIXEL_DENSITY),
        ("Disparity RMS inside the target", "px", _inside, by_pose.PIXEL_RMS),
        ("RMS of the stixels in disparity", "px", stixels, by_pose.STIXEL_RMS_PX),
        ("Columns in no stixel", "share", by_pose.cover_sums, by_pose.UNCOVERED),
    )
    with style.drawing(_SETTINGS):
        figure = style.new_figure(WIDTH, 4.3, layout="constrained")
        axes = figure.subplots(2, 2).ravel()
        for place, (title, unit, sums, of) in zip(axes, panels, strict=True):
            for colour, marker, (label, groups) in zip(
                style.RUNS, MARKERS, lines.items(), strict=False
            ):
                x = [contrast for contrast, _ in groups]
                found = [estimate(group, sums(group), of) for _, group in groups]
                _line(place, x, found, colour, "-", marker, label)
            place.set(title=fill(title, _TITLE), ylabel=unit, xlim=(0.0, 1.05))
            place.set_ylim(0.0, 1.08 * max(place.get_ylim()[1], 1e-9))
        for place in axes[2:]:
            place.set_xlabel("contrast of the paint")
        _legend(figure, axes)
        return Figure("contrast", "", style.svg(figure))


def _inside(group: Group, low: float = EDGES[0], high: float = EDGES[-1]) -> np.ndarray:
    return by_pose.pixel_sums(group, INSIDE, low, high)


def _border(group: Group, low: float, high: float) -> np.ndarray:
    return by_pose.pixel_sums(group, AT_BORDER, low, high)


def stixels(group: Group) -> np.ndarray:
    """`intervals.stixel_sums` of all ranges."""
    return by_pose.stixel_sums(group, EDGES[0], EDGES[-1])


def disparity(name: str, lines: Sequence[Group], border: bool) -> Figure:
    """Disparity on the target over range, inside it and, with `border`, near its edge."""
    zones = {"inside": _inside, "border": _border} if border else {"": _inside}
    panels = [
        (title, unit, {where: by_pose.over_range(sums, of) for where, sums in zones.items()})
        for title, unit, of in (
            ("Bias", "px", by_pose.pixel_bias),
            ("RMS", "px", by_pose.PIXEL_RMS),
            ("Gross share", "share", by_pose.PIXEL_GROSS),
            ("Density", "share", by_pose.PIXEL_DENSITY),
        )
    ]
    return over_range(name, lines, panels)


def columns(name: str, lines: Sequence[Group], kinds: dict[str, str]) -> Figure:
    """The target's columns over range; `kinds` are labels of lines with their step."""

    def value(step: str, of: by_pose.Statistic) -> Values:
        return by_pose.over_range(
            lambda group, low, high: by_pose.column_sums(group, step, low, high), of
        )

    panels = [
        (title, unit, {label: value(step, of) for label, step in kinds.items()})
        for title, unit, of in (
            ("Bias", "px", by_pose.COLUMN_BIAS),
            ("RMS", "px", by_pose.COLUMN_RMS),
            ("RMS in depth", "m", by_pose.COLUMN_RMS_M),
            ("Columns missed", "share", by_pose.COLUMN_MISSED),
        )
    ]
    return over_range(name, lines, panels)


_HEIGHT = (
    ("Top row, bias (down is positive)", "px", by_pose.TOP_BIAS),
    ("Top row, RMS", "px", by_pose.TOP_RMS),
    ("Height, bias", "m", by_pose.HEIGHT_BIAS),
    ("Base row, RMS", "px", by_pose.BASE_RMS),
)
_DEPTH = (
    ("Depth error, mean", "m", by_pose.STIXEL_BIAS),
    ("RMS in disparity", "px", by_pose.STIXEL_RMS_PX),
    ("Mean square of error / σ (1: consistent)", "", by_pose.NEES),
    ("Lateral RMS", "m", by_pose.LATERAL_RMS),
)
_COVERAGE = (
    ("Stixels on the target", "a frame", by_pose.STIXELS_A_FRAME),
    ("Columns in no stixel", "share", by_pose.UNCOVERED),
    ("Columns in a stixel elsewhere", "share", by_pose.ELSEWHERE),
    ("Columns beside it that get its disparity", "a frame", by_pose.OVERHANG),
)


def of_stixels(lines: Sequence[Group]) -> dict[str, Figure]:
    """Height, depth and coverage of the stixels over range, by name."""
    kinds = {
        "height": (_HEIGHT, by_pose.stixel_sums, LEAST),
        "depth": (_DEPTH, by_pose.stixel_sums, LEAST),
        "coverage": (_COVERAGE, by_pose.cover_sums, 1),
    }
    return {
        name: over_range(
            name,
            lines,
            [(title, unit, {"": by_pose.over_range(sums, of, n)}) for title, unit, of in panels],
        )
        for name, (panels, sums, n) in kinds.items()
    }


def rigs(lines: Sequence[Group]) -> Figure:
    """RMS depth error over range of each rig, with the std that The Stixel World states.

    The dashed line through that std at its depth is proportional to z². It is the same for all
    rigs.
    """

    def target(axes: Sequence[Axes]) -> None:
        place = axes[0]
        z = np.linspace(EDGES[0], EDGES[-1], 50)
        law = SW_STD * (z / SW_DEPTH) ** 2
        place.plot(
            z, law, color="#777777", ls="--", lw=1.0, label="one disparity error, through that"
        )
        place.plot(
            [SW_DEPTH],
            [SW_STD],
            color=style.TRUTH,
            marker="*",
            markersize=11,
            linestyle="none",
            label=f"The Stixel World: {SW_STD:g} m at {SW_DEPTH:g} m",
        )

    rms = by_pose.over_range(by_pose.stixel_sums, by_pose.STIXEL_RMS)
    panels = [("RMS depth error of the stixels", "m", {"": rms})]
    return over_range("rigs", lines, panels, target, log=True)
