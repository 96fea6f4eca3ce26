"""The layouts of the worlds: houses, trees and lower things on or along the ego car's way.

`street` is a town square with a street that leads off ahead. The square is free for |x| < 12.8,
y < 28.5; so is the street, |x| < 5, beyond. Houses, trees and lamp posts, higher than 4 m, are on
all sides, so a camera that turns sees obstacles in every direction.

`roadside` and `fenced` have houses and trees along the ego car's way, and lower things before them,
see `World`. The view of the target is free at every time. So any motion fits, over any length.

With `world.occluder`, one thing stands between the ego car and the target, in any world. World
frame: x right, y forward, z up, m; the ego car starts at the origin.
"""

from collections.abc import Iterator

import numpy as np
import shapely

from stixel_cli.errors import UserError
from stixel_cli.randomness import generator
from stixel_cli.scene import background
from stixel_cli.scene.background import Materials, flat, ground
from stixel_cli.scene.mesh import Mesh, bounding_box, corners, moved
from stixel_cli.scene.parameters import World
from stixel_cli.scene.textures import asphalt, leaves, mottled, roof_tiles

HOUSES = (
    # x0, y0, x1, y1, height of the walls, ridge
    (8.2, 36.2, 17.5, 46.0, 8.2, "x"), (17.9, 36.2, 29.0, 46.0, 6.6, "x"),
    (29.4, 36.2, 44.0, 47.0, 9.0, "x"), (-17.0, 36.2, -8.2, 46.0, 6.8, "x"),
    (-28.5, 36.2, -17.4, 47.0, 9.2, "x"), (-44.0, 36.2, -28.9, 46.0, 7.0, "x"),
    (8.2, 47.5, 17.0, 62.0, 7.4, "y"), (8.2, 63.0, 17.5, 80.0, 9.0, "y"),
    (-17.0, 47.5, -8.2, 60.0, 8.8, "y"), (-17.5, 61.0, -8.2, 79.0, 7.2, "y"),
    (24.2, -16.0, 34.0, 0.0, 8.0, "y"), (24.2, 1.0, 34.0, 16.5, 6.8, "y"),
    (24.2, 17.5, 34.0, 33.0, 8.8, "y"), (-34.0, -16.0, -24.2, -1.0, 7.0, "y"),
    (-34.0, 0.0, -24.2, 15.0, 9.0, "y"), (-34.0, 16.0, -24.2, 33.0, 7.4, "y"),
    (-24.0, -30.0, -9.0, -18.2, 7.6, "x"), (-8.6, -30.0, 6.0, -18.2, 9.0, "x"),
    (6.4, -30.0, 24.0, -18.2, 7.0, "x"),
)  # fmt: skip

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
    (18.9, 26.0, 19.9, 31.0, 1.3), (-19.9, 25.0, -18.9, 31.0, 1.3),
    (-23.2, 35.0, -18.2, 35.8, 1.1), (18.6, 35.0, 23.6, 35.8, 1.1),
    (-19.6, -11.0, -18.9, -7.0, 1.2), (18.9, -12.0, 19.6, -8.0, 1.2),
)  # fmt: skip

WOODS = (
    (-150, 140, 150, 149), (-150, -149, 150, -140), (-149, -140, -140, 140), (140, -140, 149, 140),
)  # fmt: skip


def world_objects(world: World) -> list[Mesh]:
    """Meshes of all but the target and the sky: the road, then what is nearest, first.

    The background's order is the order of its ids. The same `world` gives the same bytes.
    """
    made = list(_street(world.contrast, world.seed))
    made.sort(key=lambda mesh: np.hypot(*corners(mesh)[..., :2].reshape(-1, 2).T).min())
    return [ground(world.contrast), *made]


def _street(contrast: float, seed: int) -> Iterator[Mesh]:
    draws, materials = generator(seed, "world"), Materials(seed, contrast)
    fronts, metal = materials.fronts, materials.metal
    roofs = [materials.roof, roof_tiles("roof grey", (92, 92, 98), contrast)]
    order = draws.permutation(len(fronts))
    for i, (x0, y0, x1, y1, height, ridge) in enumerate(HOUSES):
        front = fronts[order[i % len(fronts)]]
        roof = roofs[draws.integers(2)]
        yield background.house((x0, y0), (x1, y1), height, front, roof, ridge)
    yield background.tower((-4.5, 102.0), (4.5, 111.0), 22.0, fronts[2], roofs[1])
    greens = [materials.leaves, leaves("dark leaves", (62, 92, 46), contrast)]
    for i, place in enumerate(TREES):
        yield background.tree(draws, place, materials.bark, greens[i % 2])
    for rectangle in WOODS:
        yield background.woods(*rectangle, materials.woods)
    clipped = leaves("hedge", (66, 98, 50), contrast)
    for x0, y0, x1, y1, height in HEDGES:
        yield background.hedge((x0, y0, 0.0), (x1, y1, height), clipped)
    for x, y, *reach in LAMPS:
        yield background.lamp_post((x, y), reach, metal, materials.glass)
    for place in BOLLARDS:
        yield background.bollard(place, metal)
    plate = mottled("sign", (44, 92, 168), 0.08 + 0.20 * contrast)
    for place in SIGNS:
        yield background.sign(place, metal, plate)
    for x, y, heading, colour in PARKED:
        yield background.parked_car((x, y), np.radians(heading), colour, contrast)


