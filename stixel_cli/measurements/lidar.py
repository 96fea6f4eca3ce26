"""A lidar of the same scene: beams against the renderer's meshes, and scans of what comes back.

The lidar stands `mount_height` above the origin of the ego car's ground plane, where the camera is,
and looks along the ego car's heading. Azimuths are counter-clockwise from there, elevations above
the horizon, rad. All beams of a scan leave at its time: nothing moves while it is scanned.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.parameters import LidarParameters, Scanner
from stixel_cli.measurements.scans import Scans, points_along
from stixel_cli.randomness import generator
from stixel_cli.scene.mesh import Mesh, corners
from stixel_cli.scene.parameters import RoadUser, World
from stixel_cli.scene.placement import numbered_objects, world_from_target_3d
from stixel_cli.scene.road_user import road_user_mesh
from stixel_cli.scene.scenario import EgoMotion, Scenario
from stixel_cli.scene.surfaces import RayTree


@dataclass(frozen=True)
class LidarReturns:
    """Noise-free returns of K scans of the whole scene, L layers of A beams each.

    Attributes:
        elevations: (L,) rad, ascending.
        azimuths: (A,) rad, ascending.
        ranges: (K, L, A) float32 m along the beams to the first surface; inf where there is none.
    """

    elevations: np.ndarray
    azimuths: np.ndarray
    ranges: np.ndarray

    def __len__(self) -> int:
        return len(self.ranges)


def cast_lidar(
    scenario: Scenario,
    road_user: RoadUser,
    world: World,
    scanner: Scanner,
    camera_field: tuple[float, float],
) -> LidarReturns:
    """Distances to the first surface along all beams, at the poses of the scenario.

    The target, the road and the background are the renderers' meshes, so whatever hides the target
    from the camera hides it here. `camera_field` is the field of view where `scanner` has none of
    its own: bearings of the camera's right and left border, rad.
    """
    static, target = _static_tree(world), ray_tree(road_user_mesh(road_user))
    return cast_beams(static, target, scenario, scanner, camera_field)


def cast_beams(
    static: RayTree,
    target: RayTree,
    scenario: Scenario,
    scanner: Scanner,
    camera_field: tuple[float, float],
) -> LidarReturns:
    """As `cast_lidar`, of what stands still (world frame) and a target (its own frame)."""
    azimuths = beam_azimuths(scanner, camera_field)
    elevations = beam_elevations(scanner)
    beams = beam_directions(elevations, azimuths)
    ranges = np.empty((len(scenario.times), len(elevations), len(azimuths)), dtype=np.float32)
    seen_from, behind = None, None
    for k, (ego, pose) in enumerate(
        zip(scenario.ego_poses_world, scenario.target_poses_world, strict=True)
    ):
        origin = np.array([ego[0], ego[1], scanner.mount_height])
        directions = beams.copy()
        directions[:, :2] = beams[:, :2] @ rotation(ego[2]).T
        if seen_from != ego.tobytes():
            # While the ego car stands, what stands still is asked once.
            seen_from, behind = ego.tobytes(), _distances(static, origin, directions)
        world_from_target = world_from_target_3d(pose)
        turn, shift = world_from_target[:3, :3], world_from_target[:3, 3]
        front = _distances(target, (origin - shift) @ turn, directions @ turn)
        ranges[k] = np.minimum(front, behind).reshape(ranges.shape[1:])
    return LidarReturns(elevations, azimuths, ranges)


def lidar_scans(
    returns: LidarReturns, ego_motion: EgoMotion, measurement: LidarParameters, seed: int
) -> Scans:
    """Scans of the returns inside the gates, with noise along the beam, on the world's ground.

    The gates ask the measured point for its height above the road, which leaves the ground out,
    and for its distance. Then it is put to the ground plane. With `returns: nearest` only the
    nearest point of each azimuth is kept: several layers meet bumper, bonnet, windscreen and roof,
    and seen from above all but the first lie inside the outline, where a tracker of contours takes
    them for its edge. The nearest of several noisy ranges is too near by about their deviation:
    0.6 of it for two that measure the same face, 1.5 for ten.

    The covariance that a point bears is the noise along the beam, brought to the ground, and
    (r dtheta)² / 12 across.

    Raises:
        ValueError: unless the returns are those of the ego motion's times.
    """
    if len(returns) != len(ego_motion.times):
        raise ValueError(f"returns of {len(returns)} scans, but {len(ego_motion.times)} times")
    scans = [
        _scan(returns, k, pose, measurement, generator(seed, "lidar", k))
        for k, pose in enumerate(ego_motion.poses_world)
    ]
    return Scans.of_each(ego_motion.times, ego_motion.poses_world, scans)


def beam_azimuths(scanner: Scanner, camera_field: tuple[float, float]) -> np.ndarray:
    """Azimuths (A,) rad, one step apart, even about the middle of the field of view, inside it."""
    step = np.radians(scanner.azimuth_step)
    own = scanner.horizontal_fov
    right, left = camera_field if own is None else np.radians([-0.5 * own, 0.5 * own])
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


# To build the world takes as long as to cast hundreds of scans, and many experiments share it.
@lru_cache(maxsize=1)
def _static_tree(world: World) -> RayTree:
    return ray_tree(*(mesh for _, mesh in numbered_objects(world)))


def ray_tree(*meshes: Mesh) -> RayTree:
    """All triangles of `meshes`, which are in one frame, ready for beams."""
    points = np.concatenate([corners(mesh) for mesh in meshes]).reshape(-1, 3)
    return RayTree(points, np.arange(len(points)).reshape(-1, 3))


def _distances(tree: RayTree, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Distances (n,) float32 m to the first triangle along unit `directions` (n, 3), or inf."""
    rays = np.empty((len(directions), 6), dtype=np.float32)
    rays[:, :3], rays[:, 3:] = origin, directions
    return tree.first_hits(rays)[0]


def _scan(
    returns: LidarReturns,
    k: int,
    sensor_pose_world: np.ndarray,
    measurement: LidarParameters,
    random: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) m and covariances (n, 2, 2) m² in the world of scan `k`."""
    # Noise is drawn for every beam, hit or not, so that no option changes the points it leaves.
    noise = random.standard_normal(returns.ranges.shape[1:])
    measured = returns.ranges[k].astype(np.float64) + measurement.range_deviation * noise
    answered = np.isfinite(measured)
    if measurement.missed_probability > 0.0:
        answered &= random.random(measured.shape) >= measurement.missed_probability
    measured[~answered] = 0.0

    elevations = returns.elevations[:, None]
    heights = measurement.scanner.mount_height + measured * np.sin(elevations)
    ground = measured * np.cos(elevations)
    inside = answered & (heights >= measurement.height_min) & (heights <= measurement.height_max)
    inside &= (ground >= measurement.range_min) & (ground <= measurement.range_max)
    if measurement.returns == "nearest":
        gated = np.where(inside, ground, np.inf)
        beam = np.flatnonzero(np.isfinite(gated.min(axis=0)))
        layer = gated.argmin(axis=0)[beam]
    else:
        beam, layer = np.nonzero(inside.T)

    distances = ground[layer, beam]
    along_variance = (measurement.range_deviation * np.cos(returns.elevations[layer])) ** 2
    step = np.radians(measurement.scanner.azimuth_step)
    across_variance = (distances * step) ** 2 / 12.0
    return points_along(
        sensor_pose_world, returns.azimuths[beam], distances, along_variance, across_variance
    )
