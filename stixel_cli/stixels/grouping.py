"""Columns grouped to stixels, and each stixel's disparity: the kernel of the extraction.

Loops stand in for NumPy's sort, argmax and sums, and the caller makes the arrays: Numba would
compile those for seconds.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

BINS_PER_PIXEL = 8
"""Resolution of the stixels' histograms of disparities."""

LEAST_ROWS = 5
"""A front face has at least this many rows."""


class Layer(NamedTuple):
    """Obstacles of a frame's columns."""

    obstacle: np.ndarray
    window: np.ndarray
    """`obstacle`, `window`: (W,) float32 px; the obstacle is NaN in free columns."""
    tops: np.ndarray
    """(W,) int32, first row of the obstacle, whose last row is `base_row`."""
    head: np.ndarray
    foot: np.ndarray
    """`head`, `foot`: (W,) int32, first and last row whose pixels count."""
    base_row: np.ndarray


class Grouping(NamedTuple):
    """How columns are grouped."""

    stixel_width: int
    """Columns of a group."""
    kernel: np.ndarray
    """(2 r + 1,) float64 that the histogram is smoothed with."""
    least_pixels: int
    """Groups with fewer pixels in the window are no stixel."""
    front_rows: float
    """Rows of a front face for each px of its disparity."""
    front_margin: float
    """In px."""


def group_columns(
    columns: np.ndarray, scale: np.ndarray, count: int, layer: Layer, grouping: Grouping
) -> tuple[np.ndarray, np.ndarray]:
    """Areas and disparities of one frame's stixels.

    Areas (S, 4) int64: left, right (exclusive), top, base; values (S, 2) float64: disparity px,
    mean row of the pixels in the window.

    A group of columns is a stixel if at least half of them have an obstacle. The columns of the
    group whose obstacle is within `window` of the median one's, in disparity, make it up: its
    top is the median of theirs. The disparities within the window in their areas, from `head`
    (from the top where these are too few) down to `foot`, make a histogram. It is split: what is
    more than `front_margin` behind the front face (`front_face`) is another surface. The disparity
    is the maximum of the rest. `columns`, `scale` and `count` are as in `Frame`.
    """
    width, height = columns.shape
    groups = (width + grouping.stixel_width - 1) // grouping.stixel_width
    areas = np.empty((groups, 4), dtype=np.int64)
    values = np.empty((groups, 2), dtype=np.float64)
    histogram = np.zeros(BINS_PER_PIXEL * count + 1, dtype=np.int32)
    members = np.empty(grouping.stixel_width, dtype=np.int64)
    memory = histogram, members, np.zeros(height, dtype=np.int64), np.zeros(height)
    # With the type of `obstacle`, one kernel finds the median of both.
    tops = layer.tops.astype(np.float32)
    found = _group_columns(areas, values, memory, columns, scale, layer, tops, grouping)
    return areas[:found], values[:found]


@njit(cache=True, nogil=True, error_model="numpy")
def _group_columns(areas, values, memory, columns, scale, layer, top_values, grouping):
    """Write the result of `group_columns`, and return how many stixels it has.

    `memory`: a histogram (bins,), members (stixel_width,), counts and sums of rows (H,); all zero
    but the members.
    """
    histogram, members, row_count, row_total = memory
    obstacle, window, tops, head, foot, base_row = layer
    stixel_width, kernel, least_pixels, front_rows, front_margin = grouping
    width, found = len(columns), 0
    for left in range(0, width, stixel_width):
        right = min(left + stixel_width, width)
        middle, kept = _members(left, right, obstacle, window, base_row, members)
        if kept == 0:
            continue
        centre, reach = obstacle[middle], window[middle]
        for starts in (head, tops):
            least, most, first, last, rows = _vote(
                columns, members, kept, starts, foot, scale, centre, reach, histogram,
                row_count, row_total,
            )  # fmt: skip
            of_row, sum_of_row = row_count[first : last + 1], row_total[first : last + 1]
            pixels = 0
            for v in range(first, last + 1):
                pixels += row_count[v]
            if pixels >= least_pixels:
                extent = max(LEAST_ROWS, int(front_rows * centre + 0.5))
                front = front_face(of_row, sum_of_row, kept, extent)
                start = max(least, int(np.ceil((front - front_margin) * BINS_PER_PIXEL)))
                votes = 0
                for b in range(start, most + 1):
                    votes += histogram[b]
                # So few pixels are no face: noise, or something small in front of it.
                if 2 * votes < extent * kept:
                    start = least
                peak = histogram_peak(histogram[start : most + 1], kernel)
                areas[found, 0], areas[found, 1] = left, right
                areas[found, 2] = top_values[_median_column(top_values, members, kept)]
                areas[found, 3] = base_row[middle]
                values[found, 0] = (peak + start) / BINS_PER_PIXEL
                values[found, 1] = rows / pixels
                found += 1
            for b in range(least, most + 1):
                histogram[b] = 0
            for v in range(first, last + 1):
                row_count[v] = 0
                row_total[v] = 0.0
            if pixels >= least_pixels:
                break
    return found


