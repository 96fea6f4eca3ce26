"""Objects behind the nearest obstacle: more than one layer of stixels.

After Pfeiffer, Franke 2011, *Towards a Global Optimal Multi-Layer Stixel Representation of Dense 3D
Data*, and Cordts et al. 2017, *The Stixel World: A medium-level representation of traffic scenes*:
a dynamic programme for each group of columns cuts its rows into the road, objects with a disparity
each, and all else (the sky, and surfaces that are not upright), from the obstacle's foot upwards.
Here an object's disparity is one of the maxima of the group's histogram, so the programme is linear
in the rows.
"""

import numpy as np
from numba import njit

from stixel_cli.stixels.height import Frame, depth_windows
from stixel_cli.stixels.road import pitch_and_height, pitch_factors

BEHIND = 2
"""Greatest number of layers behind the nearest one."""

LABELS = 12
"""Greatest number of disparities that a group's objects can have, the nearest first."""

GREATEST_HEIGHT = 3.0
"""Rows higher above the foot of the nearest obstacle, m at its depth, are not looked at."""

REACH = 1.0
"""A row costs 1 if its disparity is this far from that of its segment or farther, px."""

OTHER = 0.5
"""Cost of a row that is neither road nor object."""

CHANGE = 1.0
"""Cost of another segment: two rows alone are a matcher's error."""

ORDER = 3.0
"""Added if an object is above one that is farther: it hangs over."""

FLOATING = 2.0
"""Added if an object begins above rows of a road that is not as far as the object."""

LEAST_VOTES = 10
"""Fewer pixels within half a pixel of each other are no object."""

BINS_PER_PIXEL = 2
"""Resolution of the histograms of disparities."""


