"""Pixels at edges of surfaces and of shadows, where one ray is not enough, and their colours.

The kernels that find them get the hits (n,) of the pixels' centres in row-major order, as `Hits`
has them, and the tables of `Shot.tables`. A rasteriser finds what each of many samples shows. The
light and the way to the sun are computed once for each distinct triangle of a pixel, at the mean of
its samples, and weighted by how many it has.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning
from stixel_cli.rendering.rasteriser import fragments, rasterise
from stixel_cli.rendering.tracing import Hits, Shot, light_of, sunlit

EDGE_CONTRAST = 5
"""Neighbours that differ by no more grey levels than this need no further samples."""

EDGE_BEND = 0.9
"""Neighbouring triangles of one texture whose normals' scalar product is less make an edge."""

EDGE_JUMP = 0.05
"""Neighbours of one texture whose depths differ by more than this share make an edge."""

FLAT = 0.99
"""Neighbours whose normals' scalar product is less are tested for sunlight one by one."""

SHADOW_PARTS = 2
"""Where a shadow's edge may be in a pixel, this many parts along each axis ask for the sun."""

BLOCK = 1 << 20
"""At most this many samples in memory at a time; each takes 12 bytes, and 57 in the worst case."""


@njit(inline="always")
def _continues(pixel, other, hits, tables, bend):
    """Whether `pixel` and `other` show one surface: no other body or texture, no bend or gap."""
    _, _, depth, body, triangle = hits
    texture0, normals0, texture1, normals1 = tables
    if body[pixel] != body[other]:
        return False
    a, b = triangle[pixel], triangle[other]
    texture, normals = (texture1, normals1) if body[pixel] == 1 else (texture0, normals0)
    if texture[a] != texture[b]:
        return False
    product = 0.0
    for axis in range(3):
        product += normals[a, axis] * normals[b, axis]
    near, far = min(depth[pixel], depth[other]), max(depth[pixel], depth[other])
    return product >= bend and far - near <= EDGE_JUMP * near


@njit(inline="always")
def _contrasts(pixel, other, colours):
    """Whether the colours of two pixels differ by more than `EDGE_CONTRAST` grey levels."""
    for channel in range(3):
        difference = np.int64(colours[pixel, channel]) - np.int64(colours[other, channel])
        if abs(difference) > EDGE_CONTRAST:
            return True
    return False


@returning(lambda hits, *_: np.zeros((2, len(hits.u)), dtype=bool))
@njit(cache=True, nogil=True, error_model="numpy")
def edge_pixels(masks, hits, tables, lit, colours, width):
    """Masks (2, n) bool: pixels that show an edge, of a surface or a shadow; near a shadow's edge.

    Inside one surface the texture's own filter is enough, and an invisible edge needs no
    further samples. So an edge needs another surface or another light than that of a neighbour (of
    four), and colours that differ. Where lit and unlit pixels of one surface meet, there is a
    shadow's edge.

    Args:
        hits, tables: see the module.
        lit: (n,) bool, whether the pixel's centre sees the sun.
        colours: (n, 3) uint8 sRGB there.
        width: of the image, px.
    """
    edge, at_shadow = masks[0], masks[1]
    _, _, _, body, triangle = hits
    count = len(body)
    column = -1
    for pixel in range(count):
        column = column + 1 if column < width - 1 else 0
        for step in (1, width):
            other = pixel + step
            if other >= count or (step == 1 and column == width - 1):
                continue
            other_light = lit[pixel] != lit[other]
            one_triangle = body[pixel] == body[other] and triangle[pixel] == triangle[other]
            if one_triangle and not other_light:
                continue
            same = _continues(pixel, other, hits, tables, EDGE_BEND)
            if other_light and same:
                at_shadow[pixel] = at_shadow[other] = True
            if (other_light or not same) and _contrasts(pixel, other, colours):
                edge[pixel] = edge[other] = True


@returning(lambda hits, *_: np.zeros(len(hits.u), dtype=bool))
@njit(cache=True, nogil=True, error_model="numpy")
def unclear_pixels(unclear, hits, tables, lit, width):
    """Let the odd fields of a chequer-board take `lit` from their neighbours.

    Right on the even fields, `lit` (n,) bool gets that of the four neighbours of an odd field where
    all continue its surface and agree. The result (n,) bool are the odd fields that meet something
    and stay unknown. The other arguments are those of `edge_pixels`.
    """
    _, _, _, body, triangle = hits
    count = len(body)
    column, row = -1, 0
    for pixel in range(count):
        column += 1
        if column == width:
            column, row = 0, row + 1
        if (row + column) & 1 == 0 or body[pixel] < 0:
            continue
        agreed = lit[pixel - 1]
        clear = 0 < column < width - 1 and width <= pixel < count - width
        if clear:
            for step in (-1, 1, -width, width):
                other = pixel + step
                same = triangle[pixel] == triangle[other] and body[pixel] == body[other]
                same = same or _continues(pixel, other, hits, tables, FLAT)
                if lit[other] != agreed or not same:
                    clear = False
                    break
        if clear:
            lit[pixel] = agreed
        else:
            unclear[pixel] = True


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
