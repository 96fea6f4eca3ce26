"""Colours of pixels at edges, from many samples in each.

A rasteriser finds what each sample shows. The light and the way to the sun are computed once for
each distinct triangle of a pixel, at the mean of its samples, and weighted by how many it has.
"""

from typing import NamedTuple

import numpy as np

from stixel_cli.rendering.rasteriser import fragments, rasterise
from stixel_cli.rendering.tracing import Hits, Shot, light_of, sunlit

SHADOW_PARTS = 2
"""Where a shadow's edge may be in a pixel, this many parts along each axis ask for the sun."""

BLOCK = 1 << 20
"""At most this many samples in memory at a time; each takes 12 bytes, and 57 in the worst case."""


def sample_offsets(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (n²,) right and down of a pixel's n² samples from its centre, px; n = `samples`.

    One sample in each cell of n × n, and no two in one of n² columns or of n² rows: an edge along
    an axis, the commonest, gets n² shades and not n. For n = 2 this is the rotated grid.
    """
    row, column = np.divmod(np.arange(samples * samples), samples)
    fine = samples * samples
    down = (row * samples + column + 0.5) / fine - 0.5
    right = (column * samples + (samples - 1 - row) + 0.5) / fine - 0.5
    return right, down


class Centres(NamedTuple):
    """Values of pixels (n,) from the ray through the centre of each."""

    rows: np.ndarray
    columns: np.ndarray
    """`rows`, `columns`: (n,) int64."""
    hits: Hits
    """What is met."""
    lit: np.ndarray
    """(n,) bool, whether it sees the sun."""
    light: np.ndarray
    """(n, 3) float32, linear light."""

    def at(self, index: np.ndarray | slice) -> "Centres":
        """The values of the pixels with the indices `index`."""
        rows, columns, hits, *others = self
        chosen = rows[index], columns[index], hits.at(index)
        return Centres(*chosen, *(values[index] for values in others))


def rasterised(
    shot: Shot, rows: np.ndarray, columns: np.ndarray, offsets: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Surfaces that the samples of pixels show: the rasteriser's answer to `tracing.nearest`.

    Inverse depths (n, s) float64 1/m, 0 where nothing is seen; and triangles (n, s) int32, counted
    through all bodies, -1 where nothing is seen. The pixels at `rows` and `columns` (n,) are
    distinct, inside the image, in row-major order; `offsets` are those of `sample_offsets`.
    """
    camera, first = shot.camera, 0
    inverse = np.zeros((len(rows), len(offsets[0])))
    triangles = np.full(inverse.shape, -1, dtype=np.int32)
    preceding = np.zeros(camera.height * camera.width + 1, dtype=np.int32)
    preceding[rows * camera.width + columns + 1] = 1
    np.cumsum(preceding, out=preceding)
    pixels = columns, preceding, camera.width
    for body in shot.bodies:
        seen, corners = camera.seen_from(body.world_from_body), body.surfaces.corners
        results = inverse, triangles, np.zeros(len(rows)), *np.empty((2, 3, 3))
        pinhole = (seen.projection, *seen.pinhole[1:])
        rasterise(results, first, corners, pinhole, pixels, offsets)
        first += len(corners)
    return inverse, triangles


def supersampled(shot: Shot, centres: Centres, at_shadow: np.ndarray, samples: int) -> np.ndarray:
    """Linear light (n, 3) float32 of pixels (n,) in row-major order, from `samples`² in each.

    `at_shadow` (n,) is true if a shadow's edge may be in the pixel.
    """
    result = np.empty((len(centres.rows), 3), dtype=np.float32)
    step = BLOCK // samples**2
    for start in range(0, len(result), step):
        block = slice(start, start + step)
        result[block] = _block(shot, centres.at(block), at_shadow[block], samples)
    return result


def _block(shot: Shot, centres: Centres, at_shadow: np.ndarray, samples: int) -> np.ndarray:
    """As `supersampled`, all pixels at a time."""
    offsets = sample_offsets(samples)
    seen = rasterised(shot, centres.rows, centres.columns, offsets)
    # Memory that is not written is not taken.
    types = np.int64, np.int64, np.float64, np.float64, np.float64, np.int8, np.int32
    results = tuple(np.empty(seen[0].size, dtype) for dtype in types)
    memory = np.empty(samples**2, dtype=np.int32), np.empty(samples**2, dtype=np.int64)
    second = len(shot.bodies[0].surfaces.corners)
    pixels = centres.rows, centres.columns, at_shadow
    count = fragments(results, memory, seen, second, pixels, (*offsets, _parts(samples)))
    pixel, covered, *values = (result[:count] for result in results)
    hits = Hits(*values)
    # The centre's way to the sun is that of its whole triangle, where no shadow's edge is near.
    same = (hits.body == centres.hits.body[pixel]) & (hits.triangle == centres.hits.triangle[pixel])
    lit = centres.lit[pixel]
    asked = np.flatnonzero((~same | at_shadow[pixel]) & (hits.body >= 0))
    lit[asked] = sunlit(shot, hits.at(asked), range(len(shot.bodies)))
    colours = light_of(shot, hits, lit, np.sqrt(covered) / samples)
    weights = (covered / samples**2).astype(np.float32)
    starts = np.searchsorted(pixel, np.arange(len(centres.rows)))
    return np.add.reduceat(weights[:, None] * colours, starts, axis=0)


def _parts(samples: int) -> np.ndarray:
    """The part of the pixel, one of `SHADOW_PARTS`², in which each of `samples`² samples is."""
    row, column = np.divmod(np.arange(samples**2), samples)
    parts = min(samples, SHADOW_PARTS)
    return row * parts // samples * parts + column * parts // samples
