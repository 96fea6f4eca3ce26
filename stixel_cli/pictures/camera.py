"""Pictures of the camera: of one frame with the results of the stages; small ones for playback."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from stixel_cli.geometry.rig import Rig
from stixel_cli.pictures import style
from stixel_cli.rendering.frames import RenderedFrames, StereoPairs
from stixel_cli.rendering.images import ImageStack, encode_png, reduced
from stixel_cli.results.pictures import CameraFrames, Pictures
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stereo.disparities import SUBPIXELS, Disparities
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

LIKELIHOOD_RANGE = 1000.0
"""Likelihoods below the maximum divided by this are drawn as empty."""

OPACITY = 0.65
"""Of the stixels over an image."""

LETTERS = (cv2.FONT_HERSHEY_SIMPLEX, 0.4)
"""Font and size of what OpenCV writes on an image: about 8 × 10 px a letter."""

GRID_DEPTHS = (10, 20, 50, 100, 5, 2, 30, 200, 1, 40, 60, 80, 3, 15, 4, 7)
"""Depths of an axis' ticks in m, the most important first."""


@dataclass(frozen=True)
class FrameView:
    """Frame k and the results of its stages; each is a chunk that contains the frame."""

    k: int
    """Index of the frame."""
    rig: Rig
    """Of the images."""
    pairs: StereoPairs
    """The camera's images."""
    disparities: Disparities
    grid: OccupancyGrid
    free_space: FreeSpace
    stixels: Stixels
    """`disparities`, `grid`, `free_space`, `stixels`: of these stages."""
    objects: Objects | None = None
    """Clusters of the stixels; None without."""
    widest: int = 2**15
    """Wider images are made smaller, to this width, px; the images with stixels are not."""

    @property
    def rows(self) -> slice:
        """The rows of the frame's stixels."""
        return self.stixels.rows(self.k - self.stixels.first)

    @property
    def obstacle_disparity(self) -> np.ndarray:
        """(W,) px, NaN where the column is free."""
        return self.free_space.disparity[self.k - self.free_space.first]

    @cached_property
    def grey_image(self) -> np.ndarray:
        """The camera's image, (H, W, 3) uint8."""
        grey = reduced(self.pairs.left[self.k - self.pairs.first], self.widest)
        return cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB)

    @property
    def pixels(self) -> tuple[np.ndarray, np.ndarray]:
        """The rows (h, 1) and the columns (w,) of the camera's image that `grey_image` shows."""
        height, width = self.grey_image.shape[:2]
        rows = (np.arange(height)[:, None] + 0.5) * self.rig.height / height
        return rows.astype(int), ((np.arange(width) + 0.5) * self.rig.width / width).astype(int)

    @property
    def free_limit(self) -> tuple[np.ndarray, np.ndarray]:
        """Place along `grid.laterals` and row of the grid where free space ends, (W,) each."""
        depth = self.rig.depth_from_disparity(self.obstacle_disparity.astype(np.float64))
        rows = np.interp(depth, self.grid.depths, np.arange(len(self.grid.depths)))
        across = np.arange(len(depth), dtype=np.float64)
        if self.grid.kind == "cartesian":
            across = (across - self.rig.u0) * depth / self.rig.focal
        return across, np.where(np.isfinite(depth), rows, np.nan)

    @cached_property
    def grid_image(self) -> np.ndarray:
        """The occupancy grid, near depths below, and the end of free space, (D, L, 3) uint8."""
        least = (float(self.grid.values.max(initial=0.0)) or 1.0) / LIKELIHOOD_RANGE
        values = np.maximum(reduced(self.grid.values, self.widest), least)
        share = np.log(values / least) / np.log(LIKELIHOOD_RANGE)
        image = colormaps["Greys"](share, bytes=True)[..., :3]
        across, rows = self.free_limit
        ends = np.isfinite(rows)
        columns = np.linspace(0.0, image.shape[1] - 1.0, len(self.grid.laterals))
        columns = np.interp(across[ends], self.grid.laterals, columns)
        rows = rows[ends] * (len(image) - 1) / (len(self.grid.depths) - 1)
        places = np.rint([rows, columns]).astype(np.int64)
        for up in range(3):  # three rows, to be seen in a small image
            image[np.maximum(places[0] - up, 0), places[1]] = _rgb(style.FREE)
        return image[::-1]

    @cached_property
    def disparity_image(self) -> np.ndarray:
        """Disparity in the colour of the depth that it means, grey where none, (H, W, 3) uint8."""
        raw = self.disparities.raw(self.k - self.disparities.first)
        highest = int(raw.max(initial=0))
        with np.errstate(divide="ignore"):
            depth = self.rig.depth_from_disparity(np.arange(highest + 1) / SUBPIXELS)
        colours = np.rint(255.0 * style.depth_colours(depth)).astype(np.uint8)
        table = np.concatenate([[_rgb(style.INVALID)], colours])
        return table.take(np.maximum(raw[self.pixels], -1) + 1, axis=0)

    @cached_property
    def free_space_image(self) -> np.ndarray:
        """The camera's image with free and unknown space tinted, (H, W, 3) uint8.

        Each column is tinted from its obstacle's base, or the horizon (the first row of the road in
        the grid), down: in the colour of free space, but above the unknown row in that of the
        unknown.
        """
        image, i = self.grey_image.copy(), self.k - self.free_space.first
        slope, intercept = self.free_space.road[i]
        farthest = self.rig.disparity_from_depth(float(self.grid.depths[-1]))
        horizon = (farthest - intercept) / slope if slope > 0 else 0.0
        horizon = int(np.clip(np.ceil(horizon), 0, self.rig.height))
        rows, columns = self.pixels
        base_row, unknown_row = self.free_space.base_row[i], self.free_space.unknown_row[i]
        free = np.isnan(self.obstacle_disparity) | (base_row < 0)
        first = np.where(free, horizon, base_row + 1)[columns]
        for colour, known in ((style.FREE, True), (style.UNKNOWN, False)):
            space = (rows >= first) & ((rows > unknown_row[columns]) == known)
            cv2.copyTo(_tinted(self.grey_image, colour), space.astype(np.uint8), image)
        return image

    @cached_property
    def height_image(self) -> np.ndarray:
        """`free_space_image` with the stixels tinted, (H, W, 3) uint8."""
        image = self.free_space_image.copy()
        stixels = self.stixels
        for i in range(self.rows.start, self.rows.stop):
            rows = slice(stixels.top[i], stixels.base[i] + 1)
            part = image[rows, stixels.left[i] : stixels.right[i]]
            part[...] = _tinted(part, style.OBSTACLE)
        return image

    @cached_property
    def stixels_image(self) -> np.ndarray:
        """The camera's image with the stixels, and the numbered boxes of objects, (H, W, 3) uint8.

        The colour of a stixel is that of its depth.
        """
        colours = style.depth_colours(self.stixels.depth)
        image = painted(self.grey_image, self.stixels, colours, self.rows)
        objects, colour = self.objects, _rgb(style.OBJECT).tolist()
        boxes = [] if objects is None else objects.boxes[objects.rows(self.k - objects.first)]
        places: list[tuple[int, int]] = []
        for number, (left, right, top, base) in enumerate(np.asarray(boxes, dtype=int).tolist()):
            cv2.rectangle(image, (left, top), (right - 1, base), colour)
            place = left, max(top - 3, 8)
            # Of numbers that would overlap, the first.
            if all(abs(left - u) >= 16 or abs(place[1] - v) >= 10 for u, v in places):
                places.append(place)
                cv2.putText(image, str(number), place, *LETTERS, colour, lineType=cv2.LINE_AA)
        return image


