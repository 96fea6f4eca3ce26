"""Where one ray a pixel is not enough: edges of surfaces and of shadows."""

import numpy as np
from numba import njit

from stixel_cli.rendering.surfaces import ENCODE
from stixel_cli.rendering.tracing import Body, Hits

EDGE_CONTRAST = 5
"""Neighbours that differ by no more grey levels than this need no further samples."""

EDGE_BEND = 0.9
"""Neighbouring triangles of one texture whose normals' scalar product is less make an edge."""

EDGE_JUMP = 0.05
"""Neighbours of one texture whose depths differ by more than this share make an edge."""

FLAT = 0.99
"""Neighbours whose normals' scalar product is less are tested for sunlight one by one."""


def edge_pixels(
    bodies: tuple[Body, ...], hits: Hits, lit: np.ndarray, light: np.ndarray, rows: int
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels that show an edge of surface or shadow, and pixels where a shadow's edge may be.

    Args:
        bodies: the one or two that `hits` counts.
        hits, lit: what the pixels' centres (n,) meet, and whether it sees the sun.
        light: (n, 3) float32, linear light there.
        rows: of the image, in row-major order.

    Returns:
        Two masks (n,) bool.
    """
    edge, at_shadow = np.zeros((2, len(lit)), dtype=bool)
    surfaces = (hits.body, hits.triangle, hits.depth), _tables(bodies)
    limits = (ENCODE, EDGE_CONTRAST, EDGE_BEND, EDGE_JUMP)
    _mark_edges(edge, at_shadow, len(lit) // rows, *surfaces, lit, light, *limits)
    return edge, at_shadow


def unclear_pixels(bodies: tuple[Body, ...], hits: Hits, lit: np.ndarray, rows: int) -> np.ndarray:
    """Let the odd fields of a chequer-board take `lit` from their neighbours.

    Args:
        bodies, hits, rows: as for `edge_pixels`.
        lit: (n,) bool, right on the even fields; where all four neighbours of an odd field
            continue its surface and agree, theirs is written.

    Returns:
        Indices of the odd fields that meet something and stay unknown.
    """
    unclear = np.empty(len(lit), dtype=np.int64)
    surfaces = (hits.body, hits.triangle, hits.depth), _tables(bodies)
    count = _spread_light(unclear, len(lit) // rows, *surfaces, lit, FLAT, EDGE_JUMP)
    return unclear[:count]


def _tables(bodies: tuple[Body, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Texture and normals of the first body's triangles, and of the last one's."""
    first, last = bodies[0].surfaces, bodies[-1].surfaces
    return first.texture, first.normals, last.texture, last.normals


@njit(inline="always")
def _continues(pixel, other, hits, tables, bend, jump):
    """Whether `pixel` and `other` show one surface: no other body or texture, no bend or gap."""
    body, triangle, depth = hits
    texture0, normals0, texture1, normals1 = tables
    if body[pixel] != body[other]:
        return False
    a, b = triangle[pixel], triangle[other]
    texture, normals = texture0, normals0
    if body[pixel] == 1:
        texture, normals = texture1, normals1
    if texture[a] != texture[b]:
        return False
    product = (
        normals[a, 0] * normals[b, 0]
        + normals[a, 1] * normals[b, 1]
        + normals[a, 2] * normals[b, 2]
    )
    near, far = min(depth[pixel], depth[other]), max(depth[pixel], depth[other])
    return product >= bend and far - near <= jump * near


@njit(inline="always")
def _contrasts(pixel, other, light, encode, contrast):
    """Whether the colours of two pixels differ by more than `contrast` grey levels."""
    top = np.float32(len(encode) - 1)
    half, unit, zero = np.float32(0.5), np.float32(1.0), np.float32(0.0)
    for channel in range(3):
        a = min(max(light[pixel, channel], zero), unit)
        b = min(max(light[other, channel], zero), unit)
        difference = np.int64(encode[np.int64(a * top + half)])
        difference -= np.int64(encode[np.int64(b * top + half)])
        if abs(difference) > contrast:
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _mark_edges(edge, at_shadow, width, hits, tables, lit, light, encode, contrast, bend, jump):
    """Set the pixels of `edge_pixels` in its two masks (n,) bool.

    Inside one surface the texture's own filter is enough, and an invisible edge needs no
    further samples. So an edge needs another surface or another light than that of a neighbour (of
    four), and colours that differ. Where lit and unlit pixels of one surface meet, there is a
    shadow's edge.

    Args:
        width: of the image.
        hits: body, triangle and depth (n,) of the pixels in row-major order, as `Hits` has them.
        tables: of `_tables`.
        lit, light: (n,) bool and (n, 3) float32, of the same pixels.
        encode: (m,) uint8, sRGB of linear light.
        contrast: least difference of colours, grey levels.
        bend: neighbours whose normals' scalar product is below this are bent.
        jump: least relative difference of two depths that make an edge.
    """
    body, triangle, _ = hits
    count = len(body)
    column = -1
    for pixel in range(count):
        column = column + 1 if column < width - 1 else 0
        for step in (1, width):
            other = pixel + step
            if other >= count or (step == 1 and column == width - 1):
                continue
            other_light = lit[pixel] != lit[other]
            if (
                body[pixel] == body[other]
                and triangle[pixel] == triangle[other]
                and not other_light
            ):
                continue
            same = _continues(pixel, other, hits, tables, bend, jump)
            if other_light and same:
                at_shadow[pixel] = at_shadow[other] = True
            if (other_light or not same) and _contrasts(pixel, other, light, encode, contrast):
                edge[pixel] = edge[other] = True


@njit(cache=True, nogil=True, error_model="numpy")
def _spread_light(unclear, width, hits, tables, lit, bend, jump):
    """Write the indices of `unclear_pixels`, and to `lit`; return how many indices there are.

    The other arguments are those of `_mark_edges`.
    """
    body, triangle, _ = hits
    count = len(body)
    written = 0
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
                if (
                    lit[other] == agreed
                    and triangle[pixel] == triangle[other]
                    and body[pixel] == body[other]
                ):
                    continue
                if lit[other] != agreed or not _continues(pixel, other, hits, tables, bend, jump):
                    clear = False
                    break
        if clear:
            lit[pixel] = agreed
        else:
            unclear[written] = pixel
            written += 1
    return written
