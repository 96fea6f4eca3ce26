"""Free space: how far every column can be driven, and from where on nothing is known of it."""

import cv2
import numpy as np
from numba import njit

from stixel_cli.geometry.pose import ego_from_world, world_from_ego
from stixel_cli.geometry.rig import Rig
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stereo.disparities import SUBPIXELS, Disparities
from stixel_cli.stixels.nearest_obstacle import nearest_obstacle
from stixel_cli.stixels.occupancy import Layout, layout
from stixel_cli.stixels.parameters import FreeSpaceParameters, OccupancyParameters, RoadParameters
from stixel_cli.stixels.road import base_rows, find_road, pitch_and_height, pitch_factors
from stixel_cli.stixels.types import FreeSpace

LEAST_ROWS = 10
"""The share of fewer pixels means nothing."""

GROUND = 2.0
"""Surfaces up to so many `road.least_height` above the road's plane are ground: verges, kerbs; and
those up to one below it."""

EDGE = 8
"""So many columns of a surface without texture get the disparity of the road beside it, px."""


def find_free_space(
    disparities: Disparities,
    ego_motion: EgoMotion,
    rig: Rig,
    road: RoadParameters,
    occupancy: OccupancyParameters,
    free_space: FreeSpaceParameters,
    frames: range,
    previous: FreeSpace | None,
) -> FreeSpace:
    """Free space of `frames`, each with the solution before it moved by the ego motion.

    `previous` is the result for the frames before, whose last frame is read; None at the first.
    """
    grid = layout(occupancy, rig, disparities.count)
    found, before = [], None
    if previous is not None:
        before = previous.disparity[-1], previous.base_row[-1], previous.road[-1]
    for k in frames:
        columns = cv2.transpose(disparities.raw(k - disparities.first))
        beyond_rig = ego_motion.pitches[k], ego_motion.heights[k]
        line = find_road(columns, disparities.count, rig, road, *beyond_rig)
        expected = None
        if before is not None:
            expected = expected_depth(*before, rig, *ego_motion.poses_world[[k - 1, k]])
        obstacle = nearest_obstacle(columns, line, expected, road, grid, free_space)
        base_row = obstacle_base(obstacle, line, rig)
        before = obstacle, base_row, line
        found.append((*before, unknown_rows(columns, base_row, line, road, grid, free_space)))
    kinds = (np.float32, np.int32, np.float64, np.int32)
    arrays = (np.array([one[i] for one in found], dtype=kind) for i, kind in enumerate(kinds))
    widths = (rig.width, rig.width, 2, rig.width)
    return FreeSpace(frames.start, *(a.reshape(-1, w) for a, w in zip(arrays, widths, strict=True)))


def obstacle_base(obstacle: np.ndarray, line: np.ndarray, rig: Rig) -> np.ndarray:
    """Rows (W,) int32 of the feet of pitch-compensated obstacles (W,) px; -1 where free."""
    free = np.isnan(obstacle)
    rows = base_rows(np.where(free, 1.0, obstacle).astype(np.float64), line, rig)
    return np.where(free, -1, np.clip(np.rint(rows), 0, rig.height - 1)).astype(np.int32)


def expected_depth(
    obstacle: np.ndarray,
    base_row: np.ndarray,
    line: np.ndarray,
    rig: Rig,
    ego_before: np.ndarray,
    ego_now: np.ndarray,
) -> np.ndarray:
    """Depths (W,) in m of the last frame's obstacles now; NaN where no obstacle is expected.

    The last frame's solution is as `FreeSpace` has it; the ego car's poses (3,) in the world are
    those of the last frame and of this one.
    """
    # Where the foot is hidden below the image its row is clipped; at that row depth is the same.
    factors = pitch_factors(line, rig).astype(np.float64)
    u = np.flatnonzero(base_row >= 0)
    depth = rig.focal * rig.baseline / obstacle[u].astype(np.float64)
    lateral = (u - rig.u0) * depth * factors[base_row[u]] / rig.focal
    points = np.stack([lateral, depth], axis=1)
    x, y = ego_from_world(world_from_ego(points, ego_before), ego_now).T
    ahead = y > 0.1
    x, y = x[ahead], y[ahead]
    rows = np.clip(np.rint(base_rows(rig.focal * rig.baseline / y, line, rig)), 0, rig.height - 1)
    column = rig.u0 + rig.focal * x / (y * factors[rows.astype(np.int64)])
    expected = np.full(rig.width, np.inf)
    # Columns spread when the car drives on: both neighbours take the point, the nearest counts.
    for neighbour in (np.floor(column), np.ceil(column)):
        inside = (neighbour >= 0) & (neighbour < rig.width)
        np.minimum.at(expected, neighbour[inside].astype(np.int64), y[inside])
    return np.where(np.isfinite(expected), expected, np.nan)


