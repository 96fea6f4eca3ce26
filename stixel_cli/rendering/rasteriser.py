"""Compiled kernels that find the surfaces in many samples of a few pixels: of those at edges.

For one sample a pixel a ray is as good. For 64 in a pixel a rasteriser is faster by an order of
magnitude, because it looks for the pixels of each triangle and not for the triangles of each ray.
Edge functions are homogeneous (Olano, Greer 1997, *Triangle scan conversion using 2D homogeneous
coordinates*), so no triangle is clipped, and in double precision: two triangles with a common edge
leave no sample between them.
"""

import numpy as np
from numba import njit

NEAREST = 1e-3
"""Surfaces nearer to the camera than this along its axis, m, are not seen."""

NARROW = 8
"""For a triangle of at most this many columns, all rows search the same columns."""

MARGIN = 1e-6
"""Rounding of a triangle's extent in the image, px; samples keep further off a pixel's border."""


@njit(cache=True, nogil=True, error_model="numpy")
def rasterise(results, first, corners, pinhole, pixels, offsets):
    """Write the nearest triangle of a body into the samples of pixels, where it is nearer.

    Args:
        results: inverse (n, s) float64 1/m, inverse depth of what is found so far, 0 for nothing;
            found (n, s) int32, its number, -1 for nothing; filled (n,) 1/m, zero at first: what is
            behind it need not be looked at, because a triangle fills the pixel; and working memory,
            points and edges (3, 3).
        first: number of the body's first triangle.
        corners: (T, 3, 3) float64 m, triangles in the frame of the body.
        pinhole: projection, origin, focal, u0, v0: the camera in that frame, see
            `Camera.projection`.
        pixels: columns (n,) int64 of the pixels, which are sorted by row and then by column;
            preceding (H W + 1,) int32, how many of them precede each of the image, row by row;
            width of the image, px.
        offsets: right and down (s,) float64 px, of the samples from a pixel's centre.
    """
    inverse, found, filled, points, edges = results
    projection, origin, focal, u0, v0 = pinhole
    columns, preceding, width = pixels
    right, down = offsets
    height, samples, most = (len(preceding) - 1) // width, len(right), 1.0 / NEAREST
    for t in range(len(corners)):
        nearest, depth = -np.inf, np.inf
        for i in range(3):
            x = corners[t, i, 0] - origin[0]
            y = corners[t, i, 1] - origin[1]
            z = corners[t, i, 2] - origin[2]
            for axis in range(3):
                points[i, axis] = (
                    projection[0, axis] * x + projection[1, axis] * y + projection[2, axis] * z
                )
            nearest, depth = max(nearest, points[i, 2]), min(depth, points[i, 2])
        if nearest < NEAREST:
            continue
        first_column, past_column, top, bottom = 0, width, 0, height
        if depth > NEAREST:
            low_u = high_u = points[0, 0] / points[0, 2]
            low_v = high_v = points[0, 1] / points[0, 2]
            for i in range(1, 3):
                x, y = points[i, 0] / points[i, 2], points[i, 1] / points[i, 2]
                low_u, high_u = min(low_u, x), max(high_u, x)
                low_v, high_v = min(low_v, y), max(high_v, y)
            first_column, past_column = _touched(low_u * focal + u0, high_u * focal + u0, width)
            top, bottom = _touched(low_v * focal + v0, high_v * focal + v0, height)
        if first_column >= past_column or top >= bottom:
            continue
        if preceding[top * width] == preceding[bottom * width]:
            continue
        volume = _edge_functions(points, focal, u0, v0, edges)
        if volume == 0.0:
            continue
        # Inverse depth of the plane: the sum of the edge functions over the volume.
        across = (edges[0, 0] + edges[1, 0] + edges[2, 0]) / volume
        along = (edges[0, 1] + edges[1, 1] + edges[2, 1]) / volume
        level = (edges[0, 2] + edges[1, 2] + edges[2, 2]) / volume
        ahead = 0.5 * (abs(across) + abs(along))
        a0, b0, a1, b1 = edges[0, 0], edges[0, 1], edges[1, 0], edges[1, 1]
        a2, b2 = edges[2, 0], edges[2, 1]
        half0, half1 = 0.5 * (abs(a0) + abs(b0)), 0.5 * (abs(a1) + abs(b1))
        half2 = 0.5 * (abs(a2) + abs(b2))
        triangle = np.int32(first + t)
        for row in range(top, bottom):
            left, past = first_column, past_column
            if past_column - first_column > NARROW:
                low, high = _span(edges, row)
                left, past = _touched(low, high, width)
                if left >= past:
                    continue
            for pixel in range(preceding[row * width + left], preceding[row * width + past]):
                u = columns[pixel]
                centre = across * u + along * row + level
                if centre + ahead > filled[pixel]:
                    e0 = edges[0, 0] * u + edges[0, 1] * row + edges[0, 2]
                    e1 = edges[1, 0] * u + edges[1, 1] * row + edges[1, 2]
                    e2 = edges[2, 0] * u + edges[2, 1] * row + edges[2, 2]
                    # No sample is inside.
                    if e0 < -half0 or e1 < -half1 or e2 < -half2:
                        continue
                    # Without branches, so that the processor takes several samples at a time.
                    for k in range(samples):
                        dx, dy = right[k], down[k]
                        value = centre + across * dx + along * dy
                        before, number = inverse[pixel, k], found[pixel, k]
                        seen = (
                            (e0 + a0 * dx + b0 * dy >= 0.0)
                            & (e1 + a1 * dx + b1 * dy >= 0.0)
                            & (e2 + a2 * dx + b2 * dy >= 0.0)
                            & (value > before)
                            & (value < most)
                        )
                        inverse[pixel, k] = value if seen else before
                        found[pixel, k] = triangle if seen else number
                    if e0 >= half0 and e1 >= half1 and e2 >= half2 and centre + ahead < most:
                        filled[pixel] = max(filled[pixel], centre - ahead)


