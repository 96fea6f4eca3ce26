"""The nearest obstacle of every column of one frame: occupancy grid, then dynamic programming.

Free space is the cheapest path through the grid, as `occupancy` stores it: thesis (9)-(11). It has
one row for each column; the row after the last means "no obstacle". Depths of rows may be uneven.
"""

import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning
from stixel_cli.stixels.occupancy import BINS_PER_PIXEL, Layout, accumulate, to_polar
from stixel_cli.stixels.parameters import FreeSpaceParameters, RoadParameters


def nearest_obstacle(
    columns: np.ndarray,
    line: np.ndarray,
    expected: np.ndarray | None,
    road: RoadParameters,
    grid: Layout,
    free_space: FreeSpaceParameters,
) -> np.ndarray:
    """Pitch-compensated disparity (W,) float32 px of each column's nearest obstacle; NaN: free.

    `expected` (W,) are depths of the last solution in this frame, m, NaN where unknown; or None.
    `grid` is the `layout` for these disparities; for the others see the package.
    """
    histogram, values = accumulate(columns, line, road, grid)
    if grid.occupancy.kind == "cartesian":
        values = to_polar(values, grid)
    rig = grid.rig
    # An obstacle of height h has f_v h / z = (f_v / f_u) h d / B rows.
    pixels = np.maximum(
        free_space.obstacle_pixels,
        free_space.obstacle_height * grid.disparities / rig.baseline * (rig.focal_v / rig.focal),
    )
    requirement = (pixels * grid.peaks).astype(np.float32)
    bounds = np.float32([free_space.cost_bound, free_space.free_cost])
    costs = cell_costs(values, np.float32(1.0) / requirement, *bounds)
    # "No obstacle" is one row behind the grid.
    depths = np.append(grid.depths, 2.0 * grid.depths[-1] - grid.depths[-2]).astype(np.float32)
    if expected is not None and free_space.temporal_cost > 0:
        temporal = np.float32([free_space.temporal_cost, free_space.temporal_limit])
        add_temporal(costs, depths, expected.astype(np.float32), *temporal)
    spatial = np.float32([free_space.spatial_cost, free_space.spatial_limit])
    path = cheapest_path(costs, depths, *spatial)
    return refine(path, histogram, grid.disparities, grid.reaches, BINS_PER_PIXEL)


@returning(lambda cells, _, bound, __: np.full((len(cells), cells.shape[1] + 1), bound, np.float32))
@njit(cache=True, nogil=True, error_model="numpy")
def cell_costs(costs, occupancy, inverse_requirement, bound, free_cost):
    """Costs (W, R + 1) float32 of the cells: 1 / D, at most `bound`; the last row: `free_cost`.

    D is the occupancy (W, R) times `inverse_requirement` (R,), 1 for the least obstacle. The
    background is subtracted: behind the first maximum of at least 1, and the slope behind it that
    belongs to it, every cell is empty.
    """
    width, rows = occupancy.shape
    least = np.float32(1.0) / np.float32(bound)
    for u in range(width):
        found = False
        before = np.float32(0.0)
        for j in range(rows):
            value = occupancy[u, j] * inverse_requirement[j]
            if found and value > before:
                break
            # The maximum is known when the next value is lower.
            if before >= 1 and value < before:
                found = True
            before = value
            if value > least:
                costs[u, j] = np.float32(1.0) / value
        costs[u, rows] = free_cost


def add_temporal(costs, depths, expected, cost, limit):
    """Add `cost` min(|z_j - z'_u|, `limit`) to costs (W, R + 1); z' (W,) is NaN where unknown."""
    known = ~np.isnan(expected)
    costs[known] += cost * np.minimum(np.abs(depths - expected[known, None]), limit)


@returning(
    lambda costs, *_: (
        np.empty(len(costs), np.int32),
        np.empty(costs.shape, np.float32),
        *np.empty((3, costs.shape[1]), np.float32),
    )
)
@njit(cache=True, nogil=True, error_model="numpy")
def cheapest_path(path, total, slope, below, above, costs, depths, cost, limit):
    """Rows (W,) int32 of least sum of costs[u, j_u] + `cost` min(|z_j - z_l|, `limit`).

    `depths` (R + 1,) ascending. Exact in O(W R): the truncated linear cost of the step is a
    distance transform (Felzenszwalb, Huttenlocher 2012), which is valid for uneven depths as well.
    """
    width, rows = costs.shape
    for j in range(rows):
        slope[j] = cost * depths[j]
    for j in range(rows):
        total[0, j] = costs[0, j]
    for u in range(1, width):
        last, now, of_column = total[u - 1], total[u], costs[u]
        best = last[0]
        from_below = from_above = np.float32(np.inf)
        # Both sweeps at once: two chains of minima keep the processor busier than one.
        for j in range(rows):
            k = rows - 1 - j
            from_below = min(from_below, last[j] - slope[j])
            from_above = min(from_above, last[k] + slope[k])
            below[j] = from_below
            above[k] = from_above
            best = min(best, last[j])
        cap = best + cost * limit
        for j in range(rows):
            step = min(min(below[j] + slope[j], above[j] - slope[j]), cap)
            # Less the best so far: the sum stays small and keeps its digits.
            now[j] = of_column[j] + (step - best)
    for u in range(width - 1, -1, -1):
        row, least = 0, np.float32(np.inf)
        for j in range(rows):
            value = total[u, j]
            if u < width - 1:
                value += np.float32(cost * min(abs(depths[j] - depths[path[u + 1]]), limit))
            if value < least:
                row, least = j, value
        path[u] = row


@returning(lambda path, *_: np.empty(len(path), dtype=np.float32))
@njit(cache=True, nogil=True, error_model="numpy")
def refine(refined, path, histogram, disparities, reach, bins_per_pixel):
    """Disparity (W,) float32 of the obstacles in px, finer than the rows; NaN without an obstacle.

    Mean of the column's histogram (W, bins) within `reach` (R,) px of the row's disparity, or that
    disparity itself where no vote is so near. `path` (W,) with R for "no obstacle".
    """
    width, bins = histogram.shape
    for u in range(width):
        j = path[u]
        if j == len(disparities):
            refined[u] = np.nan
            continue
        centre = disparities[j]
        low = max(int(np.ceil((centre - reach[j]) * bins_per_pixel)), 1)
        high = min(int(np.floor((centre + reach[j]) * bins_per_pixel)), bins - 1)
        votes = moment = 0.0
        for b in range(low, high + 1):
            votes += histogram[u, b]
            moment += histogram[u, b] * b
        refined[u] = moment / (votes * bins_per_pixel) if votes > 0 else centre
