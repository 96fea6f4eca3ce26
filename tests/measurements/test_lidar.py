from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from refusals import refused

from stixel_cli.config.compose import compose
from stixel_cli.config.folders import group_options
from stixel_cli.errors import ConfigurationError
from stixel_cli.geometry.pose import rectangle, target_from_world, world_from_target
from stixel_cli.measurements.lidar import LidarParameters, lidar_scans
from stixel_cli.measurements.lidar_casting import (
    beam_azimuths,
    beam_directions,
    beam_elevations,
    cast_beams,
    cast_lidar,
    ray_tree,
)
from stixel_cli.measurements.parameters import LidarReturns, Scanner
from stixel_cli.measurements.scans import FieldOfView
from stixel_cli.scene.mesh import corners
from stixel_cli.scene.open3d_import import import_open3d_bindings
from stixel_cli.scene.parameters import World
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.scenario import EgoMotion, Scenario
from stixel_cli.scene.shapes import box, part

AHEAD = 0.5 * np.pi
FIELD = (-np.radians(30.0), np.radians(30.0))
ELEVATIONS = {"elevation_lowest": -12.0, "elevation_highest": 2.0}
SCANNER = Scanner(8, azimuth_step=1.0, horizontal_fov=None, mount_height=1.5, **ELEVATIONS)
NO_NOISE = {"dropout": None, "clutter_rate": 0.0, "range_std": 0.0, "missed_probability": 0.0}
GATES = {"height_min": 0.3, "height_max": 2.5, "range_max": 80.0}
EXACT = LidarParameters(kind="lidar", scanner=SCANNER, returns="nearest", **NO_NOISE, **GATES)
TARGET = ((-1.5, -0.7, 0.0), (1.5, 0.7, 1.4))
WALL = ((1.0, 6.0, 0.0), (1.2, 8.0, 3.0))  # hides a part of the target
HOUSE = ((-20.0, 30.0, 0.0), (20.0, 31.0, 9.0))


def mesh_of(*boxes):
    texture = np.zeros((4, 4, 3), np.uint8)
    return (part("boxes", [box(*b) for b in boxes], texture, 1.0),)


GROUND = ((-200.0, -200.0, -1.0), (200.0, 200.0, 0.0))
STATIC = ray_tree(mesh_of(GROUND, WALL, HOUSE))
BOX = ray_tree(mesh_of(TARGET))


def scenario(count=6, ego="turning"):
    k = np.arange(count)
    steps = {"parked": [0.0, 0.0, 0.0], "straight": [0.0, 0.4, 0.0], "turning": [0.1, 0.4, 0.05]}
    ego = np.array([0.0, 0.0, AHEAD]) + k[:, None] * np.array(steps[ego])
    target = np.stack([-1.0 + 0.8 * k, 12.0 + 0.2 * k, 0.3 * k], axis=1)
    return Scenario(0.1 * k, ego, target, np.zeros((count, 3)), rectangle(3.0, 1.4)[None])


def ray_box(origin, directions, low, high):
    """Distances (n,) of the slab method; inf where the box is missed."""
    with np.errstate(divide="ignore"):
        first, second = (low - origin) / directions, (high - origin) / directions
    enter = np.minimum(first, second).max(axis=1)
    leave = np.maximum(first, second).min(axis=1)
    return np.where((enter <= leave) & (enter > 0.0), enter, np.inf)


def analytic(truth, k):
    """The ranges (L A,) of scan k, and those of the target alone."""
    x, y, heading = truth.ego_poses_world[k]
    origin = np.array([x, y, SCANNER.mount_height])
    up, around = beam_elevations(SCANNER), beam_azimuths(SCANNER, FIELD) + heading
    elevation, azimuth = np.meshgrid(up, around, indexing="ij")
    flat = np.cos(elevation)
    rays = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1)
    rays = rays.reshape(-1, 3)
    with np.errstate(divide="ignore"):
        ground = np.where(rays[:, 2] < 0.0, -origin[2] / rays[:, 2], np.inf)
    still = [ray_box(origin, rays, *np.array(b)) for b in (WALL, HOUSE)]
    pose = truth.target_poses_world[k]
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    seen_from = (origin - [pose[0], pose[1], 0.0]) @ turn
    target = ray_box(seen_from, rays @ turn, *np.array(TARGET))
    return np.min([ground, *still, target], axis=0), target


