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
from functools import cached_property, lru_cache

import numpy as np

from stixel_cli.geometry.kernel import first_hits

TABLE = 360, 81
"""Numbers of even aspects over a full turn and of even offsets over the width.

A turn of 5 degrees brings 0.4 m of a car's side into view: with 72 aspects, stixels of the side of
a car that comes nearer were 0.3 m behind what was expected, and moved it 5 cm aside.
"""

REACH = 1.25
"""The table's offsets reach this far, in halves of the outline's width at the aspect."""


@dataclass(frozen=True)
class RayTable:
    """Depths and limits of a shape, over A even aspects from 0 on and O offsets."""

    lowest: np.ndarray
    highest: np.ndarray
    """`lowest`, `highest`: (A,) m, offsets of the table's first and last column."""
    depths: np.ndarray
    """(A, O) m, where the sensor measures the shape."""
    stds: np.ndarray
    """(A, O) m, standard deviation of one point's depth."""
    low: np.ndarray
    high: np.ndarray
    """`low`, `high`: (A,) m, offsets at which the sensor sees the shape begin and end."""
    low_stds: np.ndarray
    high_stds: np.ndarray
    """`low_stds`, `high_stds`: (A,) m, their standard deviations."""

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


def outermost_radii(polygon: np.ndarray, count: int) -> np.ndarray:
    """Distances (count,) m of the outermost points of a polygon (n, 2) m, at even angles."""
    return np.maximum(-first_depths(polygon, even_aspects(count), np.zeros((count, 1)))[:, 0], 0.0)


def outline_table(outline: np.ndarray) -> RayTable:
    """The table of a sensor that sees the outline (M, 2) m exactly; all its stds are 0."""
    return _table_of(outline.tobytes())


@lru_cache(maxsize=64)
def _table_of(content: bytes) -> RayTable:
    """`outline_table`, which takes as long as some scans, once for each outline."""
    outline = np.frombuffer(content).reshape(-1, 2)
    angles = even_aspects(TABLE[0])
    low, high = widths(outline, angles)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    lowest, highest = middle - REACH * half, middle + REACH * half
    share = np.linspace(0.0, 1.0, TABLE[1])
    offsets = lowest[:, None] + share * (highest - lowest)[:, None]
    depths = first_depths(outline, angles, offsets)
    exact = np.zeros(TABLE[0])
    return RayTable(lowest, highest, depths, np.zeros_like(depths), low, high, exact, exact)
