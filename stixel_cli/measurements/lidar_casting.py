"""A lidar's beams against the renderer's meshes.

The lidar is `mount_height` above the origin of the ego car's ground plane, where the camera is,
and looks along the ego car's heading. Azimuths are counter-clockwise from there, elevations above
the horizon, rad. All beams of a scan leave at its time: there is no motion during a scan.
"""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.parameters import LidarReturns, Scanner
from stixel_cli.rendering.placement import Motion, motion_of, numbered_objects, world_from_target_3d
from stixel_cli.rendering.surfaces import RayTree
from stixel_cli.scene.mesh import Mesh, corners
from stixel_cli.scene.parameters import RoadUser, World
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.scenario import Scenario


def cast_lidar(
    scenario: Scenario,
    road_user: RoadUser,
    world: World,
    scanner: Scanner,
    camera_field: tuple[float, float],
) -> LidarReturns:
    """Distances to the first surface along all beams, at the poses of the scenario.

    The target, the road and the background are the renderers' meshes, so an object that hides the
    target from the camera hides it here too. `camera_field` is the field of view if `scanner` does
    not set one: bearings of the camera's right and left border, rad.
    """
    meshes = road_user_meshes(road_user)
    targets = {int(pose): ray_tree(meshes[pose]) for pose in np.unique(scenario.limb_poses)}
    static = _static_tree(world, motion_of(world, scenario))
    return cast_beams(static, targets, scenario, scanner, camera_field)


def cast_beams(
    static: RayTree,
    targets: Mapping[int, RayTree],
    scenario: Scenario,
    scanner: Scanner,
    camera_field: tuple[float, float],
) -> LidarReturns:
    """As `cast_lidar`, of a static scene (world frame) and a target (its own frame).

    `targets` has the target in each pose of the limbs that `scenario.limb_poses` contains.
    """
    azimuths = beam_azimuths(scanner, camera_field)
    elevations = beam_elevations(scanner)
    beams = beam_directions(elevations, azimuths)
    ranges = np.empty((len(scenario.times), len(elevations), len(azimuths)), dtype=np.float32)
    seen_from, behind = None, None
    poses = zip(scenario.ego_poses_world, scenario.target_poses_world, strict=True)
    for k, (ego, pose) in enumerate(poses):
        origin = np.array([ego[0], ego[1], scanner.mount_height])
        directions = beams.copy()
        directions[:, :2] = beams[:, :2] @ rotation(ego[2]).T
        if seen_from != ego.tobytes():
            # While the ego car does not move, the static scene is cast once.
            seen_from, behind = ego.tobytes(), _distances(static, origin, directions)
        world_from_target = world_from_target_3d(pose)
        turn, shift = world_from_target[:3, :3], world_from_target[:3, 3]
        target = targets[int(scenario.limb_poses[k])]
        front = _distances(target, (origin - shift) @ turn, directions @ turn)
        ranges[k] = np.minimum(front, behind).reshape(ranges.shape[1:])
    return LidarReturns(elevations, azimuths, ranges)


def beam_azimuths(scanner: Scanner, camera_field: tuple[float, float]) -> np.ndarray:
    """Azimuths (A,) rad, one step apart, even about the middle of the field of view, inside it."""
    step = np.radians(scanner.azimuth_step)
    field = scanner.horizontal_fov
    right, left = camera_field if field is None else np.radians([-0.5 * field, 0.5 * field])
    # On a full turn the last beam must not be the first one again.
    count = min(int((left - right) / step + 1e-9) + 1, int(np.ceil(2.0 * np.pi / step - 1e-9)))
    return 0.5 * (right + left) + (np.arange(count) - 0.5 * (count - 1)) * step


def beam_elevations(scanner: Scanner) -> np.ndarray:
    """Elevations (L,) rad of the layers, ascending."""
    lowest, highest = np.radians([scanner.elevation_lowest, scanner.elevation_highest])
    if scanner.layers == 1:
        return np.array([0.5 * (lowest + highest)])
    return np.linspace(lowest, highest, scanner.layers)


def beam_directions(elevations: np.ndarray, azimuths: np.ndarray) -> np.ndarray:
    """Unit vectors (L A, 3), layer by layer: x along the heading, y to the left, z up."""
    flat = np.cos(elevations)[:, None]
    up = np.broadcast_to(np.sin(elevations)[:, None], (len(elevations), len(azimuths)))
    beams = np.stack([flat * np.cos(azimuths), flat * np.sin(azimuths), up], axis=-1)
    return beams.reshape(-1, 3)


# Building the world takes as long as casting hundreds of scans, and many runs share it.
@lru_cache(maxsize=1)
def _static_tree(world: World, motion: Motion) -> RayTree:
    return ray_tree(*(mesh for _, mesh in numbered_objects(world, motion)))


def ray_tree(*meshes: Mesh) -> RayTree:
    """All triangles of `meshes`, which are in one frame, ready for beams."""
    points = np.concatenate([corners(mesh) for mesh in meshes]).reshape(-1, 3)
    return RayTree(points, np.arange(len(points)).reshape(-1, 3))


def _distances(tree: RayTree, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Distances (n,) float32 m to the first triangle along unit `directions` (n, 3), or inf."""
    rays = np.empty((len(directions), 6), dtype=np.float32)
    rays[:, :3], rays[:, 3:] = origin, directions
    return tree.first_hits(rays)[0]
