"""How pictures look: colours with one meaning each, and figures that repeat to the byte.

The colours are those of Okabe & Ito (2008), *Color Universal Design*, distinguishable with
all common kinds of colour vision. One colour means one thing in every picture.
"""

import io
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from threading import RLock

import matplotlib
import numpy as np
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.typing import ArrayLike

TRUTH = "#1a1a1a"
ESTIMATE = "#0072b2"
USED = "#d55e00"
UNUSED = "#8a8a8a"
EGO = "#cc79a7"
FIELD_OF_VIEW = "#d9a400"
FREE = "#009e73"
OBSTACLE = "#d0312d"
INVALID = "#cfcfcf"
UNKNOWN = "#7b3fa0"
OBJECT = "#56b4e9"
CONSISTENT = "#e6e6e6"

RUNS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5b4b8a", "#777777")
"""Colours of whole runs, where several are compared."""

DPI = 110

DEPTH_TICKS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Colours of depth run evenly in log(depth) between the first and the last, m."""

FLATTENED = 8.0
"""A value of so many times the median would flatten the others on a linear axis."""

NARROW = 4.8
"""Width of a chart, in, that fits on a telephone without scrolling."""
LEGIBLE = {
    f"{text}size": 10.0
    for text in ("axes.label", "xtick.label", "ytick.label", "legend.font", "axes.title")
}
"""Sizes of text, pt, that are legible there."""
_LETTER, _LINE = 0.087, 0.2
"""Mean width of such a letter and height of its line, in."""

_FONT = "DejaVu Sans of Matplotlib"
_SETTINGS = {
    "font.family": _FONT,
    "mathtext.fontset": "custom",
    **{f"mathtext.{kind}": _FONT for kind in ("rm", "sf", "tt", "cal")},
    "mathtext.it": f"{_FONT}:italic",
    "mathtext.bf": f"{_FONT}:bold",
    "mathtext.bfit": f"{_FONT}:italic:bold",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    # A fixed place: to look for a free one costs more than to draw the title.
    "axes.titley": 1.0,
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "svg.hashsalt": "stixel",
}
# These belong to the process, not to a picture. Setting them makes Matplotlib look for a display.
_PROCESS_SETTINGS = ("backend", "backend_fallback", "interactive", "toolbar", "timezone", "webagg")
# Matplotlib's settings are the process's, not the thread's: with `executor=threads` two stages that
# draw at once would draw with each other's.
_one_at_a_time = RLock()


@contextmanager
def drawing(settings: dict | None = None) -> Iterator[None]:
    """Context in which figures are made and written: our settings over Matplotlib's defaults.

    The user's own matplotlibrc is ignored, because it would change the bytes. `settings`
    are further Matplotlib settings, which override these. One thread draws at a time.
    """
    _register_font()
    settable = (n for n in matplotlib.rcParamsDefault if not n.startswith(_PROCESS_SETTINGS))
    defaults = {name: matplotlib.rcParamsDefault[name] for name in settable}
    with _one_at_a_time, matplotlib.rc_context(defaults | _SETTINGS | (settings or {})):
        yield


@cache
def _register_font() -> None:
    """Give the DejaVu Sans of Matplotlib's own package the name `_FONT`.

    By its usual name Matplotlib may find the system's copy, whose version can differ.
    """
    for path in sorted(Path(matplotlib.get_data_path(), "fonts", "ttf").glob("DejaVuSans*.ttf")):
        font = font_manager.ttfFontProperty(font_manager.get_font(path))
        if font.name == "DejaVu Sans":
            font_manager.fontManager.ttflist.append(replace(font, name=_FONT))


def new_figure(width: float, height: float, **options) -> Figure:
    """An empty figure of `width` × `height` in, free of Matplotlib's global list of figures."""
    return Figure(figsize=(width, height), dpi=DPI, **options)


def place(figure: Figure, column: Sequence[Axes], below: float = 0.0) -> None:
    """Place a column of axes, with room for labels of `LEGIBLE` size, and `below` in free below it.

    Matplotlib's own layouts measure every text, which takes longer than to draw it: here the room
    is counted in letters.
    """
    width, height = figure.get_size_inches()
    ticks = [axes.yaxis.get_major_formatter().format_ticks(axes.get_yticks()) for axes in column]
    left = 0.12 + _LETTER * max(map(len, "\n".join(map("\n".join, ticks)).split("\n")))
    left += (_LINE + 0.05) * any(axes.get_ylabel() for axes in column)
    over, under = 0.08 + _LINE * any(axes.get_title("left") for axes in column), 0.12 + 2.0 * _LINE
    inside = (height - below) / len(column) - over - under
    ends = (left / width, (below + under) / height, 1.0 - 0.15 / width, 1.0 - over / height)
    figure.subplots_adjust(*ends, hspace=(over + under) / inside)


def png(figure: Figure, under: Iterable[tuple[int, int, np.ndarray]] = ()) -> bytes:
    """The figure as a PNG without date and version, so that its bytes repeat.

    `under` are images (h, w, 3) uint8 below what is drawn, and the column and the row of the first
    pixel of each: Matplotlib takes ten times as long to scale and place an image.
    """
    from PIL import Image

    canvas = FigureCanvasAgg(figure)
    pixels = np.asarray(canvas.get_renderer().buffer_rgba())
    pixels[...] = 255
    for left, top, image in under:
        pixels[top : top + image.shape[0], left : left + image.shape[1], :3] = image
    figure.draw(canvas.get_renderer())
    buffer = io.BytesIO()
    pixels = np.ascontiguousarray(pixels[..., :3])
    Image.fromarray(pixels).save(buffer, format="png", compress_level=1)
    return buffer.getvalue()


def svg(figure: Figure) -> bytes:
    """The figure as an SVG without date and version, so that its bytes repeat."""
    buffer = io.BytesIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    FigureCanvasSVG(figure).print_svg(buffer, metadata=nothing)
    return buffer.getvalue()


def log_axis(axes: Axes) -> None:
    """Make the y axis of a drawing logarithmic, with at least two labels over a decade."""
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    steps = (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)
    short = high < 4.0 * low
    axes.yaxis.set_major_locator(MaxNLocator(5) if short else LogLocator(subs=steps))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()


def depth_colours(depth: ArrayLike) -> np.ndarray:
    """RGB colours, depth's shape + (3,), 0 … 1, of depths in m: near is yellow, far is violet."""
    near, far = np.log(DEPTH_TICKS[0]), np.log(DEPTH_TICKS[-1])
    with np.errstate(divide="ignore"):
        share = (np.log(np.asarray(depth, dtype=np.float64)) - near) / (far - near)
    return matplotlib.colormaps["viridis"](1.0 - np.clip(share, 0.0, 1.0))[..., :3]


def title(name: str, k: int, time: float) -> str:
    """Title of a picture of frame k at `time` s."""
    return f"{name},  k = {k},  t = {time:.2f} s"
