"""Sub-pixel disparity of a stixel from the images: its two patches, aligned by least squares."""

import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning

PAD = 2
"""Columns of the patch on either side of the stixel: a few columns have too little texture."""

FACE = 0.15
"""Pixels whose disparity is as near to the stixel's as this belong to its face, px. Others, such as
what is behind an edge, would move the alignment away from the camera."""

TOLERANCE = 0.3
"""The alignment does not go farther, px: beyond, it has locked to something else."""

STEPS = 4

MOST_ROWS = 32
"""More rows of a patch cost time and add little; then they are evenly spaced."""


@returning(
    lambda left, right, columns, areas, given, *_: (given.copy(), np.empty(len(left), np.int64))
)
@njit(cache=True, nogil=True, error_model="numpy")
def aligned(found, rows, left, right, columns, areas, disparities, scale, errors):
    """Disparities (S,) float64 px for which the stixels' patches in both images agree best.

    Gauss-Newton on the sum of squared differences, without their mean, with one disparity for the
    whole patch (Lucas, Kanade 1981); the right image is interpolated by a cubic (Catmull, Rom
    1974). A patch has the rows of the stixel in which at least half of the columns are of its face,
    at most `MOST_ROWS` of them, and of these rows the pixels that are (`FACE`). Where the patch is
    too small, the images do not agree better than before, or the result is more than `TOLERANCE`
    away, the given disparity stays.

    Args:
        left, right: images (H, W) uint8.
        columns: (W, H) int16 raw disparities; pitch-compensated disparity is raw * scale[v] px.
        areas: (S, 4) left, right (exclusive), top and base row.
        disparities: (S,) pitch-compensated, px.
        scale: (H,) float32.
        errors: (W,) px, by which disparities in the images are greater; see `Rig.disparity_errors`.
    """
    width = len(columns)
    for s in range(len(areas)):
        start = disparities[s]
        count = 0
        for v in range(areas[s, 2], areas[s, 3] + 1):
            near = 0
            for u in range(areas[s, 0], areas[s, 1]):
                if columns[u, v] >= 0 and abs(columns[u, v] * scale[v] - start) < FACE:
                    near += 1
            if 2 * near >= areas[s, 1] - areas[s, 0]:
                rows[count] = v
                count += 1
        if count > MOST_ROWS:
            for i in range(MOST_ROWS):
                rows[i] = rows[i * count // MOST_ROWS]
            count = MOST_ROWS
        error = errors[(areas[s, 0] + areas[s, 1]) // 2]
        first, last = max(areas[s, 0] - PAD, 0), min(areas[s, 1] + PAD, width)
        now, least = start, np.inf
        for _ in range(STEPS):
            n, squares, step = _normal_equation(
                left, right, columns, rows, count, first, last, start, now, scale, error
            )
            if n < 3 * (last - first):
                break
            if squares / n < least:
                least, found[s] = squares / n, now
            now += step
            if not abs(now - start) <= TOLERANCE:
                break


@njit(inline="always")
def _normal_equation(
    left, right, columns, rows, count, first, last, given, disparity, scale, error
):
    """Pixels, sum of squared differences without their mean, and the step to a better disparity.

    Of the pixels in columns `first` … `last` - 1 and the first `count` of `rows` whose disparity is
    about the `given` one; NaN or 0 for a step without texture.
    """
    n = g = e = gg = ge = ee = 0.0
    for i in range(count):
        v = rows[i]
        # Raw disparities are 16 times those of the image.
        per_px = 1.0 / (16.0 * scale[v])
        # All pixels of a row have the same fraction, and so the same weights of four neighbours.
        start = first - disparity * per_px - error
        k = int(np.floor(start)) - first
        t = start - np.floor(start)
        w0, w1 = 0.5 * t * (-1.0 + t * (2.0 - t)), 1.0 + 0.5 * t * t * (-5.0 + 3.0 * t)
        w2, w3 = 0.5 * t * (1.0 + t * (4.0 - 3.0 * t)), 0.5 * t * t * (t - 1.0)
        s0, s1 = -0.5 + t * (2.0 - 1.5 * t), t * (-5.0 + 4.5 * t)
        s2, s3 = 0.5 + t * (4.0 - 4.5 * t), t * (-1.0 + 1.5 * t)
        one, other = left[v], right[v]
        for u in range(max(first, 1 - k), min(last, right.shape[1] - 2 - k)):
            # Without a disparity, it is far below the given one.
            if abs(columns[u, v] * scale[v] - given) >= FACE:
                continue
            a, b, c, d = other[u + k - 1], other[u + k], other[u + k + 1], other[u + k + 2]
            difference = one[u] - (w0 * a + w1 * b + w2 * c + w3 * d)
            slope = -(s0 * a + s1 * b + s2 * c + s3 * d) * per_px
            n += 1.0
            g += slope
            e += difference
            gg += slope * slope
            ge += slope * difference
            ee += difference * difference
    if n == 0.0:
        return 0.0, 0.0, 0.0
    return n, ee - e * e / n, (ge - g * e / n) / (gg - g * g / n)