def unknown_rows(
    columns: np.ndarray,
    base_row: np.ndarray,
    line: np.ndarray,
    road: RoadParameters,
    grid: Layout,
    free_space: FreeSpaceParameters,
) -> np.ndarray:
    """Lowest row (W,) int32 above which nothing is known of a column; -1 where all is known.

    Something may stand on the road of a row if, over `free_space.unknown_height` m from there
    upwards, less than `free_space.least_density` of the pixels show the ground. Pixels without a
    disparity do not, and neither do those of something above the road that is no obstacle, because
    too little of it has a disparity, or a wrong one: a dark car that mirrors the street. Rows count
    from the bottom of the image up to the column's obstacle, or to the road at
    `grid.occupancy.farthest` m. `EDGE` columns on either side are unknown from the same row.
    `base_row` (W,) is that of a frame of `FreeSpace`.
    """
    rig = grid.rig
    of_road = line[0] * np.arange(rig.height) + line[1]
    # A height h has f_v h / z = (f_v / f) h d / B rows.
    heights = free_space.unknown_height / rig.baseline * (rig.focal_v / rig.focal) * of_road
    # More than twice the image counts as too few rows to judge, however many more.
    extents = np.clip(np.rint(heights), LEAST_ROWS, 4 * rig.height).astype(np.int32)
    far = of_road < rig.disparity_from_depth(grid.occupancy.farthest)
    end = np.flatnonzero(far)[-1] + 1 if far.any() else 0
    _, height = pitch_and_height(line, rig)
    # As `obstacle_limits`: at height h, (1 - h / H) d is the road's disparity.
    share = road.least_height / height
    lowest = of_road / (1.0 + share) - road.disparity_margin
    highest = of_road / max(1.0 - GROUND * share, 1e-3) + road.disparity_margin
    limits = [
        np.clip(SUBPIXELS * values, 0, np.iinfo(np.int16).max).astype(np.int32)
        for values in (np.floor(lowest), np.ceil(highest))
    ]
    rows = np.full(rig.width, -1, dtype=np.int32)
    before = np.zeros(rig.height + 1, dtype=np.int32)
    density = free_space.least_density
    _find_unknown(rows, before, columns, base_row, extents, end, density, *limits)
    beside = np.pad(rows, EDGE, constant_values=-1)
    lowest_beside = np.lib.stride_tricks.sliding_window_view(beside, 2 * EDGE + 1).max(axis=1)
    return np.where(lowest_beside > base_row, lowest_beside, -1)


@njit(cache=True, nogil=True, error_model="numpy")
def _find_unknown(rows, before, columns, base_row, extents, end, least_density, lowest, highest):
    """Write the lowest row (W,) int32 with too little road in the `extents` (H,) rows up from it.

    A pixel shows the road if its raw disparity is from `lowest` to `highest` (H,). Of those rows,
    the lowest without road. Only rows below `base_row` and from `end` on
    count. Where fewer than `LEAST_ROWS` or half of the rows do, there are too few to judge.
    `before` (H + 1,) is working memory.
    """
    width, height = columns.shape
    for u in range(width):
        first = max(base_row[u] + 1, end)
        for v in range(first, height):
            shown = lowest[v] <= columns[u, v] <= highest[v]
            before[v + 1] = (before[v] if v > first else 0) + shown
        for v in range(height - 1, first - 1, -1):
            start = max(v - extents[v] + 1, first)
            seen = before[v + 1] - (before[start] if start > first else 0)
            looked = v - start + 1
            if looked < LEAST_ROWS or 2 * looked < extents[v] or seen >= least_density * looked:
                continue
            while lowest[v] <= columns[u, v] <= highest[v]:
                v -= 1
            rows[u] = v
            break
