"""Where one ray a pixel is not enough: edges of surfaces and of shadows.

The kernels get the hits (n,) of the pixels' centres in row-major order, as `Hits` has them, and the
tables of `Shot.tables`.
"""

import numpy as np
from numba import njit

from stixel_cli.geometry.kernel import returning

EDGE_CONTRAST = 5
"""Neighbours that differ by no more grey levels than this need no further samples."""

EDGE_BEND = 0.9
"""Neighbouring triangles of one texture whose normals' scalar product is less make an edge."""

EDGE_JUMP = 0.05
"""Neighbours of one texture whose depths differ by more than this share make an edge."""

FLAT = 0.99
"""Neighbours whose normals' scalar product is less are tested for sunlight one by one."""


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