@njit(inline="always")
def _touched(low, high, count):
    """The first of an axis's `count` pixels that an extent can touch, and the one past the last.

    The extent, from `low` to `high` px, may be infinite.
    """
    first = np.ceil(min(max(low - 0.5 - MARGIN, 0.0), count))
    return int(first), int(np.floor(max(min(high + 0.5 + MARGIN, count - 1.0), -1.0))) + 1


@njit(inline="always")
def _edge_functions(points, focal, u0, v0, edges):
    """Write the edge functions (3, 3) of the triangle `points` (3, 3), and return its volume.

    The function a u + b v + c of an edge is not negative on the triangle's side of it. Two
    triangles that share an edge get the same numbers there, with the opposite sign: a sample on it
    belongs to both. The volume, positive, is that of the edges to the camera's centre.
    """
    volume = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        x = points[j, 1] * points[k, 2] - points[j, 2] * points[k, 1]
        y = points[j, 2] * points[k, 0] - points[j, 0] * points[k, 2]
        z = points[j, 0] * points[k, 1] - points[j, 1] * points[k, 0]
        if i == 0:
            volume = points[0, 0] * x + points[0, 1] * y + points[0, 2] * z
        edges[i, 0], edges[i, 1] = x / focal, y / focal
        edges[i, 2] = z - x / focal * u0 - y / focal * v0
    if volume < 0.0:
        volume = -volume
        for i in range(3):
            for axis in range(3):
                edges[i, axis] = -edges[i, axis]
    return volume


@njit(inline="always")
def _span(edges, row):
    """The extent of the triangle's part in `row`, px; (inf, -inf) if it has none."""
    low, high = -np.inf, np.inf
    for i in range(3):
        a = edges[i, 0]
        rest = edges[i, 1] * row + edges[i, 2] + 0.5 * abs(edges[i, 1])
        if a > 0.0:
            low = max(low, -rest / a)
        elif a < 0.0:
            high = min(high, -rest / a)
        elif rest < 0.0:
            return np.inf, -np.inf
    return low, high


@njit(cache=True, nogil=True, error_model="numpy")
def fragments(results, memory, seen, second, pixels, samples):
    """Write the distinct triangles of each pixel, the fragments, and return how many there are.

    They are in the order of their first samples, pixel by pixel.

    Args:
        results: gets of each fragment, up to one a sample, its pixel, int64; how many samples it
            has, int64; the mean u and v of these, px, and the depth there, m, inf without a
            triangle, float64; the body, int8, and its triangle, int32, both -1 without one.
        memory: (s,) int32 and (s,) int64.
        seen: inverse and found (n, s), of `rasterise`.
        second: number of the first triangle of the second body.
        pixels: rows and columns (n,) int64; split (n,) bool, whether a triangle's parts count as
            distinct.
        samples: right, down (s,) px, as of `rasterise`; parts (s,) int64, the part of the pixel,
            counted from 0, in which each is.
    """
    to_pixel, covered, u, v, depth, body, triangle = results
    numbers, own_parts = memory
    inverse, found = seen
    rows, columns, split = pixels
    right, down, parts = samples
    count, size = found.shape
    past = 0
    for pixel in range(count):
        begin, distinct, k = past, 0, 0
        while k < size:
            number = found[pixel, k]
            part = parts[k] if split[pixel] else 0
            at = 0
            while at < distinct and (numbers[at] != number or own_parts[at] != part):
                at += 1
            to = begin + at
            if at == distinct:
                distinct += 1
                numbers[at], own_parts[at], covered[to] = number, part, 0
                u[to] = v[to] = depth[to] = 0.0
            # The next sample mostly shows the same triangle: sum such runs in local variables.
            summed, sum_u, sum_v, sum_depth = covered[to], u[to], v[to], depth[to]
            while k < size and found[pixel, k] == number:
                if split[pixel] and parts[k] != part:
                    break
                summed += 1
                sum_u += right[k]
                sum_v += down[k]
                sum_depth += inverse[pixel, k]
                k += 1
            covered[to], u[to], v[to], depth[to] = summed, sum_u, sum_v, sum_depth
        past += distinct
        for at in range(distinct):
            to, number = begin + at, numbers[at]
            to_pixel[to] = pixel
            u[to] = columns[pixel] + u[to] / covered[to]
            v[to] = rows[pixel] + v[to] / covered[to]
            # Inverse depth is linear in the image: its mean is that of the mean point.
            depth[to] = covered[to] / depth[to] if number >= 0 else np.inf
            body[to] = -1 if number < 0 else 0 if number < second else 1
            triangle[to] = number - second if number >= second else number
    return past
