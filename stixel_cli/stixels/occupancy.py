"""Occupancy grids, Badino, Franke, Mester 2007: thesis (6)-(8).

Every obstacle pixel (u, v, d) adds its normalised likelihood G to the cells; the value of a cell is
the mean of G over the cell, so that coarse cells miss no pixel. Disparities are
pitch-compensated (`road.pitch_factors`), so depth is depth along the road. Grids are stored column
by column, nearest row first.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from scipy.special import ndtr

from stixel_cli.geometry.kernel import returning
from stixel_cli.geometry.rig import Rig
from stixel_cli.stereo.disparities import SUBPIXELS, Disparities
from stixel_cli.stixels.parameters import OccupancyParameters, RoadParameters
from stixel_cli.stixels.road import obstacle_limits, pitch_factors
from stixel_cli.stixels.types import FreeSpace, OccupancyGrid

BINS_PER_PIXEL = 2
"""Resolution of the columns' histograms of disparities."""

REACH = 4.0
"""Likelihoods are cut off this many standard deviations from the cell."""


@dataclass(frozen=True)
class Layout:
    """Rows of a grid and the likelihoods that fill them."""

    occupancy: OccupancyParameters
    rig: Rig
    """`occupancy`, `rig`: what the grid is made for."""
    depths: np.ndarray
    """(R,) float32 m, ascending."""
    disparities: np.ndarray
    """(R,) float32 px, descending."""
    reaches: np.ndarray
    """(R,) float32 px, a cell's half extent and two standard deviations."""
    likelihoods: np.ndarray
    """(bins, R) float32 1/px, mean of G over the cell for a pixel of the bin."""
    first: np.ndarray
    last: np.ndarray
    """`first`, `last`: (bins,) int32, rows first … last - 1 of a bin are not zero."""
    peaks: np.ndarray
    """(R,) float32 1/px, the most that one pixel can add to a cell."""
    laterals: np.ndarray
    """(C,) float32 m, centres of a Cartesian grid's cells, else empty."""


@lru_cache(maxsize=1)
def layout(occupancy: OccupancyParameters, rig: Rig, count: int) -> Layout:
    """Layout of a grid for a rig and the number of disparities searched; not to be changed."""
    if occupancy.kind == "column_disparity":
        step = occupancy.disparity_step
        near, far = rig.disparity_from_depth(np.array([occupancy.nearest, occupancy.farthest]))
        disparities = far + step * np.arange(int((near - far) / step + 1e-9), -1.0, -1.0)
        upper, lower = disparities + 0.5 * step, np.maximum(disparities - 0.5 * step, 0.0)
    else:
        span = occupancy.farthest - occupancy.nearest
        rows = np.arange(int(span / occupancy.depth_step + 1e-9) + 1)
        depths = occupancy.nearest + occupancy.depth_step * rows
        half = min(0.5 * occupancy.depth_step, 0.5 * occupancy.nearest)
        disparities = rig.disparity_from_depth(depths)
        upper, lower = rig.disparity_from_depth(np.stack([depths - half, depths + half]))
    laterals = np.zeros(0)
    if occupancy.kind == "cartesian":
        cells = int(occupancy.half_width / occupancy.lateral_step)
        laterals = occupancy.lateral_step * np.arange(-cells, cells + 1)
    depths = rig.depth_from_disparity(disparities)
    # Γ at the cell: the matcher's noise, and the obstacle's own surface, which is not upright.
    std = np.hypot(occupancy.disparity_std, occupancy.relief * disparities / depths)
    # Mean of the normal density over the cell, for a pixel in the middle of each bin.
    centres = np.arange(BINS_PER_PIXEL * count + 1)[:, None] / BINS_PER_PIXEL
    above, below = (upper - centres) / std, (lower - centres) / std
    mean = (ndtr(above) - ndtr(below)) / (upper - lower)
    near = (above > -REACH) & (below < REACH)
    likelihoods = np.where(near, mean, 0.0).astype(np.float32)
    filled = likelihoods > 0
    ends = likelihoods.shape[1] - np.argmax(filled[:, ::-1], axis=1)
    # The best that a pixel can do: right in the middle of the cell.
    peaks = (2.0 * ndtr(0.5 * (upper - lower) / std) - 1.0) / (upper - lower)
    return Layout(
        occupancy=occupancy,
        rig=rig,
        depths=depths.astype(np.float32),
        disparities=disparities.astype(np.float32),
        reaches=(0.5 * (upper - lower) + 2.0 * std).astype(np.float32),
        likelihoods=likelihoods,
        first=np.argmax(filled, axis=1).astype(np.int32),
        last=np.where(filled.any(axis=1), ends, 0).astype(np.int32),
        peaks=peaks.astype(np.float32),
        laterals=laterals.astype(np.float32),
    )