@pytest.mark.parametrize("ego", ["parked", "straight", "turning"])
def test_lidar_ranges_match_boxes_and_a_plane(ego):
    truth = scenario(ego=ego)
    returns = cast_beams(STATIC, {0: BOX}, truth, SCANNER, FIELD)
    assert returns.ranges.shape == (6, 8, 61)
    hidden, seen = 0, 0
    for k in range(6):
        expected, target = analytic(truth, k)
        assert_allclose(returns.ranges[k].ravel(), expected, atol=1e-4)
        hidden += np.sum(np.isfinite(target) & (target > expected))
        seen += np.sum(np.isfinite(target) & (target == expected))
    assert hidden > 20
    assert seen > 100


@pytest.mark.parametrize("ego", ["parked", "turning"])
def test_lidar_scan_does_not_depend_on_the_length_of_the_run(ego):
    truth = scenario(ego=ego)
    whole = cast_beams(STATIC, {0: BOX}, truth, SCANNER, FIELD)
    for k in (0, 3, 5):
        of_scan = truth.times, truth.ego_poses_world, truth.target_poses_world
        rates, contour = truth.target_rates_world[[k]], truth.contour_target(k)[None]
        only = Scenario(*(values[[k]] for values in of_scan), rates, contour)
        alone = cast_beams(STATIC, {0: BOX}, only, SCANNER, FIELD)
        assert alone.ranges.tobytes() == whole.ranges[k].tobytes()


@pytest.mark.parametrize("road_user", group_options()["road_user"])
def test_lidar_returns_of_a_road_user_are_on_its_mesh(road_user):
    parameters = compose([f"road_user={road_user}"]).configuration.road_user
    truth, meshes = scenario(count=3), road_user_meshes(parameters)
    limb_poses = np.array([0, 5, 12]) % len(meshes)
    truth = replace(truth, limb_poses=limb_poses)
    scanner = replace(SCANNER, layers=24, azimuth_step=0.3)
    returns = cast_lidar(truth, parameters, World("street", 1, 1.0), scanner, FIELD)
    open3d = import_open3d_bindings()
    beams = beam_directions(returns.elevations, returns.azimuths)
    for k, pose in enumerate(truth.target_poses_world):
        points = corners(meshes[limb_poses[k]]).reshape(-1, 3).astype(np.float32)
        surface = open3d.t.geometry.RaycastingScene(nthreads=1)
        triangles = np.arange(len(points), dtype=np.uint32).reshape(-1, 3)
        surface.add_triangles(open3d.core.Tensor(points), open3d.core.Tensor(triangles))
        low, high = points.min(axis=0), points.max(axis=0)
        finite = np.isfinite(returns.ranges[k].ravel())
        hits = beams[finite] * returns.ranges[k].ravel()[finite, None]
        plan = world_from_target(hits[:, :2], truth.ego_poses_world[k])
        in_target = np.column_stack([target_from_world(plan, pose), 1.5 + hits[:, 2]])
        near = ((in_target >= low - 1e-3) & (in_target <= high + 1e-3)).all(axis=1)
        near &= in_target[:, 2] > 0.1  # not the ground below, nor its marks
        assert near.sum() > 20
        asked = open3d.core.Tensor(in_target[near].astype(np.float32))
        assert surface.compute_distance(asked, nthreads=1).numpy().max() < 1e-4


def test_beams_are_evenly_spaced_symmetric_and_inside_the_field_of_view():
    scanner = replace(SCANNER, azimuth_step=0.7)
    azimuths = np.degrees(beam_azimuths(scanner, FIELD))
    assert_allclose(np.diff(azimuths), 0.7)
    assert_allclose(azimuths, -azimuths[::-1])
    assert 30.0 - 0.7 < azimuths[-1] <= 30.0
    own = replace(scanner, azimuth_step=0.25, horizontal_fov=100.0)
    assert np.degrees(beam_azimuths(own, FIELD)[[0, -1]]).round(9).tolist() == [-50.0, 50.0]
    around = beam_azimuths(replace(own, horizontal_fov=360.0), FIELD)
    assert len(around) == 1440
    assert len(np.unique(np.round(np.degrees(around) % 360.0, 6))) == 1440
    assert_allclose(np.degrees(beam_elevations(SCANNER)), np.arange(-12.0, 3.0, 2.0))
    single = replace(SCANNER, layers=1)
    assert_allclose(np.degrees(beam_elevations(single)), [-5.0])
    directions = beam_directions(np.radians([0.0, 30.0]), np.radians([-90.0, 0.0]))
    half, root = 0.5, np.sqrt(0.75)
    expected = [[0, -1, 0], [1, 0, 0], [0, -root, half], [root, 0, half]]
    assert_allclose(directions, expected, atol=1e-12)


