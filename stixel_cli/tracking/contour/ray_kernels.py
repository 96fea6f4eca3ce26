"""What the scan's rays measure of a state of the tracker `contour`: its Numba kernels.

`RayTable` says what they look up, `contour_filter.py` what the model is. They write into arrays of
their caller.
"""

from math import atan2, cos, exp, floor, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

CAP = 0.5
"""Of half the length or the width: a change of the size moves what is nearer to an end by as much
as the end. From 0.5 to 0.8 gains as much at home; 1, a scaled shape, shrinks real cars whose front
is rounder than the class's."""

LEAST_STEP, GREATEST_STEP = 0.02, 0.3
LEAST_TURN, GREATEST_TURN = 0.01, 0.2
"""Bounds of the steps of the central differences, m and rad."""

GREATEST_SLANT = 4.0
"""Where a ray grazes the shape, a residual changes the range by at most so many times as much."""


def expected(
    state: np.ndarray, sensor: np.ndarray, directions: np.ndarray, table: tuple[np.ndarray, ...]
) -> np.ndarray:
    """What a state of a target predicts for the rays of a scan.

    `state` (5,): x, y, heading, and the logarithms of the factors on length and width; `sensor`
    (3,) its pose, m; `directions` (n, 2) unit vectors of the rays in the world; `RayTable.arrays`.

    Returns:
        (3, n) m: ranges; misses, how far outside of the shape's seen limits each ray passes,
        negative inside; standard deviations of the ranges.
    """
    results = np.empty((3, len(directions)))
    _expect(*results, state, sensor, directions, table)
    return results


@njit(cache=True, error_model="numpy")
def _expect(ranges, misses, stds, state, sensor, directions, table):
    """Write `expected`."""
    cosine, sine = cos(state[2]), sin(state[2])
    dx, dy = sensor[0] - state[0], sensor[1] - state[1]
    x, y = cosine * dx + sine * dy, cosine * dy - sine * dx
    shrink = exp(-state[3]), exp(-state[4])
    for i in range(len(directions)):
        u = cosine * directions[i, 0] + sine * directions[i, 1]
        v = cosine * directions[i, 1] - sine * directions[i, 0]
        ranges[i], low, high, place = _meet(x, y, u, v, shrink, table)
        misses[i], stds[i] = -min(low, high), _between(table[3], place)


class Linear(NamedTuple):
    """What a state (d,) predicts of n ranges, of minus the two insets, and of n misses."""

    values: np.ndarray
    """(2 n + 2,) m; a miss is how far a ray passes by the shape, negative inside."""
    slopes: np.ndarray
    """(2 n + 2, 5), by the states that a ray sees."""
    stds: np.ndarray
    """(n + 2,) m, of the ranges and insets."""
    curvatures: np.ndarray
    """(n + 2,) m², the variance of what the slopes leave out: that of a parabola over one standard
    deviation of each state (Nørgaard, Poulsen & Ravn 2000, *New developments in state estimation
    for nonlinear systems*)."""
    angles: np.ndarray
    """(n,) rad, where the rays meet the shape, in units of half its size."""

    @classmethod
    def of_rays(cls, count: int) -> "Linear":
        """Arrays for `linearise` to write to, of so many rays."""
        rows = 2 * count + 2
        measured = np.empty(count + 2), np.empty(count + 2)
        return cls(np.empty(rows), np.empty((rows, 5)), *measured, np.empty(count))