def painted(
    image: np.ndarray, stixels: Stixels, colours: np.ndarray, rows: slice = slice(None)
) -> np.ndarray:
    """A picture (H, W, 3) uint8 of an image (H, W) or (H, W, 3) uint8, with stixels over it.

    `colours` (S, 3) of all stixels are from 0 to 1; of the stixels only `rows` are painted.
    """
    picture = image.copy() if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    chosen = np.arange(len(stixels.depth))[rows]
    # From far to near, where several stixels are in one column.
    for row in chosen[np.argsort(-stixels.depth[rows], kind="stable")]:
        area = picture[
            stixels.top[row] : stixels.base[row] + 1, stixels.left[row] : stixels.right[row]
        ]
        area[...] = np.rint(255.0 * OPACITY * colours[row] + (1.0 - OPACITY) * area)
    return picture


def with_depth_scale(image: np.ndarray) -> np.ndarray:
    """An RGB image (H, W, 3) uint8 with the colours of depth below it, and their depths in m."""
    ticks, width = np.log(style.DEPTH_TICKS), image.shape[1]
    strip = np.full((30, width, 3), 255, dtype=np.uint8)
    depths = np.exp(np.linspace(ticks[0], ticks[-1], width))
    strip[:12] = np.rint(255.0 * style.depth_colours(depths))
    for depth, share in zip(style.DEPTH_TICKS, (ticks - ticks[0]) / np.ptp(ticks), strict=True):
        place = (int(share * (width - 45)), 26)
        cv2.putText(strip, f"{depth:g} m", place, *LETTERS, (0, 0, 0), lineType=cv2.LINE_AA)
    return np.vstack([image, strip])