def made(ranges, elevations, azimuths=(0.0,)):
    """Returns (K, L, A) at elevations and azimuths in degrees, and an ego motion that stands."""
    ranges = np.array(ranges, dtype=np.float32)
    returns = LidarReturns(np.radians(elevations), np.radians(azimuths), ranges)
    poses = np.tile([0.0, 0.0, AHEAD], (len(ranges), 1))
    return returns, EgoMotion(0.1 * np.arange(len(ranges)), poses)


def test_lidar_points_are_in_the_world_frame_of_a_moving_ego_car():
    truth = scenario()
    ego = EgoMotion(truth.times, truth.ego_poses_world)
    returns = cast_beams(STATIC, {0: BOX}, truth, SCANNER, FIELD)
    scans = lidar_scans(returns, ego, EXACT, FIELD, seed=0)
    assert scans.field_of_view == FieldOfView(*FIELD)
    for k, pose in enumerate(truth.target_poses_world):
        rows = scans.rows(k)
        points = scans.points_world[rows]
        in_target = np.abs(target_from_world(points, pose))
        of_target = (in_target < [1.6, 0.8]).all(axis=1)
        assert of_target.sum() >= 5
        # On the box's outline, and all others on the wall or the house.
        outline = np.abs(in_target[of_target] - [1.5, 0.7]).min(axis=1)
        assert_allclose(outline, 0.0, atol=1e-3)
        x, y = points[~of_target].T
        wall = (np.abs(x - 1.1) < 0.101) & (np.abs(y - 7.0) < 1.001)
        assert np.all(wall | (np.abs(y - 30.5) < 0.501))
        # Without noise along the beam, what is left of R lies across it, seen from the sensor.
        along = points - truth.ego_poses_world[k, :2]
        kept = np.einsum("ni,nij,nj->n", along, scans.covariances_world[rows], along)
        assert_allclose(kept, 0.0, atol=1e-9)


def test_gates_use_measured_height_and_distance():
    # Straight down the beams: 1.5 m + r sin(elevation) above the road.
    ranges = [
        [[2.5], [0.9], [0.9]],  # 0.25 m high; too near; 0.78 m away
        [[2.3], [81.0], [2.1]],  # 0.35 m high; too far; 2.55 m high
        [[np.inf], [79.0], [1.9]],  # nothing; inside; 2.45 m high
    ]
    returns, ego = made(ranges, [-30.0, 0.0, 30.0])
    scans = lidar_scans(returns, ego, replace(EXACT, returns="all"), FIELD, seed=0)
    assert scans.offsets.tolist() == [0, 0, 1, 3]
    root = np.sqrt(0.75)
    expected = [[0, 2.3 * root], [0, 79.0], [0, 1.9 * root]]
    assert_allclose(scans.points_world, expected, atol=1e-5)


def test_returns_nearest_keeps_one_per_azimuth_and_all_keeps_every_return():
    # A bonnet at 10 m, a windscreen at 11 m, and the ground in front of both at 4 m.
    ranges = [[[np.hypot(4.0, 1.5), 12.0], [10.0, np.inf], [11.0, 9.0]]]
    down = np.degrees(-np.arctan2(1.5, 4.0))
    returns, ego = made(ranges, [down, -2.0, 1.0], [-10.0, 10.0])
    nearest = lidar_scans(returns, ego, EXACT, FIELD, seed=0)
    distances = np.linalg.norm(nearest.points_world, axis=1)
    assert_allclose(distances, np.cos(np.radians([2.0, 1.0])) * [10.0, 9.0], rtol=1e-6)
    bearings = np.degrees(np.arctan2(*nearest.points_world.T[::-1]))
    assert_allclose(bearings, [80.0, 100.0])
    every = lidar_scans(returns, ego, replace(EXACT, returns="all"), FIELD, seed=0)
    assert len(every.points_world) == 3
    assert {tuple(p) for p in nearest.points_world} < {tuple(p) for p in every.points_world}


