"""Columns grouped to stixels, and each stixel's disparity: the kernel of the extraction.

Loops stand in for NumPy's sort, argmax and slices: Numba would compile those for seconds.
"""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def group_columns(
    columns,
    obstacle,
    window,
    tops,
    foot,
    base_row,
    scale,
    stixel_width,
    bins,
    bins_per_pixel,
    kernel,
    least_pixels,
):
    """Areas and disparities of one frame's stixels.

    A group of columns is a stixel if at least half of them have an obstacle. The columns of the
    group whose obstacle is within `window` of the median one's, in disparity, make it up: its
    top is the median of theirs, its disparity the maximum of the histogram of the disparities
    within the window in their areas, from the top down to `foot`.

    Args:
        columns: (W, H) int16 raw disparities; pitch-compensated disparity is raw * scale[v] px.
        obstacle, window: (W,) float32 px; obstacle is NaN in free columns.
        tops, base_row: (W,) int32 rows of the obstacle, both inclusive.
        foot: (W,) int32 lowest row whose pixels count, inclusive.
        scale: (H,) float32.
        stixel_width: columns of a group.
        bins, bins_per_pixel: of the histogram.
        kernel: (2 r + 1,) float64 that the histogram is smoothed with.
        least_pixels: groups with fewer pixels in the histogram are no stixel.

    Returns:
        areas (S, 4) int64: left, right (exclusive), top, base; values (S, 4) float64: disparity
        px, variance of one pixel's disparity round it px², number of pixels, their mean row.
    """
    width = columns.shape[0]
    groups = (width + stixel_width - 1) // stixel_width
    areas = np.empty((groups, 4), dtype=np.int64)
    values = np.empty((groups, 4), dtype=np.float64)
    histogram = np.zeros(bins, dtype=np.int32)
    members = np.empty(stixel_width, dtype=np.int64)
    found = 0
    for left in range(0, width, stixel_width):
        right = min(left + stixel_width, width)
        middle, kept = _members(left, right, obstacle, window, base_row, members)
        if kept == 0:
            continue
        centre, reach = obstacle[middle], window[middle]
        least, most, pixels, rows = _vote(
            columns, members, kept, tops, foot, scale, centre, reach, bins_per_pixel, histogram
        )
        if pixels >= least_pixels:
            peak = histogram_peak(histogram[least : most + 1], kernel)
            spread = _spread(histogram, least, most, peak, len(kernel) // 2)
            areas[found, 0], areas[found, 1] = left, right
            areas[found, 2] = tops[_median_column(tops, members, kept)]
            areas[found, 3] = base_row[middle]
            values[found, 0] = (peak + least) / bins_per_pixel
            values[found, 1] = spread / bins_per_pixel**2
            values[found, 2], values[found, 3] = pixels, rows / pixels
            found += 1
        for b in range(least, most + 1):
            histogram[b] = 0
    return areas[:found], values[:found]


@njit(cache=True, nogil=True)
def _members(left, right, obstacle, window, base_row, members):
    """The median column of a group, and how many of its columns are a stixel, or 0.

    Those are written to `members`.
    """
    n = 0
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


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def _vote(columns, members, n, tops, foot, scale, centre, reach, bins_per_pixel, histogram):
    """Add a stixel's disparities to the empty `histogram`: of the first `n` columns in `members`.

    Returns:
        The first and the last bin that is not empty, the number of pixels, the sum of their rows.
    """
    bins = len(histogram)
    least, most, pixels, rows = bins, -1, 0, 0
    for i in range(n):
        u = members[i]
        for v in range(tops[u], foot[u] + 1):
            raw = columns[u, v]
            if raw < 0:
                continue
            disparity = np.float32(raw) * scale[v]
            if abs(disparity - centre) < reach:
                b = min(int(disparity * bins_per_pixel + np.float32(0.5)), bins - 1)
                histogram[b] += 1
                least, most = min(least, b), max(most, b)
                pixels += 1
                rows += v
    return least, most, pixels, rows


@njit(cache=True, nogil=True)
def _spread(histogram, least, most, peak, reach):
    """Variance, bins², about `peak`, counted from `least`, of the votes within `reach` of it."""
    low = max(least, int(peak + least - reach))
    high = min(most, int(peak + least + reach))
    votes = spread = 0.0
    for b in range(low, high + 1):
        votes += histogram[b]
        away = b - peak - least
        spread += histogram[b] * (away * away)
    return spread / max(votes, 1.0)


@njit(cache=True, nogil=True)
def histogram_peak(histogram, kernel):
    """Place, in bins, of the maximum of a histogram (n,) smoothed with a kernel (2 r + 1,).

    The parabola through the greatest smoothed bin and its two neighbours gives the fraction.
    """
    reach = len(kernel) // 2
    n = len(histogram)
    smooth = np.zeros(n + 2 * reach + 2)
    for b in range(n):
        if histogram[b] > 0:
            for i in range(len(kernel)):
                smooth[b + i + 1] += histogram[b] * kernel[i]
    best = 0
    for b in range(len(smooth)):
        if smooth[b] > smooth[best]:
            best = b
    before, peak, after = smooth[best - 1], smooth[best], smooth[best + 1]
    curvature = before - 2.0 * peak + after
    offset = 0.5 * (before - after) / curvature if curvature < 0 else 0.0
    return best - reach - 1 + offset
