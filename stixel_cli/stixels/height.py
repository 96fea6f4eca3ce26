"""Height segmentation: where each column's obstacle ends upwards, thesis (12)-(15).

After Badino, Franke, Pfeiffer 2009, *The Stixel World*.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning
from stixel_cli.geometry.rig import Rig
from stixel_cli.stereo.disparities import SUBPIXELS
from stixel_cli.stixels.parameters import HeightParameters
from stixel_cli.stixels.road import pitch_factors


@dataclass(frozen=True)
class Frame:
    """One frame's disparities, and the road and the nearest obstacles in them; see the package."""

    columns: np.ndarray
    count: int
    obstacle: np.ndarray
    base_row: np.ndarray
    """`obstacle`, `base_row`: (W,) of a frame of `FreeSpace`."""
    line: np.ndarray
    rig: Rig

    @cached_property
    def scale(self) -> np.ndarray:
        """(H,) float32: the pitch-compensated disparity of a pixel is raw * scale[v] px."""
        return pitch_factors(self.line, self.rig) / np.float32(SUBPIXELS)


def depth_windows(obstacle: np.ndarray, rig: Rig, depth_margin: float) -> np.ndarray:
    """Window ΔD (W,) float32 px of pitch-compensated disparities, d - f_d(z + `depth_margin`)."""
    focal_baseline = rig.focal * rig.baseline
    obstacle = obstacle.astype(np.float64)
    behind = focal_baseline / (focal_baseline / obstacle + depth_margin)
    return (obstacle - behind).astype(np.float32)


def top_rows(frame: Frame, height: HeightParameters) -> np.ndarray:
    """Topmost row (W,) int32 of each column's obstacle, -1 where the column is free."""
    obstacle, base_row, rig = frame.obstacle, frame.base_row, frame.rig
    window = depth_windows(obstacle, rig, height.depth_margin)
    cost = membership_costs(frame.columns, obstacle, window, base_row, frame.scale)
    depth = (rig.focal * rig.baseline / obstacle).astype(np.float32)
    tied = height.smoothness * np.maximum(0.0, 1.0 - np.abs(np.diff(depth)) / height.depth_scale)
    # Columns next to a free column are not tied.
    return cheapest_tops(cost, base_row, np.nan_to_num(tied).astype(np.float32))


@njit(inline="always")
def _power_of_two(y):
    """2 ** y, float32, for -16 <= y <= 1 with an error below 3e-6.

    e ** (y ln 2 / 16) by its series, squared four times: it has no branch and no table, so the
    loop over a column runs in the processor's vector unit.
    """
    x = y * np.float32(0.6931471805599453 / 16.0)
    p = np.float32(1.0 / 120.0)
    p = p * x + np.float32(1.0 / 24.0)
    p = p * x + np.float32(1.0 / 6.0)
    p = p * x + np.float32(0.5)
    p = p * x + np.float32(1.0)
    p = p * x + np.float32(1.0)
    p = p * p
    p = p * p
    p = p * p
    return p * p


@returning(lambda raw, *_: (np.empty(raw.shape, np.float32), np.empty(raw.shape[1], np.float32)))
@njit(cache=True, nogil=True, error_model="numpy")
def membership_costs(cost, membership, columns, obstacle, window, base_row, scale):
    """Costs (W, H) float32 of a top in row v: C(u, v) of thesis (14), in rows 0 … base_row.

    Membership is 2 ** (1 - ((d - obstacle[u]) / window[u]) ** 2) - 1, d = raw * scale[v], and zero
    where there is no disparity. Other rows and free columns (base_row < 0) are not written.
    """
    width = len(columns)
    one = np.float32(1.0)
    for u in range(width):
        rows = base_row[u] + 1
        if rows <= 0:
            continue
        centre, inverse = obstacle[u], one / window[u]
        column, of_column = columns[u], cost[u]
        for v in range(rows):
            x = (np.float32(column[v]) * scale[v] - centre) * inverse
            # Below 2 ** -16 a membership is -1 to all of single precision's use here.
            y = max(one - x * x, np.float32(-16.0))
            value = _power_of_two(y) - one
            membership[v] = value if column[v] >= 0 else np.float32(0.0)
        above = np.float32(0.0)
        for v in range(rows):
            of_column[v] = above
            above += membership[v]
        # Σ above - Σ below = 2 Σ above - Σ all.
        for v in range(rows):
            of_column[v] = np.float32(2.0) * of_column[v] - above


@returning(
    lambda cost, *_: (np.empty(len(cost), np.int32), *np.empty((2, cost.shape[1]), np.float32))
)
@njit(cache=True, nogil=True, error_model="numpy")
def cheapest_tops(tops, below, above, cost, base_row, tied):
    """Rows (W,) int32 of least sum of cost[u, v_u] + tied[u] |v_u - v_{u + 1}|.

    v_u is in 0 … base_row[u]; free columns (base_row < 0) get -1 and end the chain. Exact in
    O(pixels) by the distance transform of a linear cost. Overwrites `cost` (W, H) float32.
    """
    width = len(cost)
    for u in range(1, width):
        rows, rows_before = base_row[u] + 1, base_row[u - 1] + 1
        if rows <= 0 or rows_before <= 0:
            continue
        last, now, slope = cost[u - 1], cost[u], tied[u - 1]
        both = max(rows, rows_before)
        for v in range(rows_before, both):
            last[v] = np.inf
        best = from_below = from_above = np.float32(np.inf)
        # Both sweeps at once: two chains of minima keep the processor busier than one.
        for v in range(both):
            k = both - 1 - v
            from_below = min(from_below, last[v] - slope * np.float32(v))
            from_above = min(from_above, last[k] + slope * np.float32(k))
            below[v] = from_below
            above[k] = from_above
            best = min(best, last[v])
        for v in range(rows):
            shift = slope * np.float32(v)
            # Less the best so far: the sum stays small and keeps its digits.
            now[v] += min(below[v] + shift, above[v] - shift) - best
    after = -1
    for u in range(width - 1, -1, -1):
        slope = tied[u] if after >= 0 else np.float32(0.0)
        top, least = min(base_row[u], 0), np.float32(np.inf)
        for v in range(base_row[u] + 1):
            value = cost[u, v] + slope * np.float32(abs(v - after))
            if value < least:
                top, least = v, value
        tops[u] = after = top
