"""The ground of the town square: asphalt, lane marks, patches, covers, raised pavements."""

from collections.abc import Iterable

import numpy as np

from stixel_cli.scene.mesh import Mesh, Part
from stixel_cli.scene.shapes import box, part
from stixel_cli.scene.textures import asphalt, mottled, paving

REACH = 150.0
"""The asphalt reaches as far as this from the origin, m."""

KERB = 0.08
"""Height of a pavement, m."""

MARK = 0.004
"""Height of marks above the asphalt, m, so that no renderer confuses the two."""

PAVEMENTS = (
    # x0, y0, x1, y1, m: before the houses on either side of the street, and about the square.
    (-60.0, 31.6, -5.2, 36.0),
    (5.2, 31.6, 60.0, 36.0),
    (-8.0, 36.0, -5.2, 96.0),
    (5.2, 36.0, 8.0, 96.0),
    (-24.0, -18.0, -18.6, 31.6),
    (18.6, -18.0, 24.0, 31.6),
    (-18.6, -18.0, 18.6, -13.0),
)


def ground(contrast: float) -> Mesh:
    """All that is kind "road": its parts are flat, or steps of `KERB`."""
    white = mottled("lane mark", (226, 226, 220), 0.10 + 0.10 * contrast)
    tarred = asphalt(contrast)
    dark = (0.55 * tarred).astype(np.uint8)
    iron = mottled("iron", (88, 84, 82), 0.15 + 0.20 * contrast, coarsest=8.0)
    stones = paving(contrast)
    kerb = mottled("kerb", (168, 166, 160), 0.05 + 0.15 * contrast)
    return Mesh(
        (
            flat("asphalt", [(-REACH, -REACH, REACH, REACH)], 0.0, tarred, 7.3),
            flat("patches", _patches(), 0.5 * MARK, dark, 5.1),
            flat("marks", _marks(), MARK, white, 1.0),
            flat("covers", [(2.1, 14.2, 2.8, 14.9), (-3.4, 21.0, -2.7, 21.7)], MARK, iron, 0.7),
            flat("pavements", PAVEMENTS, KERB, stones, 4.0),
            part("kerbs", [box((x0, y0, 0.0), (x1, y1, KERB - 0.001)) for x0, y0, x1, y1 in
                           PAVEMENTS], kerb, 1.3),
        )
    )  # fmt: skip


def flat(
    name: str,
    rectangles: Iterable[tuple[float, float, float, float]],
    height: float,
    texture: np.ndarray,
    tile: float,
) -> Part:
    """Level rectangles (x0, y0, x1, y1) m, seen from above, `tile` m a repetition."""
    vertices, triangles = [], []
    for x0, y0, x1, y1 in rectangles:
        base = len(vertices)
        vertices += [(x0, y0, height), (x1, y0, height), (x1, y1, height), (x0, y1, height)]
        triangles += [(base, base + 1, base + 2), (base, base + 2, base + 3)]
    vertices = np.array(vertices, dtype=np.float64)
    triangles = np.array(triangles, dtype=np.int32)
    uvs = vertices[triangles][:, :, :2] / tile
    return Part(vertices, triangles, uvs, texture, name)


def _marks():
    """Lane marks: the street's middle, a zebra crossing, parking bays at the square's sides."""
    street = [(-0.08, y, 0.08, y + 3.0) for y in np.arange(36.0, 94.0, 6.0)]
    zebra = [(x, 28.9, x + 0.5, 31.9) for x in np.arange(-4.75, 4.5, 1.0)]
    stop = [(0.3, 33.0, 4.9, 33.4)]
    bays = []
    for side in (-1.0, 1.0):
        near, far = sorted((side * 13.3, side * 18.3))
        bays += [(near, y - 0.06, far, y + 0.06) for y in np.arange(-11.0, 26.0, 2.7)]
        edge = side * 13.3
        bays.append((edge - 0.06, -11.0, edge + 0.06, 24.1))
    # Guides over the square: the lane that leads from the ego car's side to the street.
    guides = [(x - 0.07, y, x + 0.07, y + 1.5) for x in (-4.0, 0.0, 4.0)
              for y in np.arange(-10.0, 27.0, 3.0)]  # fmt: skip
    return street + zebra + stop + bays + guides


def _patches():
    """Mended asphalt: dark rectangles, which break up the repetition of the texture."""
    return [
        (-7.5, 9.0, -4.6, 14.5),
        (1.2, 6.2, 2.4, 9.4),
        (3.2, 19.5, 8.4, 21.0),
        (-1.6, 23.2, 3.5, 24.6),
        (-11.0, 24.0, -6.2, 25.0),
        (8.8, 11.0, 10.2, 26.0),
        (-2.8, 3.0, -1.6, 6.0),
        (-4.6, 38.0, -1.0, 47.0),
        (1.5, 55.0, 4.6, 61.0),
    ]
