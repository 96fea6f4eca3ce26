"""Pictures of the camera: of one frame with the results of the stages; small ones for playback."""

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stixel_cli.geometry.rig import Rig
from stixel_cli.images import encode_png
from stixel_cli.pictures import style
from stixel_cli.pictures.frame_view import FrameView
from stixel_cli.recordings.types import LeftImage
from stixel_cli.rendering.frames import RenderedFrames, StereoPairs
from stixel_cli.results.pictures import CameraFrames, Pictures
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.occupancy import picture_grid
from stixel_cli.stixels.parameters import OccupancyParameters, RoadParameters
from stixel_cli.stixels.types import FreeSpace, Objects, OccupancyGrid, Stixels

TITLES = {
    "left": "Left image",
    "disparity": "Disparity",
    "occupancy": "Occupancy grid, seen from above: depth in m",
    "free_space": "Free space",
    "height": "Free space and height",
    "stixels": "Stixels",
}
"""Of the images, by the name of the file."""

BAR, LEGEND = 92, 26
"""Room on the page for a colour bar, for a legend, px."""

GRID_DEPTHS = (10, 20, 50, 100, 5, 2, 30, 200, 1, 40, 60, 80, 3, 15, 4, 7)
"""Depths of an axis' ticks in m, the most important first."""


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
    """Pictures of frame `frame`; the chunks must contain the frame.

    Gives `k0033/left.png` (in colour; as rendered, without noise), `disparity.png`,
    `occupancy.png`, `free_space.png`, `height.png` and `stixels.png` (over the camera's grey
    image), pixel by pixel, and `camera.png`, all of them on one page with titles, legend and
    colours of depth. Only the times of `ego_motion` are used. With `objects`, their boxes are drawn
    over the stixels.
    """
    time = float(ego_motion.times[frame])
    chunks = (rendered, pairs, disparities, grid, free_space, stixels, objects)
    view = FrameView(frame, time, rig, *chunks)
    images = {
        "left": view.left_image,
        "disparity": view.disparity_image,
        "occupancy": view.grid_image,
        "free_space": view.free_space_image,
        "height": view.height_image,
        "stixels": view.stixels_image,
    }
    with style.drawing({"axes.spines.top": True, "axes.spines.right": True}):
        files = {"camera": style.png(_page(view, images))}
    files |= {name: encode_png(image) for name, image in images.items()}
    return Pictures({f"k{frame:04d}/{name}.png": data for name, data in files.items()})


