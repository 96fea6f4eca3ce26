"""Limbs move with the distance travelled, and the true contour follows them."""

from dataclasses import replace

import numpy as np
import pytest
import scene_presets
import shapely

from stixel_cli.geometry.pose import target_from_world
from stixel_cli.scene.contours import outline, road_user_contours
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.mesh import corners
from stixel_cli.scene.path import build_scenario
from stixel_cli.scene.road_user import LIMB_POSES, limb_poses, moving_parts, road_user_meshes
from stixel_cli.scene.shapes import knee

WALKERS = ("cyclist", "pedestrian")


def scenario_of(kind, path="approach", **changes):
    route = scene_presets.path(path, kind)
    motion = ego_motion(scene_presets.ego("parked"), route.duration, route.sample_time)
    return build_scenario(motion, replace(scene_presets.road_user(kind), **changes), route)


@pytest.mark.parametrize("kind", WALKERS)
@pytest.mark.parametrize("shape_seed", [None, 8600102])
def test_outline_of_each_pose_is_that_of_its_mesh(kind, shape_seed):
    """`outline` projects all triangles of one mesh; both simplify by 1 mm.

    Of the last shape, the exact union of a pedestrian's triangles fails.
    """
    road_user = replace(scene_presets.road_user(kind), shape_seed=shape_seed)
    contours, meshes = road_user_contours(road_user), road_user_meshes(road_user)
    assert len(contours) == len(meshes) == LIMB_POSES
    for pose in (3, 21):
        expected = shapely.Polygon(outline(corners(meshes[pose])))
        found = shapely.Polygon(contours[pose])
        assert found.is_valid and found.exterior.is_ccw
        assert shapely.hausdorff_distance(found, expected) < 2.5e-3
        assert found.symmetric_difference(expected).area < 2e-3 * expected.area


@pytest.mark.parametrize("kind", WALKERS)
def test_limbs_move_and_the_box_stays(kind):
    scenario, road_user = scenario_of(kind), scene_presets.road_user(kind)
    half = 0.5 * np.array([road_user.length, road_user.width])
    np.testing.assert_allclose(scenario.box_target, [-half, half], atol=2e-3)
    first, *others = map(shapely.Polygon, scenario.contours_target)
    changed = max(other.symmetric_difference(first).area for other in others)
    assert changed > {"cyclist": 0.01, "pedestrian": 0.2}[kind] * first.area
    # Each time has the contour of its pose, moved to its place.
    for k in (0, 7):
        np.testing.assert_allclose(
            target_from_world(scenario.contours_world[k], scenario.target_poses_world[k]),
            scenario.contours_target[scenario.limb_poses[k]],
            atol=1e-9,
        )
    assert scenario.limb_poses[0] != scenario.limb_poses[7]


def test_a_car_has_one_contour():
    scenario = scenario_of("car")
    assert len(scenario.contours_target) == 1
    assert len(road_user_meshes(scene_presets.road_user("car"))) == 1
    assert not scenario.limb_poses.any()


@pytest.mark.parametrize("kind", WALKERS)
def test_limbs_follow_the_distance_and_rest_while_the_target_stands(kind):
    road_user = scene_presets.road_user(kind)
    cycle = {"cyclist": 5.0, "pedestrian": 1.4}[kind]
    travelled = cycle * np.array([0.0, 0.25, 0.5, 1.0, 7.5])
    quarter = LIMB_POSES // 4
    expected = [0, quarter, 2 * quarter, 0, 2 * quarter]
    np.testing.assert_array_equal(limb_poses(road_user, travelled), expected)
    path = scene_presets.path("stop_and_go", kind)
    scenario = scenario_of(kind, "stop_and_go")
    speed = np.hypot(*scenario.target_rates_world[:, :2].T)
    standing = np.flatnonzero((speed[1:] == 0.0) & (speed[:-1] == 0.0))
    assert len(standing) > 3 and path.stand_time > 0.0
    np.testing.assert_array_equal(scenario.limb_poses[standing], scenario.limb_poses[standing + 1])
    assert len(set(scenario.limb_poses)) > quarter


def test_meshes_of_the_poses_differ_in_vertices_of_moving_parts_only():
    road_user = scene_presets.road_user("cyclist")
    first, *others = road_user_meshes(road_user)
    moving = moving_parts(road_user)
    assert moving == {"cranks", "trousers", "shoes"}
    for mesh in others:
        for one, other in zip(first, mesh, strict=True):
            assert one.name == other.name and one.texture is other.texture
            np.testing.assert_array_equal(one.triangles, other.triangles)
            np.testing.assert_array_equal(one.uvs, other.uvs)
            assert np.array_equal(one.vertices, other.vertices) == (one.name not in moving)


def test_a_pedal_on_top_moves_ahead_and_feet_of_a_walker_go_back_on_the_ground():
    meshes = road_user_meshes(scene_presets.road_user("cyclist"))
    pedals = np.array([_part(mesh, "cranks")[:60].mean(axis=0) for mesh in meshes])
    top = int(np.argmax(pedals[:, 2]))
    assert pedals[(top + 1) % LIMB_POSES, 0] > pedals[top, 0]
    meshes = road_user_meshes(scene_presets.road_user("pedestrian"))
    shoes = [_part(mesh, "shoes") for mesh in meshes]
    # The right foot is the first one.
    right = np.array([vertices[: len(vertices) // 2].mean(axis=0) for vertices in shoes])
    half = LIMB_POSES // 2
    assert (np.diff(right[: half + 1, 0]) < 0.0).all()
    assert right[half + half // 2, 2] > right[:half, 2].max()


def test_knee_keeps_the_bones_and_points_ahead():
    hip, ankle = np.array([0.0, 0.1, 0.9]), np.array([0.1, 0.1, 0.3])
    bend = knee(hip, ankle, 0.4, 0.35)
    assert np.linalg.norm(bend - hip) == pytest.approx(0.4)
    assert np.linalg.norm(bend - ankle) == pytest.approx(0.35)
    assert bend[0] > 0.1
    straight = knee(hip, np.array([0.0, 0.1, -0.5]), 0.4, 0.35)
    np.testing.assert_allclose(straight[:2], hip[:2], atol=1e-12)


def _part(mesh, name):
    return next(part.vertices for part in mesh if part.name == name)
