"""Content of the world for both renderers: numbered objects, the target, the sun."""

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.rendering.frames import BACKGROUND_ID, ROAD_ID
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.parameters import World
from stixel_cli.scene.roadside import occluder, roadside_objects
from stixel_cli.scene.scenario import Scenario
from stixel_cli.scene.world import world_objects

SUN_COLOUR = np.array([1.0, 0.96, 0.88])
"""Linear red, green and blue of the sun's light."""

SUNLIGHT, AMBIENT = 1.2, 0.34
"""Irradiance over pi of a surface that faces the sun, and from the sky of one that faces up: a
white surface in full light shines with about 1."""

EXPOSURE = 0.85
"""Factor from light to the image's linear grey, with full scale 1: white stays below it."""

_AZIMUTH, _ELEVATION = np.radians(200.0), np.radians(38.0)
SUN = np.array(
    [
        np.cos(_ELEVATION) * np.cos(_AZIMUTH),
        np.cos(_ELEVATION) * np.sin(_AZIMUTH),
        np.sin(_ELEVATION),
    ]
)
"""Unit vector in the world towards the sun: 200° counter-clockwise from the +x axis (the ego car
looks along +90° at k = 0), 38° above the horizon."""


Motion = tuple[tuple[float, ...], ...]
"""The motion that a world depends on: x, y, heading of the ego car and x, y of the target."""


def motion_of(world: World, scenario: Scenario) -> Motion:
    """The motion that the objects of `world` depend on; () for a world that is always the same."""
    if (world.kind, world.occluder) == ("street", "none"):
        return ()
    rows = np.concatenate([scenario.ego_poses_world, scenario.target_poses_world[:, :2]], axis=1)
    return tuple(map(tuple, rows.tolist()))


def numbered_objects(world: World, motion: Motion = ()) -> list[tuple[int, Mesh]]:
    """Object ids (as in `RenderedFrames.ids`) and meshes in the world of the road and background.

    `motion` is that of `motion_of`.

    Raises:
        ValueError: if there are more objects than ids.
    """
    poses, ids = np.array(motion).reshape(-1, 5), [ROAD_ID, *range(BACKGROUND_ID, 256)]
    ways = poses[:, :3], poses[:, 3:]
    objects = world_objects(world) if world.kind == "street" else roadside_objects(world, *ways)
    meshes = [mesh for _, mesh in objects]
    if world.occluder != "none":
        meshes.append(occluder(world, *ways))
    if len(meshes) > len(ids):
        raise ValueError(f"world: {len(meshes)} objects, but at most {len(ids)} have an id")
    return list(zip(ids, meshes, strict=False))


def world_from_target_3d(pose_world: np.ndarray) -> np.ndarray:
    """Rigid transform (4, 4) to the world from a target at `pose_world` (3,) = x, y, heading."""
    transform = np.eye(4)
    transform[:2, :2] = rotation(pose_world[2])
    transform[:2, 3] = pose_world[:2]
    return transform
