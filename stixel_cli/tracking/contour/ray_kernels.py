"""What the scan's rays measure of a state of the tracker `contour`: its Numba kernels.

`RayTable` says what they look up, `contour_filter.py` what the model is.
"""

from math import atan2, cos, exp, floor, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning

CAP = 0.5
"""Of half the length or the width: a change of the size moves what is nearer to an end by as much
as the end. From 0.5 to 0.8 gains as much at home; 1, a scaled shape, shrinks real cars whose front
is rounder than the class's."""

OUTLINE_STD = 0.03
"""How well the outline of a class or of a free form, scaled, fits one road user at least, m."""

NEAR = 0.3
"""A point this near to the expected one along its ray, m, and half as near across, is in every
gate. A point that is by this nearer than an end, and no farther beside it, or on the next ray,
hides it."""

LEAST_COSINE = 0.2
"""Of the angle between a ray and a face's normal: the effect of an oblique face has this limit."""


@returning(lambda state, sensor, directions, table: np.empty((3, len(directions))))
@njit(cache=True, error_model="numpy")
def expected(found, state, sensor, directions, table):
    """What a state of a target predicts for the rays of a scan.

    `state` (5,): x, y, heading, and the logarithms of the factors on length and width; `sensor`
    (3,) its pose, m; `directions` (n, 2) unit vectors of the rays in the world; `RayTable.arrays`.

    Returns:
        (3, n) m: ranges; misses, how far outside of the shape's seen limits each ray passes,
        negative inside; standard deviations of the ranges.
    """
    cosine, sine = cos(state[2]), sin(state[2])
    dx, dy = sensor[0] - state[0], sensor[1] - state[1]
    x, y = cosine * dx + sine * dy, cosine * dy - sine * dx
    shrink = exp(-state[3]), exp(-state[4])
    for i in range(len(directions)):
        u = cosine * directions[i, 0] + sine * directions[i, 1]
        v = cosine * directions[i, 1] - sine * directions[i, 0]
        found[0, i], low, high, place = _meet(x, y, _ray(u, v, shrink, table), table)
        found[1, i], found[2, i] = -min(low, high), _between(table[3], place)


class Measured(NamedTuple):
    """What a scan measures of one target, and how well."""

    sensor: np.ndarray
    """(3,) pose in the world."""
    directions: np.ndarray
    """(n, 2) unit vectors of the rays in the world."""
    ranges: np.ndarray
    """(n,) m."""
    ends: np.ndarray
    """(2,) indices of the rays with the least and the greatest bearing."""
    inset: float
    """How far inside the shape's limits these two are, m."""
    used: np.ndarray
    """(n + 2,) which ranges and insets are measured."""
    variances: np.ndarray
    """(n + 2,) m² of what the sensor adds to each range and to each end, along and across."""
    across_variances: np.ndarray
    """(n,) m² of the sensor across the rays."""
    miss_variances: np.ndarray
    """(n,) m² of how far a ray passes by the shape."""
    noise_factor: float
    shape_factor: float
    """`noise_factor`, `shape_factor`: in the gain alone, on the variances of the sensor's ranges
    and of the limits, and of the shape's ranges."""


class Rows(NamedTuple):
    """Rows of a Kalman update: n ranges, minus the two insets, then the m rays that pass by."""

    matrix: np.ndarray
    """(n + 2 + m, d) derivatives by the state."""
    errors: np.ndarray
    """(n + 2 + m,) m, measured minus predicted."""
    noise: np.ndarray
    """(n + 2 + m,) m²."""
    stds: np.ndarray
    """(n + 2,) m, of the shape's ranges and limits."""
    slants: np.ndarray
    """(n,) by how much a range grows as the shape moves to the left of the ray."""
    insides: np.ndarray
    """(n,) m, how far inside the shape's limits each ray is; negative: it passes by."""


def rows_at(
    state: np.ndarray, covariance: np.ndarray, measured: Measured, table: tuple[np.ndarray, ...]
) -> Rows:
    """The rows at a `state` (d,) with a `covariance` (d, d); `RayTable.arrays`.

    The slopes by the place across a ray and by the heading are central differences over about a
    standard deviation: a step, of a corner in a turn, is from `OUTLINE_STD` to `NEAR`. The variance
    of what they leave out is added to the noise: that of a parabola over one standard deviation
    (Nørgaard, Poulsen & Ravn 2000, *New developments in state estimation for nonlinear systems*).
    The nodes of the residual are the states from 7 on.
    """
    count, states = len(measured.ranges), len(state)
    most = 2 * count + 2
    shapes = most, most, count + 2, count, count
    rows = Rows(np.zeros((most, states)), *map(np.empty, shapes))
    used = _measure(rows, state, np.ascontiguousarray(covariance), measured, table)
    return Rows(*(values[:used] for values in rows[:3]), *rows[3:])