BEHIND, AHEAD = 30.0, 90.0
"""The roadside reaches as far before the start and beyond the end of the ego car's way, m."""

SPACING, MOST_SLOTS = 13.0, 50
"""Distance of slots along the way, m, and their greatest number; each has two objects a side."""

ROAD = 5.5
"""Half the width of the road, m."""

VIEW = 3.5
"""Distance of all objects from the line between the ego car and the target's centre, m."""

MARGIN = 160.0
"""The asphalt reaches as far beyond the way, m; woods close the view 15 m before its edge."""

PAINTS = ((150, 38, 34), (172, 174, 170), (60, 94, 70), (52, 66, 104))


def roadside_objects(
    world: World, ego_poses_world: np.ndarray, targets_world: np.ndarray
) -> list[Mesh]:
    """As `world_objects`: the road first, then the background, nearest to the start first.

    `world.seed` draws the layout. The ego car's poses (K, 3) are x m, y m, heading rad, the targets
    (K, 2) m the target's centre.
    """
    draws, materials = generator(world.seed, "roadside"), Materials(world.seed, world.contrast)
    way = _way(ego_poses_world)
    pairs = np.stack([ego_poses_world[:, :2], targets_world], axis=1)
    free = shapely.union_all(
        [shapely.LineString(way).buffer(ROAD), *shapely.buffer(shapely.linestrings(pairs), VIEW)]
    )
    made: list[Mesh] = []
    for mesh in _along(way, world, materials, draws):
        vertices = np.concatenate([one.vertices for one in mesh])
        footprint = shapely.convex_hull(shapely.multipoints(vertices[:, :2]))
        if not footprint.intersects(free):
            made.append(mesh)
            free = free.union(footprint)
    places = np.concatenate([way, *pairs])
    low, high = places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN
    made += _woods(low + 6.0, high - 6.0, materials)
    made.sort(key=lambda mesh: float(np.hypot(*bounding_box(mesh)[:, :2].mean(axis=0))))
    ground = flat("asphalt", [(*low, *high)], 0.0, asphalt(world.contrast), 7.3)
    return [(ground,), *made]


def _way(poses: np.ndarray) -> np.ndarray:
    """The ego car's way (n, 2) m, a metre or more between its points, longer at both ends."""
    kept = [poses[0, :2]]
    for place in poses[1:, :2]:
        if np.hypot(*(place - kept[-1])) >= 1.0:
            kept.append(place)
    first, last = (np.array([np.cos(h), np.sin(h)]) for h in poses[[0, -1], 2])
    return np.array([poses[0, :2] - BEHIND * first, *kept, kept[-1] + AHEAD * last])


def _along(
    way: np.ndarray, world: World, materials: Materials, draws: np.random.Generator
) -> Iterator[Mesh]:
    """Objects on both sides of the way, where they would be if nothing had to be left free."""
    line = shapely.LineString(way)
    spacing = max(SPACING, line.length / MOST_SLOTS)
    for at in np.arange(0.5 * spacing, line.length, spacing):
        here, further = (line.interpolate(s) for s in (at, at + 1.0))
        direction = np.arctan2(further.y - here.y, further.x - here.x)
        # In an object's own frame, y points away from the road.
        for turn in (direction, direction + np.pi):
            for mesh in _slot(world, materials, draws):
                yield moved(mesh, np.array([here.x, here.y, 0.0]), turn)


