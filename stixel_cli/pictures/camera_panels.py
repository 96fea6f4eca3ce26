"""Panels of the left camera: images, disparity, occupancy grid, free space, stixels.

Every panel takes the axes and a `FrameView`; pixels are at whole (u, v), v down.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist, allow_rasterization
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap, LogNorm, to_rgb
from matplotlib.patches import Rectangle

from stixel_cli.geometry.rig import Rig
from stixel_cli.pictures import style
from stixel_cli.recordings.types import LeftImage
from stixel_cli.rendering.frames import RenderedFrames, StereoPairs
from stixel_cli.stereo.disparities import SUBPIXELS, Disparities
from stixel_cli.stixels.types import FreeSpace, Objects, OccupancyGrid, Stixels

LIKELIHOOD_RANGE = 1000.0
"""Likelihoods below the maximum divided by this are drawn as empty."""

GRID_DEPTHS = (10, 20, 50, 100, 5, 2, 30, 200, 1, 40, 60, 80, 3, 15, 4, 7)
"""Depths of an axis' ticks in m, the most important first."""


@dataclass(frozen=True)
class FrameView:
    """Frame k and the results of its stages; each is a chunk that contains the frame.

    Attributes:
        k: index of the frame.
        time: s.
        rig: the stereo rig.
        rendered: has the left view without noise.
        pairs: the camera's images.
        disparities, grid, free_space, stixels: of these stages.
        objects: clusters of the stixels; None without.
    """

    k: int
    time: float
    rig: Rig
    rendered: RenderedFrames | LeftImage
    pairs: StereoPairs
    disparities: Disparities
    grid: OccupancyGrid
    free_space: FreeSpace
    stixels: Stixels
    objects: Objects | None

    @property
    def rows(self) -> slice:
        """The rows of the frame's stixels."""
        return self.stixels.rows(self.k - self.stixels.first)

    @property
    def obstacle_disparity(self) -> np.ndarray:
        """(W,) px, NaN where the column is free."""
        return self.free_space.disparity[self.k - self.free_space.first]

    @property
    def horizon_row(self) -> int:
        """The first image row of the road in the grid."""
        slope, intercept = self.free_space.road[self.k - self.free_space.first]
        farthest = self.rig.disparity_from_depth(float(self.grid.depths[-1]))
        horizon = (farthest - intercept) / slope if slope > 0 else 0.0
        return int(np.clip(np.ceil(horizon), 0, self.rig.height))

    @property
    def left_image(self) -> np.ndarray:
        """The left view as it is rendered, before the sensor's noise, (H, W, 3) uint8."""
        return self.rendered.left[self.k - self.rendered.first]

    @cached_property
    def grey_image(self) -> np.ndarray:
        """The camera's image, (H, W, 3) uint8."""
        return np.repeat(self.pairs.left[self.k - self.pairs.first][..., None], 3, axis=2)

    @property
    def free_limit(self) -> tuple[np.ndarray, np.ndarray]:
        """Place along `grid.laterals` and row of the grid where free space ends, (W,) each."""
        depth = self.rig.depth_from_disparity(self.obstacle_disparity.astype(np.float64))
        rows = np.interp(depth, self.grid.depths, np.arange(len(self.grid.depths)))
        across = np.arange(len(depth), dtype=np.float64)
        if self.grid.kind == "cartesian":
            across = (across - self.rig.u0) * depth / self.rig.focal
        return across, np.where(np.isfinite(depth), rows, np.nan)

    @property
    def grid_image(self) -> np.ndarray:
        """The occupancy grid, near depths below, and the end of free space, (D, L, 3) uint8."""
        image, (across, rows) = grid_colours(self.grid), self.free_limit
        ends = np.isfinite(rows)
        columns = np.interp(across[ends], self.grid.laterals, np.arange(image.shape[1]))
        places = np.rint([rows[ends], columns]).astype(np.int64)
        green = 255.0 * np.array(to_rgb(style.FREE))
        for up in range(3):  # three rows, to be seen in a small image
            image[np.maximum(places[0] - up, 0), places[1]] = green
        return image[::-1]

    # Each of these is drawn twice: as a picture, and on the page of all.

    @cached_property
    def disparity_image(self) -> np.ndarray:
        """Disparity in the colour of the depth that it means, grey where none, (H, W, 3) uint8."""
        raw = self.disparities.raw(self.k - self.disparities.first)
        highest = int(raw.max(initial=0))
        with np.errstate(divide="ignore"):
            depth = self.rig.depth_from_disparity(np.arange(highest + 1) / SUBPIXELS)
        table = np.concatenate([[to_rgb(style.INVALID)], style.depth_colours(depth)])
        table = np.rint(255.0 * table).astype(np.uint8)
        return table[np.maximum(raw, -1) + 1]

    @cached_property
    def free_space_image(self) -> np.ndarray:
        """The camera's image with free and unknown space tinted, (H, W, 3) uint8.

        Each column is tinted from its obstacle's base, or the horizon, down: in the colour of free
        space, but above the unknown row in that of the unknown.
        """
        image, i = self.grey_image, self.k - self.free_space.first
        base_row = self.free_space.base_row[i]
        free = np.isnan(self.obstacle_disparity) | (base_row < 0)
        first = np.where(free, self.horizon_row, base_row + 1)
        rows = np.arange(len(image))[:, None]
        known = (rows > self.free_space.unknown_row[i])[..., None]
        tinted = np.where(known, _tinted(image, style.FREE), _tinted(image, style.UNKNOWN))
        return np.where((rows >= first[None, :])[..., None], tinted, image)

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