@njit(cache=True, error_model="numpy")
def _measure(rows, state, covariance, measured, table):
    """Write `rows_at` to `rows`; returns their number."""
    count = len(measured.directions)
    used = count + 2
    cosine, sine = cos(state[2]), sin(state[2])
    dx, dy = measured.sensor[0] - state[0], measured.sensor[1] - state[1]
    x, y = cosine * dx + sine * dy, cosine * dy - sine * dx
    shrink = exp(-state[5]), exp(-state[6])
    quarter = len(table[4]) // 4
    half_x = 0.5 * (table[5][quarter] - table[4][quarter]) / shrink[0]
    half_y = 0.5 * (table[5][0] - table[4][0]) / shrink[1]
    reach = sqrt(half_x**2 + half_y**2)
    turn = min(max(reach * sqrt(max(covariance[2, 2], 0.0)), OUTLINE_STD), NEAR) / reach
    c, s = cos(turn), sin(turn)
    for i in range(count):
        ahead_x, ahead_y = measured.directions[i, 0], measured.directions[i, 1]
        u, v = cosine * ahead_x + sine * ahead_y, cosine * ahead_y - sine * ahead_x
        ray = _ray(u, v, shrink, table)
        distance, low, high, place = _meet(x, y, ray, table)
        across = ahead_y**2 * covariance[0, 0] + ahead_x**2 * covariance[1, 1]
        across -= 2.0 * ahead_x * ahead_y * covariance[0, 1]
        step = min(max(sqrt(max(across, 0.0)), OUTLINE_STD), NEAR)
        # The target moves to the left or turns, so in its frame the ray does the opposite.
        left = _meet(x + step * v, y - step * u, ray, table)[0]
        right = _meet(x - step * v, y + step * u, ray, table)[0]
        ray = _ray(c * u + s * v, c * v - s * u, shrink, table)
        after, low_after, high_after, _ = _meet(c * x + s * y, c * y - s * x, ray, table)
        ray = _ray(c * u - s * v, c * v + s * u, shrink, table)
        before, low_before, high_before, _ = _meet(c * x - s * y, c * y + s * x, ray, table)
        hit_x, hit_y = x + distance * u, y + distance * v
        angle, slant = atan2(hit_y / half_y, hit_x / half_x), (left - right) / (2.0 * step)
        # How far a change of the size moves the surface that the ray meets, along both axes.
        shift_x = half_x * min(max(hit_x / (CAP * half_x), -1.0), 1.0)
        shift_y = half_y * min(max(hit_y / (CAP * half_y), -1.0), 1.0)
        std, slopes = _between(table[3], place), rows.matrix[i]
        slopes[0], slopes[1] = ahead_x - slant * ahead_y, ahead_y + slant * ahead_x
        slopes[2] = (after - before) / (2.0 * turn)
        slopes[5], slopes[6] = (u - slant * v) * shift_x, (v + slant * u) * shift_y
        rows.stds[i], rows.slants[i], rows.insides[i] = std, slant, min(low, high)
        rows.errors[i] = measured.ranges[i] - distance
        # Where the ray grazes the shape, a small error across it is a large one of the range.
        rows.noise[i] = slant**2 * measured.across_variances[i]
        rows.noise[i] += measured.noise_factor * measured.variances[i]
        rows.noise[i] += measured.shape_factor * std**2
        bent = (left + right - 2.0 * distance) ** 2 + (after + before - 2.0 * distance) ** 2
        rows.noise[i] += 0.5 * bent
        _add_nodes(rows, i, angle, min(sqrt(1.0 + slant**2), 1.0 / LEAST_COSINE), state)
        bent = 0.5 * (low_after + low_before - 2.0 * low) ** 2
        of_low = 1.0, low, (low_before - low_after) / (2.0 * turn), bent
        bent = 0.5 * (high_after + high_before - 2.0 * high) ** 2
        of_high = -1.0, high, (high_before - high_after) / (2.0 * turn), bent
        sides = ahead_x, ahead_y, -v * shift_x, u * shift_y
        for end in range(2):
            if i == measured.ends[end]:
                row, limit = count + end, of_low if end == 0 else of_high
                std = _beside(table[6] if end == 0 else table[7], place)
                inside = _fill_limit(rows.matrix[row], limit, sides)
                rows.stds[row], rows.errors[row] = std, inside - measured.inset
                # What is not measured has no precision.
                rows.noise[row] = measured.noise_factor * (measured.variances[row] + std**2)
                if not measured.used[row]:
                    rows.noise[row] = np.inf
                rows.noise[row] += limit[3]
                _add_nodes(rows, row, angle, 1.0, state)
        if min(low, high) < 0.0:
            nearer = of_low if low < high else of_high
            rows.errors[used] = _fill_limit(rows.matrix[used], nearer, sides)
            rows.noise[used] = measured.shape_factor * measured.miss_variances[i]
            used += 1
    return used


