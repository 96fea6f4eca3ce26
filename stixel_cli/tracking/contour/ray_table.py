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

from dataclasses import dataclass
from math import atan2, cos, exp, pi, sin, sqrt

import numpy as np
from numba import njit

from stixel_cli.geometry.polygon import first_hits

FINE, COARSE = (360, 81), (72, 51)
"""Numbers of even aspects over a full turn and of even offsets over the width: of an outline that
the sensor sees as it is, and of one that it sees blurred.

A turn of 5 degrees brings 0.4 m of a car's side into view, so the outline takes a degree.
"""

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

    @property
    def extents(self) -> np.ndarray:
        """Length and width (2,) m of what is seen."""
        widths = self.high - self.low
        return widths[[len(widths) // 4, 0]]

    def arrays(self) -> tuple[np.ndarray, ...]:
        """The arrays in the order in which `expected` takes them."""
        return tuple(vars(self).values())


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


def expected(
    states: np.ndarray,
    sensor: np.ndarray,
    directions: np.ndarray,
    first: int,
    last: int,
    *table: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Ranges and silhouettes that states of a target predict for the rays of a scan.

    `states` (S, 5): x, y, heading, and the logarithms of the factors on length and width;
    `sensor` (2,) m; `directions` (n, 2) unit vectors of the rays in the world; `first`, `last` the
    indices of the rays with the least and the greatest bearing; then `RayTable.arrays`. With an
    index of -1 the inset and its standard deviation are not computed: their values are undefined.

    Returns:
        ranges (S, n) m; insets (S, 2) m, how far inside the shape's seen limits the first and the
        last ray pass; misses (S, n) m, how far outside of them each ray passes, negative inside;
        range_stds (n,) m and inset_stds (2,) m of the first state.
    """
    count, rays = len(states), len(directions)
    ranges, misses = np.empty((count, rays)), np.empty((count, rays))
    insets, range_stds, inset_stds = np.empty((count, 2)), np.empty(rays), np.empty(2)
    results = ranges, insets, misses, range_stds, inset_stds
    _expect(*results, states, sensor, directions, first, last, *table)
    return results


@njit(cache=True, error_model="numpy")
def _expect(
    ranges,
    insets,
    misses,
    range_stds,
    inset_stds,
    states,
    sensor,
    directions,
    first,
    last,
    lowest,
    highest,
    depths,
    stds,
    low,
    high,
    low_stds,
    high_stds,
):
    """Write `expected`."""
    count, rays = states.shape[0], directions.shape[0]
    rows, columns = depths.shape
    for s in range(count):
        cosine, sine = cos(states[s, 2]), sin(states[s, 2])
        shrink_x, shrink_y = exp(-states[s, 3]), exp(-states[s, 4])
        dx, dy = sensor[0] - states[s, 0], sensor[1] - states[s, 1]
        from_x, from_y = (cosine * dx + sine * dy) * shrink_x, (cosine * dy - sine * dx) * shrink_y
        for i in range(rays):
            ux = (cosine * directions[i, 0] + sine * directions[i, 1]) * shrink_x
            uy = (cosine * directions[i, 1] - sine * directions[i, 0]) * shrink_y
            # Metres of the scaled frame per metre of the world, along this ray.
            scale = sqrt(ux * ux + uy * uy)
            ux, uy = ux / scale, uy / scale
            # Metres of the world per metre of the scaled frame, across: areas scale alike.
            across = scale / (shrink_x * shrink_y)
            offset = ux * from_y - uy * from_x
            foot = -(ux * from_x + uy * from_y)

            position = atan2(-uy, -ux) / (2.0 * pi) * rows
            position = position % rows
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
            g = column - c
            ranges[s, i] = (foot + _between(depths, a, b, f, c, g)) / scale

            begin = low[a] * (1.0 - f) + low[b] * f
            stop = high[a] * (1.0 - f) + high[b] * f
            inside_low, inside_high = (offset - begin) * across, (stop - offset) * across
            misses[s, i] = -min(inside_low, inside_high)
            if i == first:
                insets[s, 0] = inside_low
            if i == last:
                insets[s, 1] = inside_high
            if s == 0:
                range_stds[i] = _between(stds, a, b, f, c, g)
                if i == first:
                    inset_stds[0] = low_stds[a] * (1.0 - f) + low_stds[b] * f
                if i == last:
                    inset_stds[1] = high_stds[a] * (1.0 - f) + high_stds[b] * f


@njit(cache=True, error_model="numpy")
def _between(values, a, b, f, c, g):
    """Bilinear between rows `a` and `b`, and column `c` and the next, by the shares f and g."""
    first = values[a, c] * (1.0 - g) + values[a, c + 1] * g
    return first * (1.0 - f) + (values[b, c] * (1.0 - g) + values[b, c + 1] * g) * f