def accumulate(
    columns: np.ndarray, line: np.ndarray, road: RoadParameters, grid: Layout
) -> tuple[np.ndarray, np.ndarray]:
    """Histogram (W, bins) uint16 of one frame's obstacle pixels, and its occupancy.

    That is (W, R) float32 (1/px), or (C, R) float32 (1/px²) for a Cartesian grid.
    """
    rig, occupancy, bins = grid.rig, grid.occupancy, len(grid.likelihoods)
    lowest, highest = obstacle_limits(line, rig, road, bins // BINS_PER_PIXEL)
    scale = pitch_factors(line, rig) * np.float32(BINS_PER_PIXEL / SUBPIXELS)
    histogram = column_histograms(columns, lowest, highest, scale, bins)
    polar = fill(histogram, grid.likelihoods, grid.first, grid.last)
    if occupancy.kind != "cartesian":
        return histogram, polar
    widths = rig.focal * occupancy.lateral_step / grid.depths.astype(np.float64)
    starts = rig.u0 - 0.5 * len(grid.laterals) * widths
    cells = len(grid.laterals)
    return histogram, spread_laterally(polar, starts, widths, cells, occupancy.column_std)


def to_polar(cartesian: np.ndarray, grid: Layout) -> np.ndarray:
    """A Cartesian grid (C, R) resampled to the image's columns (W, R) float32, linearly.

    Columns are 1 px apart, so the sum over the columns has the scale of a polar grid.
    """
    rig = grid.rig
    u = np.arange(rig.width, dtype=np.float64) - rig.u0
    step = float(grid.laterals[1] - grid.laterals[0])
    polar = np.zeros((rig.width, len(grid.depths)), dtype=np.float32)
    cells = np.arange(len(grid.laterals), dtype=np.float64)
    for j, depth in enumerate(grid.depths.astype(np.float64)):
        at = (u * depth / rig.focal - float(grid.laterals[0])) / step
        polar[:, j] = np.interp(at, cells, cartesian[:, j], left=0.0, right=0.0)
    return polar


@returning(
    lambda columns, lowest, highest, scale, bins: np.zeros((len(columns), bins), dtype=np.uint16)
)
@njit(cache=True, nogil=True, error_model="numpy")
def column_histograms(histogram, columns, lowest, highest, scale, bins):
    """Histograms (W, bins) uint16 of the obstacle pixels' pitch-compensated disparities.

    `columns` (W, H) int16 raw; a pixel counts if lowest[v] <= raw <= highest[v], in the bin
    round(raw * scale[v]).
    """
    width, height = columns.shape
    top, end = 0, height
    while top < end and lowest[top] > highest[top]:
        top += 1
    while end > top and lowest[end - 1] > highest[end - 1]:
        end -= 1
    half = np.float32(0.5)
    for u in range(width):
        of_column = histogram[u]
        for v in range(top, end):
            raw = np.int32(columns[u, v])
            if lowest[v] <= raw <= highest[v]:
                of_column[min(np.int32(raw * scale[v] + half), bins - 1)] += 1


@returning(lambda votes, likelihoods, *_: np.zeros((len(votes), likelihoods.shape[1]), np.float32))
@njit(cache=True, nogil=True, error_model="numpy")
def fill(values, histogram, likelihoods, first, last):
    """Occupancy (W, R) float32: each column's histogram (W, bins) times likelihoods (bins, R)."""
    width, bins = histogram.shape
    for u in range(width):
        of_column = values[u]
        for b in range(1, bins):
            votes = np.float32(histogram[u, b])
            if votes > 0:
                row = likelihoods[b]
                for j in range(first[b], last[b]):
                    of_column[j] += votes * row[j]


@returning(lambda polar, starts, widths, cells, std: np.zeros((cells, polar.shape[1]), np.float32))
@njit(cache=True, nogil=True, error_model="numpy")
def spread_laterally(values, polar, starts, widths, cells, std):
    """Cartesian occupancy (cells, R) float32 of a polar one (W, R).

    Each column's value is spread by the normal density in u, averaged over the cells. In row j the
    first cell begins at starts[j] and each is widths[j] wide, px; `std` in px.
    """
    width, rows = polar.shape
    root = np.sqrt(0.5) / std
    reach = REACH * std
    for u in range(width):
        for j in range(rows):
            if polar[u, j] <= 0:
                continue
            edge, step = starts[j], widths[j]
            first = max(int(np.floor((u - reach - edge) / step)), 0)
            last = min(int(np.ceil((u + reach - edge) / step)), cells)
            share = 0.5 * polar[u, j] / step
            # Neighbouring cells share an edge, and so its error function.
            before = math.erf((edge + first * step - u) * root)
            for i in range(first, last):
                after = math.erf((edge + (i + 1) * step - u) * root)
                values[i, j] += share * (after - before)
                before = after


def picture_grid(
    disparities: Disparities,
    free_space: FreeSpace,
    rig: Rig,
    road: RoadParameters,
    occupancy: OccupancyParameters,
    frame: int,
) -> OccupancyGrid:
    """The occupancy grid of frame `frame`, with the road line that free space was found with."""
    index = frame - disparities.first
    columns = np.ascontiguousarray(disparities.raw(index).T)
    line = free_space.road[frame - free_space.first]
    grid = layout(occupancy, rig, disparities.count)
    image_columns = np.arange(rig.width, dtype=np.float32)
    _, values = accumulate(columns, line, road, grid)
    return OccupancyGrid(
        kind=occupancy.kind,
        values=np.ascontiguousarray(values.T),
        depths=grid.depths,
        laterals=grid.laterals if occupancy.kind == "cartesian" else image_columns,
    )
