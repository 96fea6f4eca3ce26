"""Where one ray a pixel is not enough: edges of surfaces and of shadows."""

import numpy as np
from numba import njit

from stixel_cli.scene.surfaces import srgb_from_linear
from stixel_cli.scene.tracing import Body, Hits

EDGE_CONTRAST = 5
"""Neighbours that differ by no more grey levels than this need no further samples."""

EDGE_BEND = 0.9
"""Neighbouring triangles of one texture whose normals' scalar product is less make an edge."""

EDGE_JUMP = 0.05
"""Neighbours of one texture whose depths differ by more than this share make an edge."""


def edge_pixels(
    bodies: list[Body], hits: Hits, lit: np.ndarray, plain: np.ndarray, rows: int
) -> np.ndarray:
    """Indices of the pixels that show an edge of surface or shadow.

    Args:
        bodies: what `hits` counts.
        hits, lit: what the pixels' centres (n,) meet, and whether it sees the sun.
        plain: (n, 3) linear light there.
        rows: of the image, in row-major order.
    """
    label = np.full(len(lit), -1, dtype=np.int64)
    normals = np.zeros((len(lit), 3), dtype=np.float32)
    for index, body in enumerate(bodies):
        mine = np.flatnonzero(hits.body == index)
        triangle = hits.triangle[mine]
        label[mine] = (body.surfaces.texture[triangle] * len(bodies) + index) * 2 + lit[mine]
        normals[mine] = body.surfaces.normals[triangle]
    shape = rows, len(lit) // rows
    mask = edge_mask(
        label.reshape(shape),
        hits.triangle.reshape(shape),
        normals.reshape(*shape, 3),
        hits.depth.reshape(shape),
        srgb_from_linear(plain).reshape(*shape, 3),
        EDGE_CONTRAST,
        EDGE_BEND,
        EDGE_JUMP,
    )
    return np.flatnonzero(mask)


@njit(cache=True, nogil=True)
def edge_mask(label, triangle, normals, depth, grey, contrast, bend, jump):
    """(h, w) bool: pixels that differ from a neighbour (of four) in more than texture.

    Inside one surface the texture's own filter is enough, and an edge that nobody sees needs no
    further samples. So it takes another label, or another triangle that is bent against this one or
    lies apart from it; and colours that differ.

    Args:
        label: (h, w) int64, tells textures, bodies and light from shadow apart.
        triangle: (h, w) int32.
        normals: (h, w, 3) float32.
        depth: (h, w) float64 m.
        grey: (h, w, 3) uint8.
        contrast: least difference of colours, grey levels.
        bend: neighbours whose normals' scalar product is below this are bent.
        jump: least relative difference of depths that lie apart.
    """
    rows, columns = label.shape
    mask = np.zeros((rows, columns), dtype=np.bool_)
    for row in range(rows):
        for column in range(columns):
            for down, right in ((0, 1), (1, 0)):
                r, c = row + down, column + right
                if r >= rows or c >= columns:
                    continue
                if label[row, column] == label[r, c]:
                    if triangle[row, column] == triangle[r, c]:
                        continue
                    one, two = normals[row, column], normals[r, c]
                    near, far = depth[row, column], depth[r, c]
                    if one[0] * two[0] + one[1] * two[1] + one[2] * two[2] >= bend and abs(
                        near - far
                    ) <= jump * min(near, far):
                        continue
                for channel in range(3):
                    difference = np.int64(grey[row, column, channel]) - grey[r, c, channel]
                    if abs(difference) > contrast:
                        mask[row, column] = True
                        mask[r, c] = True
    return mask
