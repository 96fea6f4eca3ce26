"""The surroundings: ground, houses, trees, lamp posts, signs, hedges, fences, parked cars, woods …

A function makes one object in the world's axes, standing on z = 0. Textures are (h, w, 3) uint8
RGB.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from stixel_cli.scene import car
from stixel_cli.scene.mesh import Mesh, Part, fitted, moved
from stixel_cli.scene.shapes import box, ellipsoid, lathe, loft, part, quads_to_triangles, tube
from stixel_cli.scene.textures import Colour, asphalt, facade, leaves, mottled, paving, roof_tiles

WALLS = (
    # colour, and whether it is of bricks
    ((214, 190, 140), False),
    ((168, 92, 74), True),
    ((206, 202, 192), False),
    ((150, 168, 176), False),
    ((190, 146, 116), True),
)


class Materials:
    """Textures of houses, trees and posts that both worlds have, for a `seed` and a `contrast`."""

    def __init__(self, seed: int, contrast: float):
        self.fronts = [
            facade(f"front {seed} {i}", colour, 2 + i % 2, brick, contrast)
            for i, (colour, brick) in enumerate(WALLS)
        ]
        self.roof = roof_tiles("roof red", (150, 78, 58), contrast)
        self.bark = mottled("bark", (92, 76, 60), 0.10 + 0.3 * contrast, coarsest=3.0)
        self.leaves = leaves("leaves", (86, 112, 52), contrast)
        self.metal = mottled("post", (106, 112, 112), 0.08 + 0.20 * contrast, coarsest=3.0)
        self.glass = mottled("lamp glass", (226, 222, 204), 0.08)
        self.woods = leaves("woods", (74, 96, 56), contrast)


def house(
    low: ArrayLike, high: ArrayLike, height: float, front: np.ndarray, roof: np.ndarray, ridge: str
) -> Mesh:
    """A house with a gabled roof and a chimney.

    Args:
        low, high: corners of its footprint, (2,) m.
        height: of the walls, m.
        front: texture of each wall, laid on once about every 8 m.
        roof: texture of the roof, 4 m a tile.
        ridge: the ridge's axis, "x" or "y".
    """
    (x0, y0), (x1, y1) = low, high
    ring = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    vertices, uvs = [], []
    for i in range(4):
        (xa, ya), (xb, yb) = ring[i], ring[(i + 1) % 4]
        repeats = max(1.0, np.round(np.hypot(xb - xa, yb - ya) / 8.0))
        vertices += [(xa, ya, 0.0), (xb, yb, 0.0), (xb, yb, height), (xa, ya, height)]
        lower_left, lower_right = (0.0, 1.0), (repeats, 1.0)
        upper_right, upper_left = (repeats, 0.0), (0.0, 0.0)
        uvs += [(lower_left, lower_right, upper_right), (lower_left, upper_right, upper_left)]
    triangles = quads_to_triangles(np.arange(len(vertices)))
    walls = Part(np.array(vertices), triangles, np.array(uvs), front, "walls")
    gable = part("roof", [_gable(low, high, height, ridge)], roof, 4.0)
    sides = np.subtract(high, low)
    corner = low + 0.3 * sides
    chimney = box((*corner, height), (*(corner + 0.8), height + 0.40 * np.min(sides)))
    return walls, gable, part("chimney", [chimney], front, 6.0)


def _gable(low, high, height, ridge):
    over = 0.4
    (x0, y0), (x1, y1) = np.asarray(low) - over, np.asarray(high) + over
    top = height + 0.38 * ((y1 - y0) if ridge == "x" else (x1 - x0))
    if ridge == "x":
        ends = [[(x, y0, height), (x, 0.5 * (y0 + y1), top), (x, y1, height)] for x in (x0, x1)]
    else:
        ends = [[(x0, y, height), (0.5 * (x0 + x1), y, top), (x1, y, height)] for y in (y0, y1)]
    return loft(np.array(ends))


def tower(
    low: ArrayLike, high: ArrayLike, height: float, front: np.ndarray, roof: np.ndarray
) -> Mesh:
    """A church tower with a steep pyramid on top; see `house` for what it is given."""
    shaft = house(low, high, height, front, roof, "x")[0]
    middle = 0.5 * (np.asarray(low) + np.asarray(high))
    half = 0.5 * (np.asarray(high) - np.asarray(low)) + 0.3
    ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    rings = [
        np.column_stack([middle + share * half * ring, np.full(4, z)])
        for share, z in ((1.0, height), (0.02, height + 5.0 * half.min()))
    ]
    return shaft, part("roof", [loft(np.array(rings))], roof, 4.0)


def tree(
    draws: np.random.Generator, place: ArrayLike, bark: np.ndarray, foliage: np.ndarray
) -> Mesh:
    """A tree of 5.5 to 8 m at `place` (2,) m: a trunk and a crown of lumps."""
    (x, y), height = place, draws.uniform(5.5, 8.0)
    girth = 0.022 * height
    crown = 0.62 * height
    surfaces = [tube([(x, y, 0.0), (x, y, 0.5 * height), (x, y, 0.8 * height)],
                     [girth, 0.75 * girth, 0.3 * girth], 6)]  # fmt: skip
    lumps = []
    for i in range(5):
        angle = 2.0 * np.pi * i / 4 + draws.uniform(-0.4, 0.4)
        out, up = (0.16 * height, 0.0) if i < 4 else (0.0, 0.14 * height)
        middle = crown + height * draws.uniform(-0.06, 0.06) + up
        centre = np.array([x + out * np.cos(angle), y + out * np.sin(angle), middle])
        radii = height * np.array([0.17, 0.17, 0.20]) * draws.uniform(0.85, 1.1)
        vertices, triangles = ellipsoid(centre, radii, 6, 9)
        uneven = 0.035 * height * draws.normal(size=vertices.shape) * 0.5
        lumps.append((vertices + uneven, triangles))
    return part("trunk", surfaces, bark, 1.0), part("crown", lumps, foliage, 2.5)


def lamp_post(place: ArrayLike, reach: ArrayLike, metal: np.ndarray, glass: np.ndarray) -> Mesh:
    """A lamp post of 6.2 m at `place` (2,) m, its arm of `reach` (2,) m."""
    (x, y), height = place, 6.2
    tip = np.array([x + reach[0], y + reach[1], height])
    pole = [
        tube([(x, y, 0.0), (x, y, 1.1)], [0.10, 0.09], 6),
        tube([(x, y, 0.0), (x, y, height - 0.5), (x + 0.3 * reach[0], y + 0.3 * reach[1], height),
              tip], [0.075, 0.055, 0.045, 0.04], 6),
    ]  # fmt: skip
    lamp = ellipsoid(tip - (0.0, 0.0, 0.08), (0.32, 0.32, 0.11), 4, 8)
    return part("pole", pole, metal, 0.6), part("lamp", [lamp], glass, 0.6)


def sign(place: ArrayLike, metal: np.ndarray, plate: np.ndarray) -> Mesh:
    """A traffic sign at `place` (2,) m that faces −y."""
    x, y = place
    pole = tube([(x, y, 0.0), (x, y, 2.75)], 0.04, 5)
    disc = lathe([(-0.02, 0.34), (0.02, 0.34)], (x, y - 0.05, 2.45), 20)
    return part("pole", [pole], metal, 0.5), part("plate", [disc], plate, 0.5)


def hedge(low: ArrayLike, high: ArrayLike, foliage: np.ndarray) -> Mesh:
    """A clipped hedge that fills the box `low` … `high`, (3,) m."""
    return (part("hedge", [box(low, high)], foliage, 2.0),)


def fence(start: ArrayLike, end: float, height: float, wood: np.ndarray) -> Mesh:
    """Pickets of `height` m on two rails along x, from `start` (2,) m to x = `end`."""
    x0, y = start
    pickets = [
        box((x, y, 0.05), (x + 0.09, y + 0.02, height)) for x in np.arange(x0, end - 0.09, 0.15)
    ]
    rails = [box((x0, y + 0.02, z), (end, y + 0.06, z + 0.09)) for z in (0.3, height - 0.3)]
    return (part("fence", [*pickets, *rails], wood, 1.0),)


def bollard(place: ArrayLike, metal: np.ndarray) -> Mesh:
    """A bollard of a metre at `place` (2,) m."""
    x, y = place
    shaft = tube([(x, y, 0.0), (x, y, 0.85)], [0.10, 0.08], 8)
    knob = ellipsoid((x, y, 0.93), (0.10, 0.10, 0.08), 4, 8)
    return (part("bollard", [shaft, knob], metal, 0.5),)


def parked_car(place: ArrayLike, heading: float, colour: Colour, contrast: float) -> Mesh:
    """A car of one size at `place` (2,) m, `heading` rad; its paint has less than `contrast`."""
    (mesh,) = fitted([car.mesh(0.7 * contrast, colour=colour)], 4.3, 1.75, 1.48)
    return moved(mesh, np.array([*place, 0.0]), heading)


def woods(x0: float, y0: float, x1: float, y1: float, foliage: np.ndarray) -> Mesh:
    """A row of trees, far away, over a rectangle, m."""
    return (part("woods", [box((x0, y0, 0.0), (x1, y1, 9.0))], foliage, 9.0),)


REACH = 150.0
"""The asphalt reaches as far as this from the origin, m."""

KERB = 0.08
"""Height of a pavement, m."""

MARK = 0.004
"""Height of marks above the asphalt, m, so that no renderer confuses the two."""

PAVEMENTS = (
    # x0, y0, x1, y1, m: before the houses on either side of the street, and about the square.
    (-60.0, 31.6, -5.2, 36.0), (5.2, 31.6, 60.0, 36.0), (-8.0, 36.0, -5.2, 96.0),
    (5.2, 36.0, 8.0, 96.0), (-24.0, -18.0, -18.6, 31.6), (18.6, -18.0, 24.0, 31.6),
    (-18.6, -18.0, 18.6, -13.0),
)  # fmt: skip

PATCHES = (
    # Mended asphalt: dark rectangles as above, which break up the repetition of the texture.
    (-7.5, 9.0, -4.6, 14.5), (1.2, 6.2, 2.4, 9.4), (3.2, 19.5, 8.4, 21.0),
    (-1.6, 23.2, 3.5, 24.6), (-11.0, 24.0, -6.2, 25.0), (8.8, 11.0, 10.2, 26.0),
    (-2.8, 3.0, -1.6, 6.0), (-4.6, 38.0, -1.0, 47.0), (1.5, 55.0, 4.6, 61.0),
)  # fmt: skip


def ground(contrast: float) -> Mesh:
    """The objects of kind "road": their parts are flat, or steps of `KERB`."""
    white = mottled("lane mark", (226, 226, 220), 0.10 + 0.10 * contrast)
    tarred = asphalt(contrast)
    dark = (0.55 * tarred).astype(np.uint8)
    iron = mottled("iron", (88, 84, 82), 0.15 + 0.20 * contrast, coarsest=8.0)
    stones = paving(contrast)
    kerb = mottled("kerb", (168, 166, 160), 0.05 + 0.15 * contrast)
    return (
            flat("asphalt", [(-REACH, -REACH, REACH, REACH)], 0.0, tarred, 7.3),
            flat("patches", PATCHES, 0.5 * MARK, dark, 5.1),
            flat("marks", _marks(), MARK, white, 1.0),
            flat("covers", [(2.1, 14.2, 2.8, 14.9), (-3.4, 21.0, -2.7, 21.7)], MARK, iron, 0.7),
            flat("pavements", PAVEMENTS, KERB, stones, 4.0),
            part("kerbs", [box((x0, y0, 0.0), (x1, y1, KERB - 0.001)) for x0, y0, x1, y1 in
                           PAVEMENTS], kerb, 1.3),
    )  # fmt: skip


def flat(
    name: str,
    rectangles: Iterable[tuple[float, float, float, float]],
    height: float,
    texture: np.ndarray,
    tile: float,
) -> Part:
    """Level rectangles (x0, y0, x1, y1) m, seen from above, `tile` m a repetition."""
    quads = [
        [(x0, y0, height), (x1, y0, height), (x1, y1, height), (x0, y1, height)]
        for x0, y0, x1, y1 in rectangles
    ]
    vertices = np.array(quads, dtype=np.float64).reshape(-1, 3)
    triangles = quads_to_triangles(np.arange(len(vertices)))
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