@njit(inline="always")
def _members(left, right, obstacle, window, base_row, members):
    """The median column of a group, and how many of its columns are a stixel, or 0.

    Those are written to `members`.
    """
    # Not a literal 0, for whose type Numba would compile `_median_column` once more.
    n = left - left
    for u in range(left, right):
        if base_row[u] >= 0:
            members[n] = u
            n += 1
    if n == 0 or 2 * n < right - left:
        return -1, 0
    middle = _median_column(obstacle, members, n)
    kept = 0
    for i in range(n):
        u = members[i]
        if abs(obstacle[u] - obstacle[middle]) <= window[middle]:
            members[kept] = u
            kept += 1
    return middle, kept


@njit(inline="always")
def _median_column(values, members, n):
    """That of the first `n` columns in `members` whose value is the upper median.

    Of equal values the first column's counts as the least.
    """
    for i in range(n):
        before = 0
        for j in range(n):
            a, b = values[members[j]], values[members[i]]
            if a < b or (a == b and j < i):
                before += 1
        if before == n // 2:
            return members[i]
    return members[0]


@njit(inline="always")
def front_face(count, total, columns, extent):
    """Disparity, px, of the nearest face: the greatest mean over `extent` rows next to each other.

    Only where at least half of the pixels there have a disparity. Without such rows, the mean of
    all: then nothing is known of a relief. `count` and `total` (n,) are number and sum of the
    disparities of each row, `columns` its pixels; of the `extent` at most n rows count.
    """
    extent = min(extent, len(count))
    found, pixels, summed, nearest = False, 0, 0.0, 0.0
    for v in range(len(count)):
        pixels += count[v]
        summed += total[v]
        if v >= extent:
            pixels -= count[v - extent]
            summed -= total[v - extent]
        if v >= extent - 1 and 2 * pixels >= extent * columns and pixels > 0:
            mean = summed / pixels
            if not found or mean > nearest:
                found, nearest = True, mean
    if found:
        return nearest
    pixels, summed = 0, 0.0
    for v in range(len(count)):
        pixels += count[v]
        summed += total[v]
    return summed / max(pixels, 1)


@njit(inline="always")
def _vote(columns, members, n, starts, foot, scale, centre, reach, histogram, count, total):
    """Add up a stixel's disparities: of the first `n` columns in `members`.

    They are added to the empty `histogram` and, row by row, to the empty `count` and `total` (H,).
    The result is the first and the last bin, the first and the last row that are not empty, and the
    sum of the pixels' rows.
    """
    bins = len(histogram)
    least, most, first, last, rows = bins, -1, len(count), -1, 0
    for i in range(n):
        u = members[i]
        for v in range(starts[u], foot[u] + 1):
            raw = columns[u, v]
            if raw < 0:
                continue
            disparity = np.float32(raw) * scale[v]
            if abs(disparity - centre) < reach:
                b = min(int(disparity * BINS_PER_PIXEL + np.float32(0.5)), bins - 1)
                histogram[b] += 1
                count[v] += 1
                total[v] += disparity
                least, most = min(least, b), max(most, b)
                first, last = min(first, v), max(last, v)
                rows += v
    return least, most, first, last, rows


@njit(inline="always")
def histogram_peak(histogram, kernel):
    """Place, in bins, of the maximum of a histogram (n,) smoothed with a kernel (2 r + 1,).

    The parabola through the greatest smoothed bin and its two neighbours gives the fraction.
    """
    reach = len(kernel) // 2
    n = len(histogram)
    best, last = 0, 0.0
    before = peak = after = 0.0
    # One bin beyond what the kernel reaches on either side: both are empty.
    for at in range(1, n + 2 * reach + 2):
        smooth = 0.0
        for b in range(max(at - len(kernel), 0), min(at, n)):
            smooth += histogram[b] * kernel[at - 1 - b]
        if at == best + 1:
            after = smooth
        if smooth > peak:
            best, before, peak = at, last, smooth
        last = smooth
    curvature = before - 2.0 * peak + after
    offset = 0.5 * (before - after) / curvature if curvature < 0 else 0.0
    return best - reach - 1 + offset