def _page(view: FrameView, images: dict[str, np.ndarray]) -> Figure:
    """All images on one page; wide ones in two columns, others in three."""
    columns, width = (2, 600) if view.rig.width > 2 * view.rig.height else (3, 430)
    height = round(width * view.rig.height / view.rig.width)
    count = -(-len(images) // columns)
    across, down = width + 44, height + 30
    size = (columns * across + 24 + BAR, count * down + 34 + LEGEND + 22)
    figure = style.new_figure(size[0] / style.DPI, size[1] / style.DPI)
    for i, (name, image) in enumerate(images.items()):
        left = 40 + (i % columns) * across
        bottom = LEGEND + 26 + (count - 1 - i // columns) * down
        axes = _axes_at(figure, size, left, bottom, width, height)
        axes.imshow(image, interpolation="antialiased", aspect="auto")
        axes.set_xticks([])
        axes.set_yticks([])
        if name == "occupancy":
            _draw_limit(axes, view)
            _label_depths(axes, view.grid.depths)
        axes.set_title(TITLES[name])
    bar = _axes_at(figure, size, columns * across + 24, LEGEND + 26, 12, count * down - 30)
    _colour_bar(figure, bar)
    figure.legend(
        handles=[
            Patch(color=style.INVALID, label="no disparity found"),
            Line2D([], [], color=style.FREE, linewidth=1.8, label="end of free space"),
            Patch(color=style.FREE, alpha=0.6, label="free space"),
            Patch(color=style.UNKNOWN, alpha=0.6, label="unknown: no disparity"),
            Patch(color=style.OBSTACLE, alpha=0.6, label="obstacle"),
        ],
        loc="lower left",
        bbox_to_anchor=(40 / size[0], 0.0),
        ncols=5,
        borderaxespad=0.3,
    )
    title = style.title("Camera", view.k, view.time)
    figure.text(40 / size[0], 1.0 - 14 / size[1], title, va="center")
    return figure


def _axes_at(figure: Figure, size, left, bottom, width, height) -> Axes:
    """Axes of a figure of `size` px at a place given in px."""
    return figure.add_axes((left / size[0], bottom / size[1], width / size[0], height / size[1]))


def _draw_limit(axes: Axes, view: FrameView) -> None:
    """The end of free space over the image of the grid."""
    across, rows = view.free_limit
    columns = np.interp(across, view.grid.laterals, np.arange(len(view.grid.laterals)))
    # Neighbouring columns may be far apart in a Cartesian grid: a line would mean nothing.
    look = {"linestyle": "", "marker": "."} if view.grid.kind == "cartesian" else {}
    axes.plot(columns, len(view.grid.depths) - 1 - rows, color=style.FREE, markersize=2.5, **look)


def _colour_bar(figure: Figure, axes: Axes) -> None:
    """Colours of depth in m, near at the top."""
    near, far = style.DEPTH_TICKS[0], style.DEPTH_TICKS[-1]
    colours = ListedColormap(style.depth_colours(np.geomspace(near, far, 256)))
    bar = figure.colorbar(ScalarMappable(LogNorm(near, far), colours), cax=axes)
    axes.invert_yaxis()
    labels = [f"{depth:g} m" for depth in style.DEPTH_TICKS]
    labels[0], labels[-1] = f"≤ {labels[0]}", f"≥ {labels[-1]}"
    bar.set_ticks(style.DEPTH_TICKS, labels=labels)
    axes.minorticks_off()


def _label_depths(axes: Axes, depths: np.ndarray) -> None:
    """Ticks at round depths, as many as have room; rows need not be even in depth."""
    rows = np.arange(len(depths))[::-1]
    ticks: dict[int, float] = {}
    for value in (d for d in GRID_DEPTHS if depths[0] <= d <= depths[-1]):
        row = float(np.interp(value, depths, rows))
        if all(abs(row - other) >= 0.07 * len(depths) for other in ticks.values()):
            ticks[value] = row
    axes.set_yticks(list(ticks.values()), [str(value) for value in ticks])


WIDEST = 512
"""Wider images are reduced to this width, px. Averaging removes the noise, which JPEG cannot."""

_VIEW = (".webp", 400, (cv2.IMWRITE_WEBP_QUALITY, 40))
IMAGES = {"grey": (".jpg", WIDEST, (cv2.IMWRITE_JPEG_QUALITY, 70))}
IMAGES |= dict.fromkeys(("disparity", "grid", "free_space"), _VIEW)
"""Format, greatest width in px and quality of the images of a `FrameView` that the page shows."""


def camera_frames(
    pairs: StereoPairs,
    disparities: Disparities,
    free_space: FreeSpace,
    stixels: Stixels,
    rig: Rig,
    road: RoadParameters,
    occupancy: OccupancyParameters,
    frames: range,
) -> CameraFrames:
    """The left images of `frames` and what was found in them, in small, and their stixels.

    Args:
        pairs, disparities, free_space, stixels: all contain all of `frames`.
        rig, road, occupancy: those of the grid.
        frames: indices k.
    """
    views = [
        FrameView(k, 0.0, rig, None, pairs, disparities, grid, free_space, stixels, None)
        for k in frames
        for grid in [picture_grid(disparities, free_space, rig, road, occupancy, k)]
    ]
    first = frames.start - stixels.first
    offsets = stixels.offsets[first : first + len(frames) + 1]
    rows = slice(offsets[0], offsets[-1])
    return CameraFrames(
        first=frames.start,
        width=rig.width,
        height=rig.height,
        images={
            name: tuple(_encoded(getattr(view, f"{name}_image"), *how) for view in views)
            for name, how in IMAGES.items()
        },
        offsets=(offsets - offsets[0]).astype(np.int64),
        left=stixels.left[rows],
        right=stixels.right[rows],
        top=stixels.top[rows],
        base=stixels.base[rows],
        depth=stixels.depth[rows],
    )


def _encoded(image: np.ndarray, extension: str, widest: int, quality: tuple[int, int]) -> bytes:
    """An RGB image (H, W, 3) uint8 as a file, made smaller if it is wider than `widest`."""
    height, width = image.shape[:2]
    if width > widest:
        size = (widest, max(1, round(height * widest / width)))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode(extension, image[..., ::-1], quality)[1].tobytes()