def _rgb(colour: str) -> np.ndarray:
    """A colour as (3,) uint8."""
    return np.rint(255.0 * np.array(to_rgb(colour))).astype(np.uint8)


def _tinted(image: np.ndarray, colour: str) -> np.ndarray:
    """An RGB image (H, W, 3) uint8 blended with a colour."""
    levels = 0.55 * np.arange(256)[:, None] + 0.45 * 255.0 * np.array(to_rgb(colour))
    return cv2.LUT(image, np.rint(levels).astype(np.uint8)[None])


def camera_pictures(
    rendered: RenderedFrames | ImageStack,
    pairs: StereoPairs,
    disparities: Disparities,
    free_space: FreeSpace,
    stixels: Stixels,
    ego_motion: EgoMotion,
    rig: Rig,
    road: RoadParameters,
    occupancy: OccupancyParameters,
    frame: int,
    objects: Objects | None = None,
) -> Pictures:
    """Pictures of frame `frame`; the chunks must contain the frame.

    Gives `k0033/left.png` (in colour; as rendered, without noise), `disparity.png`,
    `occupancy.png`, `free_space.png`, `height.png` and `stixels.png` (over the camera's grey
    image, the colours of depth below it), pixel by pixel, and `camera.png`, all of them on one page
    with titles and legend. Only the times of `ego_motion` are used; `rig`, `road` and `occupancy`
    are those of the grid. With `objects`, their boxes are drawn over the stixels.
    """
    # Of a recording, the stack has the one image.
    single = isinstance(rendered, ImageStack)
    left = rendered[0] if single else rendered.left[frame - rendered.first]
    grid = picture_grid(disparities, free_space, rig, road, occupancy, frame)
    view = FrameView(frame, rig, pairs, disparities, grid, free_space, stixels, objects)
    images = {
        "left": left,
        "disparity": view.disparity_image,
        "occupancy": view.grid_image,
        "free_space": view.free_space_image,
        "height": view.height_image,
        "stixels": view.stixels_image,
    }
    with style.drawing({"axes.spines.top": True, "axes.spines.right": True}):
        page = _page(view, images, style.title("Camera", frame, float(ego_motion.times[frame])))
        files = {"camera": style.png(*page)}
    images["stixels"] = with_depth_scale(images["stixels"])
    files |= {name: encode_png(image) for name, image in images.items()}
    return Pictures({f"k{frame:04d}/{name}.png": data for name, data in files.items()})