def _slot(world: World, materials: Materials, draws: np.random.Generator) -> Iterator[Mesh]:
    """Something tall at the back, something low in front; x along the road, y away from it, m."""
    if draws.uniform() < 0.6:
        half, near = 0.5 * draws.uniform(8.0, 12.0), draws.uniform(12.0, 16.0)
        front = materials.fronts[draws.integers(len(materials.fronts))]
        height = draws.uniform(6.5, 9.0)
        low, high = (-half, near), (half, near + 9.0)
        yield background.house(low, high, height, front, materials.roof, "x")
    else:
        place = (draws.uniform(-3.0, 3.0), draws.uniform(11.0, 16.0))
        yield background.tree(draws, place, materials.bark, materials.leaves)
    if world.kind == "fenced":
        # Along the road, 5 to 12 m long.
        half, y = 0.5 * draws.uniform(5.0, 12.0), draws.uniform(5.8, 7.0)
        height = draws.uniform(0.9, 1.6)
        if draws.uniform() < 0.5:
            yield background.hedge((-half, y, 0.0), (half, y + 0.7, height), materials.leaves)
        else:
            yield background.fence((-half, y), half, height, materials.bark)
        return
    place = (draws.uniform(-4.0, 4.0), draws.uniform(6.8, 8.5))
    kind = draws.integers(4)
    if kind == 0:
        paint = PAINTS[draws.integers(len(PAINTS))]
        yield background.parked_car(place, 0.0, paint, world.contrast)
    elif kind == 1:
        yield background.lamp_post(place, (0.0, -1.2), materials.metal, materials.glass)
    elif kind == 2:
        x, y = place
        low, high = (x - 3.0, y, 0.0), (x + 3.0, y + 0.9, draws.uniform(0.9, 1.4))
        yield background.hedge(low, high, materials.leaves)
    else:
        yield background.bollard(place, materials.metal)


def _woods(low: np.ndarray, high: np.ndarray, materials: Materials) -> Iterator[Mesh]:
    """Four rows of trees on the border of a rectangle."""
    (x0, y0), (x1, y1) = low, high
    across = (x0, y1 - 9.0, x1, y1), (x0, y0, x1, y0 + 9.0)
    along = (x0, y0, x0 + 9.0, y1), (x1 - 9.0, y0, x1, y1)
    for rectangle in (*across, *along):
        yield background.woods(*rectangle, materials.woods)


CLEARANCE = 2.0
"""Distance of the occluder from the ways of the ego car and of the target's centre, m."""

DRAWS = 100
"""So many places are tried."""


def occluder(world: World, ego_poses_world: np.ndarray, targets_world: np.ndarray) -> Mesh:
    """A parked car, a post or a hedge on the line from the camera to the target, in the world.

    `world.seed` draws when the target's centre is behind its middle, and how far along that line
    it is: 50 to 65 %. A hedge is as long as to hide the centre for 25 to 42 % of the time, and 0.9
    to 1.6 m high: a high one hides all of the target. A post is a lamp post or a bollard. The
    arguments are those of `roadside_objects`. UserError if no place is far enough from both ways.
    """
    draws, materials = generator(world.seed, "occluder"), Materials(world.seed, world.contrast)
    eyes, last = ego_poses_world[:, :2], len(targets_world) - 1
    ways = shapely.multipoints(np.concatenate([eyes, targets_world]))
    for _ in range(DRAWS):
        middle, half = draws.uniform(0.4, 0.6), 0.5 * draws.uniform(0.25, 0.42)
        span = np.rint(last * np.array([middle - half, middle, middle + half])).astype(int)
        sights = targets_world[span] - eyes[span]
        start, place, end = eyes[span] + draws.uniform(0.5, 0.65) * sights
        length = max(1.5, float(np.hypot(*(end - start))))
        mesh = _mesh(world, length, materials, draws)
        across = np.arctan2(sights[1, 1], sights[1, 0]) - 0.5 * np.pi
        mesh = moved(mesh, np.array([*place, 0.0]), across)
        footprint = shapely.convex_hull(shapely.multipoints(corners(mesh).reshape(-1, 3)[:, :2]))
        if footprint.distance(ways) > CLEARANCE:
            return mesh
    raise UserError(
        f"world.occluder: no place for {world.occluder} between the camera and the target is "
        f"{CLEARANCE:g} m from the ways of both; choose none, or path=crossing"
    )


def _mesh(world: World, length: float, materials: Materials, draws: np.random.Generator) -> Mesh:
    """Centred on the origin, along x."""
    if world.occluder == "parked_car":
        return background.parked_car((0.0, 0.0), 0.0, (52, 66, 104), world.contrast)
    if world.occluder == "hedge":
        low, high = (-0.5 * length, -0.4, 0.0), (0.5 * length, 0.4, draws.uniform(0.9, 1.6))
        return background.hedge(low, high, materials.leaves)
    if draws.uniform() < 0.5:
        return background.bollard((0.0, 0.0), materials.metal)
    return background.lamp_post((0.0, 0.0), (1.6, 0.0), materials.metal, materials.glass)
