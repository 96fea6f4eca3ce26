"""The layout of the `street` world: a town square with a street that leads off ahead.

World frame: x right, y forward, z up, m; the ego car starts at the origin. The square is free for
|x| < 12.8, y < 28.5; so is the street, |x| < 5, beyond. Houses, trees and lamp posts, higher than
4 m, are on all sides, so a camera that turns sees obstacles in every direction.
"""

import numpy as np

from stixel_cli.randomness import generator
from stixel_cli.scene import background
from stixel_cli.scene.background import Materials, ground
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.parameters import World
from stixel_cli.scene.textures import leaves, mottled, roof_tiles

HOUSES = (
    # x0, y0, x1, y1, height of the walls, ridge
    (8.2, 36.2, 17.5, 46.0, 8.2, "x"),
    (17.9, 36.2, 29.0, 46.0, 6.6, "x"),
    (29.4, 36.2, 44.0, 47.0, 9.0, "x"),
    (-17.0, 36.2, -8.2, 46.0, 6.8, "x"),
    (-28.5, 36.2, -17.4, 47.0, 9.2, "x"),
    (-44.0, 36.2, -28.9, 46.0, 7.0, "x"),
    (8.2, 47.5, 17.0, 62.0, 7.4, "y"),
    (8.2, 63.0, 17.5, 80.0, 9.0, "y"),
    (-17.0, 47.5, -8.2, 60.0, 8.8, "y"),
    (-17.5, 61.0, -8.2, 79.0, 7.2, "y"),
    (24.2, -16.0, 34.0, 0.0, 8.0, "y"),
    (24.2, 1.0, 34.0, 16.5, 6.8, "y"),
    (24.2, 17.5, 34.0, 33.0, 8.8, "y"),
    (-34.0, -16.0, -24.2, -1.0, 7.0, "y"),
    (-34.0, 0.0, -24.2, 15.0, 9.0, "y"),
    (-34.0, 16.0, -24.2, 33.0, 7.4, "y"),
    (-24.0, -30.0, -9.0, -18.2, 7.6, "x"),
    (-8.6, -30.0, 6.0, -18.2, 9.0, "x"),
    (6.4, -30.0, 24.0, -18.2, 7.0, "x"),
)

TREES = (
    (-12.4, 33.4), (12.0, 33.2), (-19.6, 33.6), (20.4, 33.4), (-6.6, 39.5), (6.6, 42.0),
    (-6.6, 51.0), (6.6, 55.0), (-6.6, 64.0), (6.6, 70.0), (-20.2, 20.0), (20.4, 24.0),
    (-20.6, 8.0), (20.2, 10.0), (-20.0, -5.0), (20.4, -6.0), (-10.0, -15.2), (9.0, -15.4),
    (-16.0, 93.0), (15.0, 95.0),
)  # fmt: skip

LAMPS = (
    # x, y, and the arm's reach
    (-6.2, 32.4, 1.6, -0.6), (6.3, 32.6, -1.6, -0.6), (-16.0, 32.5, 0.0, -1.5),
    (15.8, 32.5, 0.0, -1.5), (-5.8, 46.0, 1.6, 0.0), (5.8, 60.0, -1.6, 0.0),
    (-19.0, 14.0, 1.5, 0.0), (19.0, 17.0, -1.5, 0.0), (-19.0, 0.0, 1.5, 0.0),
    (19.0, 2.0, -1.5, 0.0), (0.0, -13.6, 0.0, 1.5),
)  # fmt: skip

PARKED = (
    # x, y, heading in degrees, colour
    (9.8, 30.2, 0.0, (150, 38, 34)),
    (-10.6, 30.3, 180.0, (172, 174, 170)),
    (15.9, 23.1, 180.0, (60, 94, 70)),
)

BOLLARDS = ((-5.35, 9.7), (-6.1, 10.9), (-7.9, 31.9), (-9.4, 31.9), (7.9, 31.9), (9.4, 31.9))

SIGNS = ((5.7, 31.9), (-14.2, 32.0), (13.9, 32.0))

HEDGES = (
    # x0, y0, x1, y1, height
    (18.9, 26.0, 19.9, 31.0, 1.3),
    (-19.9, 25.0, -18.9, 31.0, 1.3),
    (-23.2, 35.0, -18.2, 35.8, 1.1),
    (18.6, 35.0, 23.6, 35.8, 1.1),
    (-19.6, -11.0, -18.9, -7.0, 1.2),
    (18.9, -12.0, 19.6, -8.0, 1.2),
)

WOODS = (
    (-150, 140, 150, 149),
    (-150, -149, 150, -140),
    (-149, -140, -140, 140),
    (140, -140, 149, 140),
)


def world_objects(world: World) -> list[tuple[str, Mesh]]:
    """Names and meshes of all but the target and the sky: the road, then what is nearest, first.

    The background's order is the order of its ids. The same `world` gives the same bytes.
    """
    draws, materials = generator(world.seed, "world"), Materials(world.seed, world.contrast)
    made = [
        *_houses(world.contrast, materials, draws),
        *_green(world.contrast, materials, draws),
        *_furniture(world.contrast, materials),
    ]
    made.sort(key=lambda named: _distance(named[1]))
    return [("road", ground(world.contrast)), *made]


def _distance(mesh: Mesh) -> float:
    points = np.concatenate([part.vertices for part in mesh.parts])
    return float(np.min(np.hypot(points[:, 0], points[:, 1])))


def _houses(contrast: float, materials: Materials, draws: np.random.Generator):
    fronts = materials.fronts
    roofs = [materials.roof, roof_tiles("roof grey", (92, 92, 98), contrast)]
    order = draws.permutation(len(fronts))
    for i, (x0, y0, x1, y1, height, ridge) in enumerate(HOUSES):
        front = fronts[order[i % len(fronts)]]
        roof = roofs[draws.integers(2)]
        yield "house", background.house((x0, y0), (x1, y1), height, front, roof, ridge)
    yield "church", background.tower((-4.5, 102.0), (4.5, 111.0), 22.0, fronts[2], roofs[1])


def _green(contrast: float, materials: Materials, draws: np.random.Generator):
    greens = [materials.leaves, leaves("dark leaves", (62, 92, 46), contrast)]
    for i, place in enumerate(TREES):
        height = draws.uniform(5.5, 8.0)
        yield "tree", background.tree(draws, place, height, materials.bark, greens[i % 2])
    for rectangle in WOODS:
        yield "woods", background.woods(*rectangle, materials.woods)
    clipped = leaves("hedge", (66, 98, 50), contrast)
    for x0, y0, x1, y1, height in HEDGES:
        yield "hedge", background.hedge((x0, y0, 0.0), (x1, y1, height), clipped)


def _furniture(contrast: float, materials: Materials):
    metal, plate = materials.metal, mottled("sign", (44, 92, 168), 0.08 + 0.20 * contrast)
    for x, y, *reach in LAMPS:
        yield "lamp post", background.lamp_post((x, y), 6.2, reach, metal, materials.glass)
    for place in BOLLARDS:
        yield "bollard", background.bollard(place, metal)
    for place in SIGNS:
        yield "sign", background.sign(place, metal, plate)
    for x, y, heading, colour in PARKED:
        yield "parked car", background.parked_car((x, y), np.radians(heading), colour, contrast)
