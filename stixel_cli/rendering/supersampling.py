"""Colours of pixels at edges, from many samples in each.

A rasteriser finds what each sample shows. The light and the way to the sun are computed once for
each distinct triangle of a pixel, at the mean of its samples, and weighted by how many it has.
"""

from dataclasses import dataclass

import numpy as np

from stixel_cli.rendering.camera_rays import Camera
from stixel_cli.rendering.rasteriser import fragments, rasterise
from stixel_cli.rendering.tracing import Body, Hits, light_of, sunlit
from stixel_cli.scene.world_parameters import Light

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


@dataclass(frozen=True)
class Centres:
    """Values of pixels (n,) from the ray through the centre of each.

    Attributes:
        rows, columns: (n,) int64.
        hits: what is met.
        lit: (n,) bool, whether it sees the sun.
        light: (n, 3) float32, linear light.
    """

    rows: np.ndarray
    columns: np.ndarray
    hits: Hits
    lit: np.ndarray
    light: np.ndarray

    def at(self, index: np.ndarray | slice) -> "Centres":
        """Those of the pixels with the indices `index`."""
        return Centres(
            self.rows[index],
            self.columns[index],
            self.hits.at(index),
            self.lit[index],
            self.light[index],
        )


def rasterised(
    bodies: list[Body],
    camera: Camera,
    rows: np.ndarray,
    columns: np.ndarray,
    right: np.ndarray,
    down: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """What the samples of pixels show: the rasteriser's answer to `tracing.nearest`.

    Args:
        bodies: with their poses.
        camera: in the world.
        rows, columns: (n,) of the pixels, distinct, inside the image, in row-major order.
        right, down: (s,) px, the samples' offsets from a pixel's centre.

    Returns:
        Inverse depths (n, s) float64 1/m, 0 where nothing is seen; and triangles (n, s) int32,
        counted through all bodies; -1 where nothing is seen.
    """
    inverse = np.zeros((len(rows), len(right)))
    found = np.full(inverse.shape, -1, dtype=np.int32)
    preceding = np.zeros(camera.height * camera.width + 1, dtype=np.int32)
    preceding[rows * camera.width + columns + 1] = 1
    np.cumsum(preceding, out=preceding)
    pixels = columns, preceding, camera.width
    first = 0
    for body in bodies:
        corners = body.surfaces.corners
        seen = camera.seen_from(body.world_from_body)
        pinhole = seen.projection, seen.origin, seen.focal, seen.u0, seen.v0
        rasterise(inverse, found, first, corners, *pinhole, *pixels, right, down)
        first += len(corners)
    return inverse, found


def supersampled(
    bodies: list[Body],
    camera: Camera,
    centres: Centres,
    at_shadow: np.ndarray,
    sun: np.ndarray,
    light: Light,
    samples: int,
) -> np.ndarray:
    """Linear light (n, 3) float32 of pixels (n,) in row-major order, from `samples`² in each.

    `sun` (3,) points to the sun in the world. `at_shadow` (n,) is true if a shadow's edge may
    be in the pixel.
    """
    result = np.empty((len(centres.rows), 3), dtype=np.float32)
    step = BLOCK // samples**2
    for start in range(0, len(result), step):
        block = slice(start, start + step)
        result[block] = _block(
            bodies, camera, centres.at(block), at_shadow[block], sun, light, samples
        )
    return result


def _block(bodies, camera, centres, at_shadow, sun, light, samples) -> np.ndarray:
    """As `supersampled`, all pixels at a time."""
    right, down = sample_offsets(samples)
    inverse, found = rasterised(bodies, camera, centres.rows, centres.columns, right, down)
    second = len(bodies[0].surfaces.corners)
    parts = _parts(samples)
    pixel, covered, u, v, *hits = fragments(
        found, inverse, second, centres.rows, centres.columns, parts, at_shadow, right, down
    )
    hits = Hits(*hits)
    # The centre's way to the sun is that of its whole triangle, where no shadow's edge is near.
    same = (hits.body == centres.hits.body[pixel]) & (hits.triangle == centres.hits.triangle[pixel])
    lit = centres.lit[pixel]
    asked = np.flatnonzero((~same | at_shadow[pixel]) & (hits.body >= 0))
    lit[asked] = sunlit(bodies, camera, u[asked], v[asked], hits.at(asked), sun, range(len(bodies)))
    spread = np.sqrt(covered) / samples
    colours = light_of(bodies, camera, u, v, hits, lit, sun, light, spread)
    weights = (covered / samples**2).astype(np.float32)
    starts = np.searchsorted(pixel, np.arange(len(centres.rows)))
    return np.add.reduceat(weights[:, None] * colours, starts, axis=0)


def _parts(samples: int) -> np.ndarray:
    """The part of the pixel, one of `SHADOW_PARTS`², in which each of `samples`² samples is."""
    row, column = np.divmod(np.arange(samples**2), samples)
    parts = min(samples, SHADOW_PARTS)
    return row * parts // samples * parts + column * parts // samples
