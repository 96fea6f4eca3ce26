"""What a sensor expects to measure of a shape, as a table over the rays that meet it.

A ray is a line in the target's frame. Two numbers name it: its `aspect`, the bearing at which the
target sees the sensor along this line, and its `offset` from the target's centre, positive to the
left of the ray as the sensor looks. The table holds, for every aspect and offset, the `depth` at
which the ray meets the shape: the distance along the ray from the foot of the centre's
perpendicular, negative on the sensor's side. Casting a ray is then one look-up, whatever the
number of the outline's points, and the shape that a sensor *sees* may differ from the outline.

A scaled shape needs no table of its own: scaling the axes turns a ray into another ray.

Frames: target, x along the heading, y left; m and rad.
"""

from dataclasses import dataclass, fields
from functools import cached_property
from math import atan2, cos, exp, pi, sin, sqrt

import numpy as np
from numba import njit

from stixel_cli.geometry.polygon import first_hits

FINE, COARSE = (360, 81), (72, 51)
"""Numbers of even aspects over a full turn and of even offsets over the width: of an outline that
the sensor sees as it is, and of one that it sees blurred.

A turn of 5 degrees brings 0.4 m of a car's side into view, so the outline takes a degree.
"""

CAP = 0.5
"""Of half the length or the width: a change of the size moves what is nearer to an end by as much
as the end. From 0.5 to 0.8 gains as much at home; 1, a scaled shape, shrinks real cars whose front
is rounder than the class's."""

LEAST_STEP, GREATEST_STEP = 0.02, 0.3
LEAST_TURN, GREATEST_TURN = 0.01, 0.2
"""Bounds of the steps of the central differences, m and rad."""

REACH = 1.25
"""The table's offsets reach this far, in halves of the outline's width at the aspect."""


@dataclass(frozen=True)
class RayTable:
    """Depths and limits of a shape, over A even aspects from 0 on and O offsets.

    Attributes:
        lowest, highest: (A,) m, offsets of the table's first and last column.
        depths: (A, O) m, where the sensor measures the shape.
        stds: (A, O) m, standard deviation of one point's depth.
        low, high: (A,) m, offsets at which the sensor sees the shape begin and end.
        low_stds, high_stds: (A,) m, their standard deviations.
    """

    lowest: np.ndarray
    highest: np.ndarray
    depths: np.ndarray
    stds: np.ndarray
    low: np.ndarray
    high: np.ndarray
    low_stds: np.ndarray
    high_stds: np.ndarray

    @cached_property
    def extents(self) -> np.ndarray:
        """Length and width (2,) m of what is seen."""
        widths = self.high - self.low
        return widths[[len(widths) // 4, 0]]

    @cached_property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """The arrays in the order in which the kernels take them, compiled for C's."""
        return tuple(np.ascontiguousarray(getattr(self, one.name)) for one in fields(self))


def even_aspects(count: int) -> np.ndarray:
    """A table's aspects (count,) rad."""
    return 2.0 * np.pi * np.arange(count) / count


def widths(outline: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest offset (n,) m of a polygon (M, 2) m at aspects `angles` (n,) rad."""
    offsets = outline @ np.stack([np.sin(angles), -np.cos(angles)])
    return offsets.min(axis=0), offsets.max(axis=0)


def first_depths(outline: np.ndarray, aspects: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Depths (n, m) m at which rays first meet a polygon (M, 2) m.

    `aspects` (n,) rad and `offsets` (n, m) m name the rays. A ray that passes by the polygon has
    the depth of the nearest ray of its aspect that meets it.
    """
    low, high = widths(outline, aspects)
    inner = 1e-9 * (high - low)
    offsets = np.clip(offsets, (low + inner)[:, None], (high - inner)[:, None])
    along = -np.stack([np.cos(aspects), np.sin(aspects)], axis=-1)
    left = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    far = 2.0 * np.hypot(*outline.T).max()
    origins = offsets[..., None] * left[:, None] - far * along[:, None]
    directions = np.repeat(along, offsets.shape[1], axis=0)
    return first_hits(outline, origins.reshape(-1, 2), directions).reshape(offsets.shape) - far


def outline_table(outline: np.ndarray, size: tuple[int, int] = FINE) -> RayTable:
    """The table of a sensor that sees the outline (M, 2) m exactly; all its stds are 0."""
    angles = even_aspects(size[0])
    low, high = widths(outline, angles)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    lowest, highest = middle - REACH * half, middle + REACH * half
    share = np.linspace(0.0, 1.0, size[1])
    offsets = lowest[:, None] + share * (highest - lowest)[:, None]
    depths = first_depths(outline, angles, offsets)
    exact = np.zeros(size[0])
    return RayTable(
        lowest=lowest,
        highest=highest,
        depths=depths,
        stds=np.zeros_like(depths),
        low=low,
        high=high,
        low_stds=exact,
        high_stds=exact,
    )


def behind(table: RayTable) -> RayTable:
    """The table of where the same rays leave the shape: as seen from the other side."""
    half = len(table.lowest) // 2
    turned = {name: np.roll(values, half, axis=0) for name, values in vars(table).items()}
    return RayTable(
        lowest=-turned["highest"],
        highest=-turned["lowest"],
        depths=-turned["depths"][:, ::-1],
        stds=turned["stds"][:, ::-1],
        low=-turned["high"],
        high=-turned["low"],
        low_stds=turned["high_stds"],
        high_stds=turned["low_stds"],
    )


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
) -> tuple[np.ndarray, ...]:
    """The measurements of `Linear` at a `state` (5,) with a `covariance` (3, 3) of its pose.

    `sensor`, `directions` and `table` are as in `expected`; `ranges` (n,) m are measured, and those
    that are nearer to what `far` expects are taken for its. `ends` (2,) are the indices of the rays
    with the least and the greatest bearing, `half` (2,) m half of the scaled length and width.

    The slopes are central differences along the target's axes, over about a standard deviation: so
    no frame of the world matters.

    Returns:
        the fields of `Linear`, in its order.
    """
    count = len(directions)
    values, slopes = np.empty(2 * count + 2), np.zeros((2 * count + 2, 5))
    stds, curvatures, angles = np.empty(count + 2), np.zeros(count + 2), np.empty(count)
    cosine, sine = cos(state[2]), sin(state[2])
    dx, dy = sensor[0] - state[0], sensor[1] - state[1]
    x, y = cosine * dx + sine * dy, cosine * dy - sine * dx
    shrink = exp(-state[3]), exp(-state[4])
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
        angles[i] = atan2(hit_y / half[1], hit_x / half[0])
        # How far a change of the size moves the surface that the ray meets, along both axes.
        shift_x = half[0] * min(max(hit_x / (CAP * half[0]), -1.0), 1.0)
        shift_y = half[1] * min(max(hit_y / (CAP * half[1]), -1.0), 1.0)
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