def test_lidar_noise_along_the_beam_matches_its_covariance():
    elevations, azimuths = np.linspace(-2.0, 2.0, 5), np.linspace(-30.0, 30.0, 61)
    returns, ego = made(np.full((40, 5, 61), 20.0), elevations, azimuths)
    noisy = replace(EXACT, range_std=0.1, returns="all")
    scans = lidar_scans(returns, ego, noisy, FIELD, seed=3)
    assert len(scans.points_world) == 40 * 5 * 61
    bearings = AHEAD + np.radians(azimuths)
    along = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    along = np.tile(np.repeat(along, 5, axis=0), (40, 1))
    flat = np.tile(np.cos(np.radians(elevations)), 40 * 61)
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    assert_allclose(np.sum(across * scans.points_world, axis=1), 0.0, atol=1e-9)
    distances = np.sum(along * scans.points_world, axis=1)
    errors = (distances - 20.0 * flat) / (0.1 * flat)
    assert abs(errors.mean()) < 5.0 / np.sqrt(len(errors))
    assert abs(errors.std() - 1.0) < 0.03
    covariances = scans.covariances_world
    spread = np.einsum("ni,nij,nj->n", along, covariances, along)
    assert_allclose(spread, (0.1 * flat) ** 2)
    sideways = np.einsum("ni,nij,nj->n", across, covariances, across)
    assert_allclose(sideways, (distances * np.radians(1.0)) ** 2 / 12.0)
    assert_allclose(np.einsum("ni,nij,nj->n", along, covariances, across), 0.0, atol=1e-12)


def test_lidar_random_numbers_depend_only_on_seed_and_scan():
    returns, ego = made(np.full((20, 3, 30), 15.0), [-1.0, 0.0, 1.0], np.arange(30.0))
    noisy = replace(EXACT, range_std=0.1, returns="all")
    first, again = (lidar_scans(returns, ego, noisy, FIELD, seed=3) for _ in range(2))
    assert first.points_world.tobytes() == again.points_world.tobytes()
    other = lidar_scans(returns, ego, noisy, FIELD, seed=4)
    assert not np.array_equal(first.points_world, other.points_world)
    few, few_ego = made(np.full((5, 3, 30), 15.0), [-1.0, 0.0, 1.0], np.arange(30.0))
    shorter = lidar_scans(few, few_ego, noisy, FIELD, seed=3)
    assert_array_equal(shorter.points_world, first.points_world[: 5 * 90])
    missed = lidar_scans(returns, ego, replace(noisy, missed_probability=0.3), FIELD, seed=3)
    assert {tuple(p) for p in missed.points_world} < {tuple(p) for p in first.points_world}
    assert 0.65 < len(missed.points_world) / len(first.points_world) < 0.75


def test_lidar_scan_can_be_empty_and_requires_a_pose():
    returns, ego = made(np.full((3, 2, 4), np.inf), [-1.0, 0.0], np.arange(4.0))
    scans = lidar_scans(returns, ego, EXACT, FIELD, seed=0)
    assert len(scans) == 3
    assert scans.points_world.shape == (0, 2)
    assert scans.covariances_world.shape == (0, 2, 2)
    with pytest.raises(ValueError, match="argument 2 is shorter"):
        lidar_scans(returns, EgoMotion(ego.times[:2], ego.poses_world[:2]), EXACT, FIELD, seed=0)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("scanner.elevation_highest=-2", "must be > measurement.scanner.elevation_lowest"),
        ("scanner.elevation_highest=-1.2", "with measurement.scanner.layers=4"),
        ("height_max=0.2", "measurement.height_max: must be > measurement.height_min"),
        ("range_max=1", "measurement.range_max: 1 is out of range: must be > 1"),
    ],
)
def test_impossible_scanner_gives_a_one_line_error(override, message):
    with refused(message, error=ConfigurationError):
        compose(["measurement=lidar", f"measurement.{override}"])
