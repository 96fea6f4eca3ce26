"""What the scan's rays measure of a state of the tracker `contour`, and its iterated update.

The Numba kernels of the tracker: `RayTable` says what they look up, `contour_filter.py` what the
model is. They are in one file, as Numba's cache of a kernel knows this file only.
"""

from math import atan2, cos, exp, floor, pi, sin, sqrt

import numpy as np
from numba import njit

from stixel_cli.tracking.consider import NODES

CAP = 0.5
"""Of half the length or the width: a change of the size moves what is nearer to an end by as much
as the end. From 0.5 to 0.8 gains as much at home; 1, a scaled shape, shrinks real cars whose front
is rounder than the class's."""

LEAST_STEP, GREATEST_STEP = 0.02, 0.3
LEAST_TURN, GREATEST_TURN = 0.01, 0.2
"""Bounds of the steps of the central differences, m and rad."""

GREATEST_SLANT = 4.0
"""Where a ray grazes the shape, a residual changes the range by at most so many times as much."""

SIZE_STEP = 0.3
"""Greatest change of a factor of the size in one iteration, relative: slopes are local."""

CONVERGED = 2e-3
"""The iteration ends when no state moves by more than this."""


@njit(cache=True, error_model="numpy")
def expected(
    state: np.ndarray, sensor: np.ndarray, directions: np.ndarray, table: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a state of a target predicts for the rays of a scan.

    `state` (5,): x, y, heading, and the logarithms of the factors on length and width; `sensor`
    (2,) m; `directions` (n, 2) unit vectors of the rays in the world; `RayTable.arrays`.

    Returns:
        ranges (n,) m; misses (n,) m, how far outside of the shape's seen limits each ray passes,
        negative inside; range_stds (n,) m.
    """
    count = len(directions)
    ranges, misses, stds = np.empty(count), np.empty(count), np.empty(count)
    cosine, sine = cos(state[2]), sin(state[2])
    dx, dy = sensor[0] - state[0], sensor[1] - state[1]
    x, y = cosine * dx + sine * dy, cosine * dy - sine * dx
    shrink = exp(-state[3]), exp(-state[4])
    for i in range(count):
        u = cosine * directions[i, 0] + sine * directions[i, 1]
        v = cosine * directions[i, 1] - sine * directions[i, 0]
        ranges[i], low, high, place = _meet(x, y, u, v, shrink, table)
        misses[i], stds[i] = -min(low, high), _between(table[3], place)
    return ranges, misses, stds


@njit(cache=True, error_model="numpy")
def iterated(
    mean: np.ndarray,
    covariance: np.ndarray,
    iterate: np.ndarray,
    iterations: int,
    freedom: float,
    measured: np.ndarray,
    variances: np.ndarray,
    factors: np.ndarray,
    across_variances: np.ndarray,
    residual: bool,
    sensor: np.ndarray,
    directions: np.ndarray,
    ranges: np.ndarray,
    ends: np.ndarray,
    half: np.ndarray,
    table: tuple[np.ndarray, ...],
    far: tuple[np.ndarray, ...],
    both_sides: bool,
) -> tuple[np.ndarray, ...]:
    """The iterated update of a `mean` (d,) and `covariance` (d, d) that begins at `iterate` (d,).

    What is `measured` (2 n + 2,) m is ordered as the values of `linearised`, which says what the
    last arguments are. It has `variances` (2 n + 2,) m², infinite where it is not measured, and
    those of the shape, of which `factors` (n + 2,) count, and of `across_variances` (n,) m² of the
    points and the shape across the rays. Errors have `freedom` degrees of freedom. With a
    `residual` its nodes are the states from 7 on; rays that may end on `both_sides` leave them.

    Returns:
        the state (d,) and its covariance (d, d); of the last iterate the slopes (2 n + 2, d), the
        innovations, errors and variances (2 n + 2,), weights in them, and values, stds, angles as
        `linearised` returns them.
    """
    count, rows, size = len(directions), len(measured), len(mean)
    posterior, identity = covariance, np.eye(size)
    for _ in range(iterations):
        values, slopes, stds, curvatures, angles = linearised(
            iterate, posterior, sensor, directions, ranges, ends, half, table, far
        )
        matrix, weighted = np.zeros((rows, size)), np.empty((size, rows))
        errors, innovation, noise = measured - values, np.empty(rows), variances.copy()
        for row in range(rows):
            matrix[row, :3], matrix[row, 5:7] = slopes[row, :3], slopes[row, 3:]
            slant = 1.0
            if row < count:
                left_x, left_y = -directions[row, 1], directions[row, 0]
                tangent = slopes[row, 0] * left_x + slopes[row, 1] * left_y
                # Where the ray grazes the shape, a small error across it is a large one of range.
                noise[row] += tangent**2 * across_variances[row]
                slant = min(sqrt(1.0 + tangent**2), GREATEST_SLANT)
            if row < count + 2:
                noise[row] += factors[row] * stds[row] ** 2
            elif values[row] <= 0.0:
                noise[row] = np.inf
            if residual and row < count + 2:
                noise[row] += curvatures[row]
            # Where rays end on both sides: the slopes are those of sides that face the sensor.
            if residual and (count <= row < count + 2 or (row < count and not both_sides)):
                angle = angles[row if row < count else ends[row - count]]
                position = angle / (2.0 * pi) * NODES
                node, share = floor(position), position - floor(position)
                matrix[row, 7 + node % NODES] = (share - 1.0) * slant
                matrix[row, 7 + (node + 1) % NODES] = -share * slant
                errors[row] -= matrix[row, 7:] @ iterate[7:]
            innovation[row] = errors[row] + matrix[row] @ (iterate - mean)
            noise[row] /= min((freedom + 1.0) / (freedom + errors[row] ** 2 / noise[row]), 1.0)
            weighted[:, row] = matrix[row] / noise[row]
        posterior = np.linalg.solve(identity + covariance @ (weighted @ matrix), covariance)
        posterior = 0.5 * (posterior + posterior.T)
        moved = mean + posterior @ (weighted @ innovation)
        for one in (5, 6):
            moved[one] = min(max(moved[one], iterate[one] - SIZE_STEP), iterate[one] + SIZE_STEP)
        change = np.abs(moved - iterate).max()
        iterate = moved
        if change < CONVERGED:
            break
    return iterate, posterior, matrix, innovation, errors, noise, values, stds, angles


@njit(cache=True, error_model="numpy")
def linearised(
    state: np.ndarray,
    covariance: np.ndarray,
    sensor: np.ndarray,
    directions: np.ndarray,
    ranges: np.ndarray,
    ends: np.ndarray,
    half: np.ndarray,
    table: tuple[np.ndarray, ...],
    far: tuple[np.ndarray, ...],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What a `state` (d,) with a `covariance` (d, d) predicts, and how that depends on the state.

    `sensor`, `directions` and `table` are as in `expected`; `ranges` (n,) m are measured, and those
    that are nearer to what `far` expects are taken for its. `ends` (2,) are the indices of the rays
    with the least and the greatest bearing, `half` (2,) m half of the shape's length and width.

    The slopes are central differences along the target's axes, over about a standard deviation: so
    no frame of the world matters.

    Returns:
        values (2 n + 2,) m: the ranges, minus the two insets, and the misses, how far each ray
        passes by the shape, negative inside; slopes (2 n + 2, 5) of the values by the states that
        rays see; stds (n + 2,) m of the ranges and insets; curvatures (n + 2,) m², the variance of
        what their slopes leave out: that of a parabola over one standard deviation of each state
        (Nørgaard, Poulsen & Ravn 2000, *New developments in state estimation for nonlinear
        systems*); angles (n,) rad, where the rays meet the shape, in units of half its size.
    """
    count = len(directions)
    values, slopes = np.empty(2 * count + 2), np.zeros((2 * count + 2, 5))
    stds, curvatures, angles = np.empty(count + 2), np.zeros(count + 2), np.empty(count)
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
    return values, slopes, stds, curvatures, angles


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
