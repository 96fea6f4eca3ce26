"""The nearest obstacle of every column of one frame: occupancy grid, then dynamic programming."""

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.stixels.free_space_parameters import (
    CartesianOccupancy,
    FreeSpaceParameters,
    OccupancyParameters,
    RoadParameters,
)
from stixel_cli.stixels.occupancy import BINS_PER_PIXEL, Layout, accumulate, to_polar
from stixel_cli.stixels.path import add_temporal, cell_costs, cheapest_path, refine


def nearest_obstacle(
    columns: np.ndarray,
    line: np.ndarray,
    expected: np.ndarray | None,
    rig: Rig,
    road: RoadParameters,
    grid: Layout,
    occupancy: OccupancyParameters,
    free_space: FreeSpaceParameters,
) -> np.ndarray:
    """Pitch-compensated disparity (W,) float32 px of each column's nearest obstacle; NaN: free.

    Args:
        columns: (W, H) int16 raw disparities, column by column.
        line: (2,) the road's disparity a v + b, px.
        expected: (W,) depths of the last solution in this frame, m, NaN where unknown; or None.
        grid: `layout` of the same rig, occupancy parameters and disparities.
    """
    histogram, values = accumulate(columns, line, rig, road, grid, occupancy)
    if isinstance(occupancy, CartesianOccupancy):
        values = to_polar(values, grid, rig)
    # An obstacle of height h has f h / z = h d / B rows.
    pixels = np.maximum(
        free_space.obstacle_pixels,
        free_space.obstacle_height * grid.disparities / rig.baseline,
    )
    requirement = (pixels * grid.peaks).astype(np.float32)
    costs = cell_costs(
        values,
        np.float32(1.0) / requirement,
        np.float32(free_space.cost_bound),
        np.float32(free_space.free_cost),
    )
    # "No obstacle" is one row behind the grid.
    depths = np.append(grid.depths, 2.0 * grid.depths[-1] - grid.depths[-2]).astype(np.float32)
    if expected is not None and free_space.temporal_cost > 0:
        add_temporal(
            costs,
            depths,
            expected.astype(np.float32),
            np.float32(free_space.temporal_cost),
            np.float32(free_space.temporal_limit),
        )
    path = cheapest_path(
        costs,
        depths,
        np.float32(free_space.spatial_cost),
        np.float32(free_space.spatial_limit),
    )
    return refine(path, histogram, grid.disparities, grid.reaches, BINS_PER_PIXEL)