def _page(view: FrameView, images: dict[str, np.ndarray], title: str) -> tuple[Figure, list]:
    """All images on one page, as `style.png` takes it; wide ones in two columns, others three."""
    columns, width = (2, 600) if view.rig.width > 2 * view.rig.height else (3, 430)
    height = round(width * view.rig.height / view.rig.width)
    count = -(-len(images) // columns)
    across, down = width + 44, height + 30
    size = (columns * across + 24 + BAR, count * down + 34 + LEGEND + 22)
    figure = style.new_figure(size[0] / style.DPI, size[1] / style.DPI, facecolor="none")
    under = []
    for i, (name, image) in enumerate(images.items()):
        left = 40 + (i % columns) * across
        bottom = LEGEND + 26 + (count - 1 - i // columns) * down
        top = size[1] - bottom - height
        shrinks = width <= image.shape[1] and height <= image.shape[0]
        how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
        under.append((left, top, cv2.resize(image, (width, height), interpolation=how)))
        place = (left / size[0], bottom / size[1], width / size[0], height / size[1])
        if name == "occupancy":
            axes = figure.add_axes(place, facecolor="none")
            _draw_limit(axes, view)
            _label_depths(axes, view.grid.depths)
        else:
            frame = Rectangle(place[:2], *place[2:], fill=False, linewidth=0.7)
            figure.add_artist(frame)
        # As far over the image as Matplotlib's own titles.
        over = 1.0 - (top - 6.0 * style.DPI / 72.0) / size[1]
        figure.text(place[0], over, TITLES[name], fontsize=10.0)
    place = (columns * across + 24, LEGEND + 26, 12, count * down - 30)
    _colour_bar(figure, figure.add_axes([v / size[i % 2] for i, v in enumerate(place)]))
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
    figure.text(40 / size[0], 1.0 - 14 / size[1], title, va="center")
    return figure, under


def _draw_limit(axes: Axes, view: FrameView) -> None:
    """The end of free space over the image of the grid."""
    across, rows = view.free_limit
    columns = np.interp(across, view.grid.laterals, np.arange(len(view.grid.laterals)))
    # Neighbouring columns may be far apart in a Cartesian grid: a line would mean nothing.
    look = {"linestyle": "", "marker": "."} if view.grid.kind == "cartesian" else {}
    axes.plot(columns, len(view.grid.depths) - 1 - rows, color=style.FREE, markersize=2.5, **look)
    axes.set(xlim=(-0.5, len(view.grid.laterals) - 0.5), xticks=[])
    axes.set_ylim(len(view.grid.depths) - 0.5, -0.5)


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


WIDEST, WIDEST_VIEW = 512, 400
"""Greatest widths of the page's images and of what was found in them, px.

Averaging removes the noise, which JPEG cannot.
"""
QUALITY, QUALITY_OF_VIEWS = 60, 30
"""Of their JPEG."""
VIEWS, OF_STIXELS = ("disparity", "grid", "free_space"), ("left", "right", "top", "base", "depth")
"""What was found, images of a `FrameView`; what the page needs of stixels."""


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

    Each chunk contains all of `frames`; `rig`, `road` and `occupancy` are those of the grid.
    """
    images = {name: [] for name in ("grey", *VIEWS)}
    for k in frames:
        grid = picture_grid(disparities, free_space, rig, road, occupancy, k)
        found = (pairs, disparities, grid, free_space, stixels)
        view = FrameView(k, rig, *found, widest=WIDEST_VIEW)
        images["grey"].append(_jpeg(reduced(pairs.left[k - pairs.first], WIDEST), QUALITY))
        for name in VIEWS:
            shown = getattr(view, f"{name}_image")[..., ::-1]
            images[name].append(_jpeg(shown, QUALITY_OF_VIEWS))
    first = frames.start - stixels.first
    offsets = stixels.offsets[first : first + len(frames) + 1]
    rows = slice(offsets[0], offsets[-1])
    return CameraFrames(
        first=frames.start,
        width=rig.width,
        height=rig.height,
        images={name: tuple(files) for name, files in images.items()},
        offsets=(offsets - offsets[0]).astype(np.int64),
        **{name: getattr(stixels, name)[rows] for name in OF_STIXELS},
    )


def _jpeg(image: np.ndarray, quality: int) -> bytes:
    """The file of an image, (H, W) or BGR (H, W, 3) uint8."""
    settings = cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1
    return cv2.imencode(".jpg", image, settings)[1].tobytes()