@njit(cache=True, error_model="numpy")
def linearise(
    linear: Linear,
    state: np.ndarray,
    covariance: np.ndarray,
    sensor: np.ndarray,
    directions: np.ndarray,
    ranges: np.ndarray,
    ends: np.ndarray,
    half: np.ndarray,
    table: tuple[np.ndarray, ...],
    far: tuple[np.ndarray, ...],
) -> None:
    """Write to `linear` what a `state` (d,) with a `covariance` (d, d) predicts.

    `sensor`, `directions` and `table` are as in `expected`; `ranges` (n,) m are measured, and those
    that are nearer to what `far` expects are taken for its. `ends` (2,) are the indices of the rays
    with the least and the greatest bearing, `half` (2,) m half of the shape's length and width.

    The slopes are central differences along the target's axes, over about a standard deviation: so
    no frame of the world matters.
    """
    values, slopes, stds, curvatures, angles = linear
    count = len(directions)
    curvatures[:] = 0.0
    cosine, sine = cos(state[2]), sin(state[2])
    dx, dy = sensor[0] - state[0], sensor[1] - state[1]
    x, y = cosine * dx + sine * dy, cosine * dy - sine * dx
    shrink = exp(-state[5]), exp(-state[6])
    half_x, half_y = half[0] / shrink[0], half[1] / shrink[1]
    both = 2.0 * cosine * sine * covariance[0, 1]
    xx, yy = covariance[0, 0], covariance[1, 1]
    along, left = cosine**2 * xx + both + sine**2 * yy, sine**2 * xx - both + cosine**2 * yy
    steps = (
        min(max(sqrt(max(along, 0.0)), LEAST_STEP), GREATEST_STEP),
        min(max(sqrt(max(left, 0.0)), LEAST_STEP), GREATEST_STEP),
        min(max(sqrt(max(covariance[2, 2], 0.0)), LEAST_TURN), GREATEST_TURN),
    )
    turns = cos(steps[2]), sin(steps[2])
    for i in range(count):
        u = cosine * directions[i, 0] + sine * directions[i, 1]
        v = cosine * directions[i, 1] - sine * directions[i, 0]
        distance, low, high, place = _meet(x, y, u, v, shrink, table)
        other, _, _, _ = _meet(x, y, u, v, shrink, far)
        is_far = abs(ranges[i] - other) < abs(ranges[i] - distance)
        values[i] = other if is_far else distance
        stds[i], values[count + 2 + i] = _between(table[3], place), -min(low, high)
        hit_x, hit_y = x + values[i] * u, y + values[i] * v
        angles[i] = atan2(hit_y / half_y, hit_x / half_x)
        # How far a change of the size moves the surface that the ray meets, along both axes.
        shift_x = half_x * min(max(hit_x / (CAP * half_x), -1.0), 1.0)
        shift_y = half_y * min(max(hit_y / (CAP * half_y), -1.0), 1.0)
        for axis in range(3):
            step = steps[axis]
            # The target moves by a step, so the ray does by minus one in its frame.
            if axis == 2:
                c, s = turns
                ray = c * x + s * y, c * y - s * x, c * u + s * v, c * v - s * u
                back = c * x - s * y, c * y + s * x, c * u - s * v, c * v + s * u
            else:
                a, b = (step, 0.0) if axis == 0 else (0.0, step)
                ray, back = (x - a, y - b, u, v), (x + a, y + b, u, v)
            after, low_after, high_after, _ = _meet(*ray, shrink, table)
            before, low_before, high_before, _ = _meet(*back, shrink, table)
            miss = min(low_before, high_before) - min(low_after, high_after)
            if is_far:
                after, before = _meet(*ray, shrink, far)[0], _meet(*back, shrink, far)[0]
            slopes[i, axis] = (after - before) / (2.0 * step)
            slopes[count + 2 + i, axis] = miss / (2.0 * step)
            curvatures[i] += 0.5 * (after + before - 2.0 * values[i]) ** 2
            # Minus the insets, as they fall where the range grows.
            if i == ends[0]:
                slopes[count, axis] = (low_before - low_after) / (2.0 * step)
                curvatures[count] += 0.5 * (low_after + low_before - 2.0 * low) ** 2
            if i == ends[1]:
                slopes[count + 1, axis] = (high_before - high_after) / (2.0 * step)
                curvatures[count + 1] += 0.5 * (high_after + high_before - 2.0 * high) ** 2
        if i == ends[0]:
            values[count], stds[count] = -low, _beside(table[6], place)
            _finish(slopes[count], shift_x, shift_y, cosine, sine)
        if i == ends[1]:
            values[count + 1], stds[count + 1] = -high, _beside(table[7], place)
            _finish(slopes[count + 1], shift_x, shift_y, cosine, sine)
        _finish(slopes[i], shift_x, shift_y, cosine, sine)
        _finish(slopes[count + 2 + i], shift_x, shift_y, cosine, sine)


