"""Pictures of one frame: the camera image and the results of the stages."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stixel_cli.geometry.rig import Rig
from stixel_cli.pictures import camera_panels as panels
from stixel_cli.pictures import style
from stixel_cli.pictures.camera_panels import FrameView
from stixel_cli.recordings.types import LeftImage
from stixel_cli.rendering.frames import RenderedFrames, StereoPairs
from stixel_cli.results.pictures import Pictures
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.types import FreeSpace, Objects, OccupancyGrid, Stixels

LEFT, RIGHT, TOP, BOTTOM = 58, 18, 34, 52  # margins, px
BAR, LEGEND = 92, 26  # room for a colour bar, for a legend, px


@dataclass(frozen=True)
class Panel:
    """One picture of the camera's view: its file, title, drawing, colour bar and legend."""

    name: str
    title: str
    draw: Callable[[Axes, FrameView], None]
    bar: str | None = None
    legend: tuple[str, ...] = ()


PANELS = (
    Panel("left", "Left image", panels.image("left")),
    Panel("disparity", "Disparity", panels.image("disparity"), "disparity", ("invalid",)),
    Panel("occupancy", "Occupancy grid", panels.draw_occupancy, "likelihood", ("limit",)),
    Panel("free_space", "Free space", panels.image("free_space"), None, ("free", "unknown")),
    Panel(
        "height",
        "Free space and height",
        panels.image("height"),
        None,
        ("free", "unknown", "obstacle"),
    ),
    Panel("stixels", "Stixels", panels.draw_stixels, "depth"),
)


def camera_pictures(
    rendered: RenderedFrames | LeftImage,
    pairs: StereoPairs,
    disparities: Disparities,
    grid: OccupancyGrid,
    free_space: FreeSpace,
    stixels: Stixels,
    ego_motion: EgoMotion,
    rig: Rig,
    frame: int,
    objects: Objects | None = None,
) -> Pictures:
    """Pictures of frame `frame`, at the resolution of the image; the chunks must contain the frame.

    Gives `k0033/left.png` (in colour; as rendered, without noise), `disparity.png`,
    `occupancy.png`, `free_space.png`, `height.png` and `stixels.png` (over the camera's grey
    image), and `camera.png`, all of them on one page. Only the times of `ego_motion` are used.
    With `objects`, their boxes are drawn over the stixels.
    """
    time = float(ego_motion.times[frame])
    chunks = (rendered, pairs, disparities, grid, free_space, stixels, objects)
    view = FrameView(frame, time, rig, *chunks)
    with style.drawing({"axes.spines.top": True, "axes.spines.right": True}):
        figures = {panel.name: _single(panel, view) for panel in PANELS}
        figures["camera"] = _overview(view)
        return Pictures(
            {f"k{frame:04d}/{name}.png": style.png(figure) for name, figure in figures.items()}
        )


def _single(panel: Panel, view: FrameView) -> Figure:
    """One panel, one screen pixel for each of the image's (more for small images)."""
    scale = max(1, round(480 / view.rig.width))
    width, height = scale * view.rig.width, scale * view.rig.height
    bottom = BOTTOM + (LEGEND if panel.legend else 0)
    size = (LEFT + width + RIGHT + (BAR if panel.bar else 0), bottom + height + TOP)
    figure = style.new_figure(size[0] / style.DPI, size[1] / style.DPI)
    axes = _axes_at(figure, size, LEFT, bottom, width, height)
    panel.draw(axes, view)
    _label(axes, panel, view)
    axes.set_title(style.title(panel.title, view.k, view.time))
    if panel.bar:
        bar = _axes_at(figure, size, LEFT + width + 12, bottom, 12, height)
        _colour_bar(figure, bar, panel.bar, view)
    if panel.legend:
        _legend(figure, panel.legend, LEFT / size[0])
    return figure


def _overview(view: FrameView) -> Figure:
    """All panels on one page; wide images in two columns, others in three."""
    columns, width = (2, 600) if view.rig.width > 2 * view.rig.height else (3, 430)
    height = round(width * view.rig.height / view.rig.width)
    count = -(-len(PANELS) // columns)
    across, down = width + 44, height + 30
    size = (columns * across + 24 + BAR, count * down + 34 + LEGEND + 22)
    figure = style.new_figure(size[0] / style.DPI, size[1] / style.DPI)
    for i, panel in enumerate(PANELS):
        left = 40 + (i % columns) * across
        bottom = LEGEND + 26 + (count - 1 - i // columns) * down
        axes = _axes_at(figure, size, left, bottom, width, height)
        panel.draw(axes, view)
        axes.set_xticks([])
        is_grid = panel.bar == "likelihood"
        if not is_grid:
            axes.set_yticks([])
        axes.set_title(panel.title + (", seen from above: depth in m" if is_grid else ""))
    bar = _axes_at(figure, size, columns * across + 24, LEGEND + 26, 12, count * down - 30)
    _colour_bar(figure, bar, "depth", view)
    _legend(figure, ("invalid", "limit", "free", "unknown", "obstacle"), 40 / size[0])
    title = style.title("Camera", view.k, view.time)
    figure.text(40 / size[0], 1.0 - 14 / size[1], title, va="center")
    return figure


def _axes_at(figure: Figure, size, left, bottom, width, height) -> Axes:
    """Axes of a figure of `size` px at a place given in px."""
    return figure.add_axes((left / size[0], bottom / size[1], width / size[0], height / size[1]))


def _label(axes: Axes, panel: Panel, view: FrameView) -> None:
    is_grid = panel.bar == "likelihood"
    lateral = is_grid and view.grid.kind == "cartesian"
    axes.set_xlabel("lateral x (m)" if lateral else "u (px)")
    axes.set_ylabel("depth (m)" if is_grid else "v (px)")


def _colour_bar(figure: Figure, axes: Axes, kind: str, view: FrameView) -> None:
    if kind == "likelihood":
        unit = "px²" if view.grid.kind == "cartesian" else "px"
        scale = panels.likelihood_scale(view.grid)
        figure.colorbar(scale, cax=axes, label=f"obstacle pixels per {unit}", format="{x:g}")
        return
    bar = figure.colorbar(panels.depth_scale(), cax=axes)
    axes.invert_yaxis()
    labels = [f"{depth:g} m" for depth in style.DEPTH_TICKS]
    labels[0], labels[-1] = f"≤ {labels[0]}", f"≥ {labels[-1]}"
    if kind == "disparity":
        pixels = view.rig.disparity_from_depth(np.array(style.DEPTH_TICKS))
        labels = [f"{label}\n{d:.3g} px" for label, d in zip(labels, pixels, strict=True)]
    bar.set_ticks(style.DEPTH_TICKS, labels=labels)
    axes.minorticks_off()


def _legend(figure: Figure, names: tuple[str, ...], left: float) -> None:
    known = {
        "invalid": Patch(color=style.INVALID, label="no disparity found"),
        "limit": Line2D([], [], color=style.FREE, linewidth=1.8, label="end of free space"),
        "free": Patch(color=style.FREE, alpha=0.6, label="free space"),
        "unknown": Patch(color=style.UNKNOWN, alpha=0.6, label="unknown: no disparity"),
        "obstacle": Patch(color=style.OBSTACLE, alpha=0.6, label="obstacle"),
    }
    figure.legend(
        handles=[known[name] for name in names],
        loc="lower left",
        bbox_to_anchor=(left, 0.0),
        ncols=len(names),
        borderaxespad=0.3,
    )