@njit(cache=True, error_model="numpy")
def _fill_limit(slopes, limit, sides):
    """Write the slopes of minus how far a ray is inside a limit; returns that distance."""
    sign, inside, by_turn, _ = limit
    ahead_x, ahead_y, by_length, by_width = sides
    slopes[0], slopes[1], slopes[2] = -sign * ahead_y, sign * ahead_x, by_turn
    slopes[5], slopes[6] = sign * by_length, sign * by_width
    return inside


@njit(cache=True, error_model="numpy")
def _add_nodes(rows, row, angle, weight, state):
    """Add what the residual moves in a row at an `angle`, by so many times its own size."""
    nodes = len(state) - 7
    position = angle / (2.0 * pi) * nodes
    node, share = floor(position), position - floor(position)
    for k, of_node in ((node % nodes, 1.0 - share), ((node + 1) % nodes, share)):
        rows.matrix[row, 7 + k] = -weight * of_node
        rows.errors[row] += weight * of_node * state[7 + k]


@njit(cache=True, error_model="numpy")
def _ray(u, v, shrink, table):
    """A ray along (u, v) of the target's frame, scaled: direction, scales, and rows of the table.

    The scales are metres of the scaled frame per metre of the world along the ray, and the world's
    per metre of the scaled frame across it: areas scale alike.
    """
    u, v = u * shrink[0], v * shrink[1]
    scale = sqrt(u * u + v * v)
    u, v = u / scale, v / scale
    rows = len(table[0])
    position = (atan2(-v, -u) / (2.0 * pi) * rows) % rows
    a = int(position)
    f = position - a
    a = a % rows
    scales = scale, scale / (shrink[0] * shrink[1])
    return u, v, shrink[0], shrink[1], scales, (a, (a + 1) % rows, f)


@njit(cache=True, error_model="numpy")
def _meet(x, y, ray, table):
    """Range of a `ray` from (x, y) of the target's frame; how far it is inside both limits; place.

    The place in the table: two rows, the share of the second, a column, the share of the next.
    """
    u, v, shrink_x, shrink_y, (scale, across), (a, b, f) = ray
    x, y = x * shrink_x, y * shrink_y
    offset = u * y - v * x
    columns = table[2].shape[1]
    start = table[0][a] * (1.0 - f) + table[0][b] * f
    end = table[1][a] * (1.0 - f) + table[1][b] * f
    column = (offset - start) / (end - start) * (columns - 1)
    # Not a number, of a point at the sensor itself, is no index.
    column = min(column, columns - 1.0) if column >= 0.0 else 0.0
    c = min(int(column), columns - 2)
    place = a, b, f, c, column - c
    distance = (_between(table[2], place) - u * x - v * y) / scale
    inside_low = (offset - _beside(table[4], place)) * across
    return distance, inside_low, (_beside(table[5], place) - offset) * across, place


@njit(cache=True, error_model="numpy")
def _between(values, place):
    """Bilinear between two rows and a column and the next."""
    a, b, f, c, g = place
    first = values[a, c] * (1.0 - g) + values[a, c + 1] * g
    return first * (1.0 - f) + (values[b, c] * (1.0 - g) + values[b, c + 1] * g) * f


@njit(cache=True, error_model="numpy")
def _beside(values, place):
    """Linear between two rows."""
    a, b, f, _, _ = place
    return values[a] * (1.0 - f) + values[b] * f
