"""One frame of the left camera: its images, the results of its stages, pixel by pixel."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, to_rgb

from stixel_cli.geometry.rig import Rig
from stixel_cli.pictures import style
from stixel_cli.recordings.types import LeftImage
from stixel_cli.rendering.frames import RenderedFrames, StereoPairs
from stixel_cli.stereo.disparities import SUBPIXELS, Disparities
from stixel_cli.stixels.types import FreeSpace, Objects, OccupancyGrid, Stixels

LIKELIHOOD_RANGE = 1000.0
"""Likelihoods below the maximum divided by this are drawn as empty."""

OPACITY = 0.65
"""Of the stixels over an image."""


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

    @cached_property
    def grid_image(self) -> np.ndarray:
        """The occupancy grid, near depths below, and the end of free space, (D, L, 3) uint8."""
        scale = likelihood_scale(self.grid)
        values = np.maximum(self.grid.values, scale.norm.vmin)
        image = scale.to_rgba(values, bytes=True)[..., :3]
        across, rows = self.free_limit
        ends = np.isfinite(rows)
        columns = np.interp(across[ends], self.grid.laterals, np.arange(image.shape[1]))
        places = np.rint([rows[ends], columns]).astype(np.int64)
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
        return table.take(np.maximum(raw, -1) + 1, axis=0)

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
        image = image.copy()
        for colour, known in ((style.FREE, True), (style.UNKNOWN, False)):
            space = (rows >= first) & ((rows > self.free_space.unknown_row[i]) == known)
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
        for number, (left, right, top, base) in enumerate(np.asarray(boxes, dtype=int).tolist()):
            cv2.rectangle(image, (left, top), (right - 1, base), colour)
            place, font = (left, max(top - 3, 8)), cv2.FONT_HERSHEY_SIMPLEX
            cv2.putText(image, str(number), place, font, 0.4, colour, lineType=cv2.LINE_AA)
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


def likelihood_scale(grid: OccupancyGrid) -> ScalarMappable:
    """Colours of the grid's likelihood, logarithmic."""
    greatest = float(grid.values.max(initial=0.0)) or 1.0
    return ScalarMappable(LogNorm(greatest / LIKELIHOOD_RANGE, greatest), colormaps["Greys"])


def _rgb(colour: str) -> np.ndarray:
    """A colour as (3,) uint8."""
    return np.rint(255.0 * np.array(to_rgb(colour))).astype(np.uint8)


def _tinted(image: np.ndarray, colour: str) -> np.ndarray:
    """An RGB image (H, W, 3) uint8 blended with a colour."""
    levels = 0.55 * np.arange(256)[:, None] + 0.45 * 255.0 * np.array(to_rgb(colour))
    return cv2.LUT(image, np.rint(levels).astype(np.uint8)[None])