def layers_behind(
    frame: Frame, stixel_width: int, depth_margin: float, least_height: float
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """For each layer behind the nearest obstacles: disparity, top and base row of each column.

    They are (W,) float32 px, NaN without such an object, and int32 rows, both inclusive, base -1
    without. The `stixel_width` columns of a group have the same layers. `depth_margin`, m, is the
    least difference in depth of two layers, `least_height`, m, that of an object above the road.
    """
    rig, line, (width, height) = frame.rig, frame.line, frame.columns.shape
    found = np.full((BEHIND, width), np.nan, dtype=np.float32)
    tops, bases = np.full((2, BEHIND, width), -1, dtype=np.int32)
    _, camera_height = pitch_and_height(line, rig)
    of_road = (line[0] * np.arange(height) + line[1]) * pitch_factors(line, rig)
    # A pixel of disparity d is H (1 - road / d) above the road.
    lowest = np.maximum(of_road / (1.0 - least_height / camera_height), 0.0)
    # A height h has f_v h / z = (f_v / f) h d / B rows.
    extent = GREATEST_HEIGHT / rig.baseline * (rig.focal_v / rig.focal)
    _find_layers(
        found, tops, bases, np.zeros(BINS_PER_PIXEL * frame.count + 2, dtype=np.int32),
        np.empty(LABELS + 1, dtype=np.float32), *np.empty((2, LABELS + 3), dtype=np.float32),
        np.empty((height, LABELS + 3), dtype=np.uint8), frame.columns, frame.obstacle,
        frame.base_row, depth_windows(frame.obstacle, rig, depth_margin),
        of_road.astype(np.float32), lowest.astype(np.float32), frame.scale, stixel_width, extent,
        rig.focal * rig.baseline, depth_margin,
    )  # fmt: skip
    return list(zip(found, tops, bases, strict=True))


@njit(cache=True, nogil=True, error_model="numpy")
def _find_layers(
    found, tops, bases, histogram, labels, total, now, below, columns, obstacle, base_row, window,
    of_road, lowest, scale, stixel_width, extent, focal_baseline, depth_margin,
):  # fmt: skip
    """Write `layers_behind`; `histogram` is zero, `labels` to `below` are working memory."""
    width = len(columns)
    for left in range(0, width, stixel_width):
        right = min(left + stixel_width, width)
        nearest = -1
        for u in range(left, right):
            if base_row[u] >= 0 and (nearest < 0 or obstacle[u] > obstacle[nearest]):
                nearest = u
        if nearest < 0:
            continue
        labels[0], foot = obstacle[nearest], base_row[nearest]
        start = max(0, foot - int(extent * labels[0]))
        greatest = labels[0] - window[nearest]
        n = _labels(labels, histogram, columns, left, right, start, foot, greatest, lowest, scale)
        if n == 1:
            continue
        state = _states(
            total, now, below, columns, left, right, start, foot, labels, n, of_road, scale
        )
        # From the top row down. Each row's state replaces what is not needed any more.
        for v in range(start, foot + 1):
            following = below[v, state]
            below[v, 0] = state
            state = following
        layer, v = 0, foot
        while v >= start and layer < len(found):
            state, base = below[v, 0], v
            while v >= start and below[v, 0] == state:
                v -= 1
            if 0 < state < n and labels[state] < greatest:
                found[layer, left:right] = labels[state]
                tops[layer, left:right] = v + 1
                bases[layer, left:right] = base
                layer += 1
                greatest = focal_baseline / (focal_baseline / labels[state] + depth_margin)


@njit(inline="always")
def _labels(labels, histogram, columns, left, right, start, foot, greatest, lowest, scale):
    """Write the disparities of objects behind that of labels[0], nearest first; how many are all.

    They are the maxima of the histogram of what is above the road (`lowest`, (H,) px) and farther
    than `greatest` px.
    """
    last = 0
    for u in range(left, right):
        for v in range(start, foot + 1):
            raw = columns[u, v]
            if raw > 0:
                d = np.float32(raw) * scale[v]
                if lowest[v] < d < greatest:
                    b = min(int(BINS_PER_PIXEL * d + np.float32(0.5)), len(histogram) - 2)
                    histogram[b] += 1
                    last = max(last, b)
    n, taken = 1, last + 2
    for b in range(last, 1, -1):
        if n == len(labels):
            break
        votes = histogram[b - 1] + histogram[b] + histogram[b + 1]
        if votes < LEAST_VOTES or b > taken - 2:
            continue
        # A maximum: the next bin, farther, does not have more.
        if histogram[b - 2] + histogram[b - 1] + histogram[b] > votes:
            continue
        mean = b + (histogram[b + 1] - histogram[b - 1]) / votes
        labels[n] = mean / BINS_PER_PIXEL
        n, taken = n + 1, b
    for b in range(last + 1):
        histogram[b] = 0
    return n


@njit(inline="always")
def _states(total, now, below, columns, left, right, start, foot, labels, n, of_road, scale):
    """Run the programme from row `foot` up to `start`; the cheapest state of that row.

    States: 0 … n - 1 the objects of `labels`, n the road, n + 1 all else. below[v, s] is the state
    of row v + 1 if that of row v is s. It begins with the nearest object.
    """
    middle, road, other = (left + right) // 2, n, n + 1
    change, reach = np.float32(CHANGE), np.float32(REACH)
    total[:] = np.inf
    total[0] = 0.0
    cheapest = 0
    for v in range(foot, start - 1, -1):
        a, b, c = columns[left, v], columns[middle, v], columns[right - 1, v]
        raw = max(min(a, b), min(max(a, b), c))
        weight = np.float32(1.0) if raw > 0 else np.float32(0.0)
        d = np.float32(raw) * scale[v]
        broken = total[cheapest] + np.float32(CHANGE + ORDER)
        # The cheapest of the states below that an object may follow: nearer ones, road, all else.
        before = road if total[road] < total[other] else other
        onto_road, at_road = total[road], road
        for s in range(n):
            cost, state = total[before] + change, before
            if before == road and abs(labels[s] - of_road[v]) > np.float32(2.0) * reach:
                cost += np.float32(FLOATING)
            if broken < cost:
                cost, state = broken, cheapest
            if total[s] <= cost:
                cost, state = total[s], s
            if total[s] < total[before]:
                before = s
            # The road is visible behind an object that is nearer.
            if labels[s] > of_road[v] and total[s] + change < onto_road:
                onto_road, at_road = total[s] + change, s
            now[s] = cost + weight * _misfit((d - labels[s]) / reach)
            below[v, s] = state
        now[road] = onto_road + weight * _misfit((d - of_road[v]) / reach)
        if of_road[v] <= 0:
            now[road] = np.inf
        below[v, road] = at_road
        now[other], below[v, other] = total[cheapest] + change, cheapest
        if total[other] <= now[other]:
            now[other], below[v, other] = total[other], other
        now[other] += weight * np.float32(OTHER)
        cheapest = 0
        for s in range(n + 2):
            total[s] = now[s]
            if total[s] < total[cheapest]:
                cheapest = s
    return cheapest


@njit(inline="always")
def _misfit(error):
    return min(error * error, np.float32(1.0))