@njit(cache=True, error_model="numpy")
def fill_rows(
    matrix: np.ndarray,
    errors: np.ndarray,
    noise: np.ndarray,
    linear: Linear,
    state: np.ndarray,
    directions: np.ndarray,
    ends: np.ndarray,
    factors: np.ndarray,
    across_variances: np.ndarray,
    both_sides: bool,
) -> None:
    """The rows of a Kalman update at a `state` (d,), in the order of `linear`.

    `errors` (2 n + 2,) has what is measured, m, and becomes measured minus predicted; `noise` (2 n
    + 2,) m² has the sensor's variances, infinite where nothing is measured. Those of the shape,
    `factors` (n + 2,) times, and of `across_variances` (n,) m² of what is across the rays are added
    to it. `matrix` (2 n + 2, d) gets the slopes. The states from 7 on are the nodes of a residual;
    rays that may end on `both_sides` leave them alone, as the slopes are of sides that face the
    sensor.
    """
    values, slopes, stds, curvatures, angles = linear
    count, nodes = len(directions), len(state) - 7
    for row in range(len(values)):
        matrix[row] = 0.0
        for k in range(5):
            matrix[row, k if k < 3 else k + 2] = slopes[row, k]
        errors[row] -= values[row]
        slant = 1.0
        if row < count:
            tangent = slopes[row, 1] * directions[row, 0] - slopes[row, 0] * directions[row, 1]
            # Where the ray grazes the shape, a small error across it is a large one of the range.
            noise[row] += tangent**2 * across_variances[row]
            slant = min(sqrt(1.0 + tangent**2), GREATEST_SLANT)
        if row < count + 2:
            noise[row] += factors[row] * stds[row] ** 2
        elif values[row] <= 0.0:
            noise[row] = np.inf
        if nodes and row < count + 2:
            noise[row] += curvatures[row]
            if row >= count or not both_sides:
                position = angles[row if row < count else ends[row - count]] / (2.0 * pi) * nodes
                node, share = floor(position), position - floor(position)
                for k, weight in ((node % nodes, 1.0 - share), ((node + 1) % nodes, share)):
                    matrix[row, 7 + k] = -weight * slant
                    errors[row] += weight * slant * state[7 + k]


@njit(cache=True, error_model="numpy")
def _finish(slopes, shift_x, shift_y, cosine, sine):
    """From slopes along the target's axes to those of the world's, and those of the sizes."""
    along, left = slopes[0], slopes[1]
    slopes[0], slopes[1] = cosine * along - sine * left, sine * along + cosine * left
    slopes[3], slopes[4] = along * shift_x, left * shift_y


@njit(cache=True, error_model="numpy")
def _meet(x, y, u, v, shrink, table):
    """Range of a ray from (x, y) along (u, v) in the target's frame; how far it is inside; place.

    The place in the table: two rows, the share of the second, a column, the share of the next.
    """
    lowest, highest, depths, _, low, high, _, _ = table
    x, y, u, v = x * shrink[0], y * shrink[1], u * shrink[0], v * shrink[1]
    # Metres of the scaled frame per metre of the world, along this ray.
    scale = sqrt(u * u + v * v)
    u, v = u / scale, v / scale
    # Metres of the world per metre of the scaled frame, across: areas scale alike.
    across = scale / (shrink[0] * shrink[1])
    offset = u * y - v * x
    rows, columns = depths.shape
    position = (atan2(-v, -u) / (2.0 * pi) * rows) % rows
    a = int(position)
    f = position - a
    a = a % rows
    b = (a + 1) % rows
    start = lowest[a] * (1.0 - f) + lowest[b] * f
    end = highest[a] * (1.0 - f) + highest[b] * f
    column = (offset - start) / (end - start) * (columns - 1)
    # Not a number, of a point at the sensor itself, is no index.
    column = min(column, columns - 1.0) if column >= 0.0 else 0.0
    c = min(int(column), columns - 2)
    place = a, b, f, c, column - c
    distance = (_between(depths, place) - u * x - v * y) / scale
    inside_low = (offset - _beside(low, place)) * across
    return distance, inside_low, (_beside(high, place) - offset) * across, place


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
