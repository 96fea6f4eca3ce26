"""What stands between the camera and the target, with `world.occluder`.

World frame: x right, y forward, z up, m.
"""

import numpy as np
import shapely

from stixel_cli.errors import UserError
from stixel_cli.randomness import generator
from stixel_cli.scene import background
from stixel_cli.scene.background import Materials
from stixel_cli.scene.mesh import Mesh, corners, moved
from stixel_cli.scene.parameters import World

CLEARANCE = 2.0
"""Distance of the occluder from the ways of the ego car and of the target's centre, m."""

DRAWS = 100
"""So many places are tried."""


def occluder(world: World, ego_poses_world: np.ndarray, targets_world: np.ndarray) -> Mesh:
    """A parked car, a post or a hedge on the line from the camera to the target, in the world.

    `world.seed` draws when the target's centre is behind its middle, and how far along that line
    it is: 50 to 65 %. A hedge is as long as to hide the centre for 25 to 42 % of the time, and 0.9
    to 1.6 m high: a high one hides all of the target. A post is a lamp post or a bollard.

    Args:
        ego_poses_world: (K, 3) x m, y m, heading rad.
        targets_world: (K, 2) m, the target's centre.

    Raises:
        UserError: if no place is far enough from the ways of both.
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
    return background.lamp_post((0.0, 0.0), 6.2, (1.6, 0.0), materials.metal, materials.glass)
