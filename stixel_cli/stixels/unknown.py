"""Columns with unknown space: the road has no disparities where it should be visible."""

import numpy as np
from numba import njit

from stixel_cli.stereo.disparities import SUBPIXELS
from stixel_cli.stixels.occupancy import Layout
from stixel_cli.stixels.parameters import FreeSpaceParameters, RoadParameters
from stixel_cli.stixels.road import pitch_and_height

LEAST_ROWS = 10
"""The share of fewer pixels means nothing."""

GROUND = 2.0
"""Surfaces within this many `road.least_height` of the road's plane are ground: verges, kerbs."""


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
    `grid.occupancy.farthest` m.

    Args:
        columns: (W, H) int16 raw disparities, column by column.
        base_row: (W,) a frame of `FreeSpace`.
        line: (2,) the road's disparity a v + b, px.
    """
    rig = grid.rig
    of_road = line[0] * np.arange(rig.height) + line[1]
    # A height h has f_v h / z = (f_v / f) h d / B rows.
    heights = free_space.unknown_height / rig.baseline * (rig.focal_v / rig.focal) * of_road
    extents = np.maximum(np.rint(heights), LEAST_ROWS).astype(np.int32)
    far = of_road < rig.disparity_from_depth(grid.occupancy.farthest)
    end = np.flatnonzero(far)[-1] + 1 if far.any() else 0
    _, height = pitch_and_height(line, rig)
    # As `obstacle_limits`: at height h, (1 - h / H) d is the road's disparity.
    share = GROUND * road.least_height / height
    lowest = of_road / (1.0 + share) - road.disparity_margin
    highest = of_road / max(1.0 - share, 1e-3) + road.disparity_margin
    limits = [
        np.clip(SUBPIXELS * values, 0, np.iinfo(np.int16).max).astype(np.int32)
        for values in (np.floor(lowest), np.ceil(highest))
    ]
    rows = np.full(rig.width, -1, dtype=np.int32)
    before = np.zeros(rig.height + 1, dtype=np.int32)
    density = free_space.least_density
    _find_unknown(rows, before, columns, base_row, extents, end, density, *limits)
    return rows


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
            before[v + 1] = (before[v] if v > first else 0) + (
                lowest[v] <= columns[u, v] <= highest[v]
            )
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