def image(name: str) -> Callable[[Axes, FrameView], None]:
    """A function that draws one of the images of a view: `height` is its `height_image`."""
    return lambda axes, view: _draw_image(axes, getattr(view, f"{name}_image"))


def draw_occupancy(axes: Axes, view: FrameView) -> None:
    """Occupancy grid over column and depth, and the free space found in it."""
    grid, laterals = view.grid, view.grid.laterals
    half = 0.5 * (laterals[1] - laterals[0])
    axes.imshow(
        grid_colours(grid),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        extent=(laterals[0] - half, laterals[-1] + half, -0.5, len(grid.depths) - 0.5),
    )
    if grid.kind == "cartesian":
        # Neighbouring columns may be far apart here: a line between them would mean nothing.
        axes.plot(*view.free_limit, ".", color=style.FREE, markersize=2.5)
    else:
        axes.plot(*view.free_limit, color=style.FREE, linewidth=1.8)
    _label_depths(axes, grid.depths)


def draw_stixels(axes: Axes, view: FrameView) -> None:
    """Stixels, coloured by their depth, and the boxes of the objects, over the camera's image."""
    _draw_image(axes, view.grey_image)
    stixels, rows = view.stixels, view.rows
    left, right = stixels.left[rows] - 0.5, stixels.right[rows] - 0.5
    top, base = stixels.top[rows] - 0.5, stixels.base[rows] + 0.5
    corners = np.stack([left, top, right, top, right, base, left, base], axis=1)
    colours = style.depth_colours(stixels.depth[rows])
    boxes = PolyCollection(
        corners.reshape(-1, 4, 2),
        facecolors=np.concatenate([colours, np.full((len(colours), 1), 0.65)], axis=1),
        edgecolors=0.75 * colours,
        linewidths=0.5,
    )
    axes.add_collection(boxes, autolim=False)
    objects = view.objects
    boxes = [] if objects is None else objects.boxes[objects.rows(view.k - objects.first)]
    for number, (left, right, top, base) in enumerate(boxes):
        place, outline = (left - 0.5, top - 0.5), {"edgecolor": style.OBJECT, "linewidth": 1.2}
        axes.add_patch(Rectangle(place, right - left, base + 1 - top, fill=False, **outline))
        axes.text(*place, str(number), color=style.OBJECT, size=7, va="bottom", clip_on=True)


def grid_colours(grid: OccupancyGrid) -> np.ndarray:
    """The grid's likelihoods as colours (D, L, 3) uint8."""
    scale = likelihood_scale(grid)
    return scale.to_rgba(np.maximum(grid.values, scale.norm.vmin), bytes=True)[..., :3]


def likelihood_scale(grid: OccupancyGrid) -> ScalarMappable:
    """Colours of the grid's likelihood, logarithmic."""
    greatest = float(grid.values.max(initial=0.0)) or 1.0
    return ScalarMappable(LogNorm(greatest / LIKELIHOOD_RANGE, greatest), colormaps["Greys"])


def depth_scale() -> ScalarMappable:
    """Colours of depth in m, near at the top of a colour bar whose axis is turned round."""
    near, far = style.DEPTH_TICKS[0], style.DEPTH_TICKS[-1]
    colours = ListedColormap(style.depth_colours(np.geomspace(near, far, 256)))
    return ScalarMappable(LogNorm(near, far), colours)


class _Pixels(Artist):
    """An image (H, W, 3) uint8 that fills axes of H × W pixels.

    Matplotlib's own image would resample it in double precision, to the same bytes, and take half
    of the picture's time.
    """

    def __init__(self, axes: Axes, image: np.ndarray):
        super().__init__()
        opaque = np.full((*image.shape[:2], 4), 255, dtype=np.uint8)
        opaque[..., :3] = image
        # The canvas takes the lowest row first.
        self._pixels = np.ascontiguousarray(opaque[::-1])
        axes.add_artist(self)

    @allow_rasterization
    def draw(self, renderer: Any) -> None:
        """Copy the pixels."""
        context = renderer.new_gc()
        self._set_gc_clip(context)
        left, bottom = self.axes.bbox.min
        renderer.draw_image(context, round(left), round(bottom), self._pixels)
        context.restore()


def _draw_image(axes: Axes, image: np.ndarray) -> None:
    height, width = image.shape[:2]
    if np.allclose(axes.bbox.size, (width, height), rtol=0.0, atol=1e-6):
        axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
        _Pixels(axes, image)
    else:
        axes.imshow(image, interpolation="antialiased", aspect="auto")


def _tinted(image: np.ndarray, colour: str) -> np.ndarray:
    """An RGB image (H, W, 3) uint8 blended with a colour."""
    levels = 0.55 * np.arange(256)[:, None] + 0.45 * 255.0 * np.array(to_rgb(colour))
    table = np.rint(levels).astype(np.uint8)
    return np.stack([table[image[..., channel], channel] for channel in range(3)], axis=-1)


def _label_depths(axes: Axes, depth: np.ndarray) -> None:
    """Ticks at round depths, as many as have room; rows need not be even in depth."""
    rows = np.arange(len(depth))
    ticks: dict[int, float] = {}
    for value in (d for d in GRID_DEPTHS if depth[0] <= d <= depth[-1]):
        row = float(np.interp(value, depth, rows))
        if all(abs(row - other) >= 0.07 * len(depth) for other in ticks.values()):
            ticks[value] = row
    axes.set_yticks(list(ticks.values()), [str(value) for value in ticks])
