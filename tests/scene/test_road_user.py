"""Road users: their meshes, bodies drawn within the class, and limbs that move."""

import zlib
from collections import Counter
from dataclasses import replace
from typing import get_args, get_type_hints

import numpy as np
import pytest
import scene_presets
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from stixel_cli.geometry.pose import target_from_world
from stixel_cli.scene.contours import outline, road_user_contours
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.mesh import bounding_box, corners
from stixel_cli.scene.parameters import RoadUser
from stixel_cli.scene.path import build_scenario
from stixel_cli.scene.road_user import LIMB_POSES, limb_poses, moving_parts, road_user_meshes
from stixel_cli.scene.shapes import knee


def parameters(kind="car", **changes):
    return replace(scene_presets.road_user(kind), **changes)


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
@pytest.mark.parametrize("size", [None, (3.3, 1.1, 2.0)])
def test_bounding_box_has_the_given_size(kind, size):
    road_user = parameters(kind)
    if size is not None:
        road_user = replace(road_user, length=size[0], width=size[1], height=size[2])
    low, high = bounding_box(*road_user_meshes(road_user))
    half = 0.5 * np.array([road_user.length, road_user.width])
    np.testing.assert_allclose(low, [*-half, 0.0], atol=1e-12)
    np.testing.assert_allclose(high, [*half, road_user.height], atol=1e-12)


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
def test_meshes_meet_the_requirements_of_the_renderers_and_face_outwards(kind):
    mesh = road_user_meshes(parameters(kind))[0]
    assert len({part.name for part in mesh}) == len(mesh) >= 5
    assert len(corners(mesh)) < 8000
    for part in mesh:
        assert part.vertices.dtype == np.float64 and part.vertices.shape[1:] == (3,)
        assert part.triangles.dtype == np.int32 and part.triangles.shape[1:] == (3,)
        assert part.triangles.min() >= 0 and part.triangles.max() < len(part.vertices)
        assert part.uvs.shape == (len(part.triangles), 3, 2) and np.isfinite(part.uvs).all()
        assert part.texture.dtype == np.uint8 and part.texture.shape[2] == 3
        assert all(side & (side - 1) == 0 for side in part.texture.shape[:2])
    # The signed volume of every closed piece is positive; windows and cabin close together.
    for part in [one for one in mesh if one.name not in ("cabin", "windows")]:
        for triangles in _pieces(part.triangles):
            points = part.vertices[triangles]
            points = points - points.mean(axis=(0, 1))
            volume = np.einsum("ti,ti->", points[:, 0], np.cross(points[:, 1], points[:, 2]))
            assert volume > 0.0, part.name


def _pieces(triangles):
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    size = triangles.max() + 1
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(size, size))
    label = connected_components(graph, directed=False)[1][triangles[:, 0]]
    return [triangles[label == number] for number in np.unique(label)]


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
def test_contrast_changes_paint_and_cloth(kind):
    def std(contrast):
        part = road_user_meshes(parameters(kind, contrast=contrast))[0][0]
        return part.texture.astype(float).std(axis=(0, 1)).max()

    plain, middling, strong = map(std, (0.0, 0.5, 1.0))
    assert plain == 0.0
    assert 5.0 < middling < strong


def test_paint_has_detail_at_short_and_long_range():
    """Averaged over squares of 2 mm … 14 cm the paint still varies: stereo matches on it."""
    texture = road_user_meshes(parameters("car"))[0][0].texture.mean(axis=2)
    for square in (1, 4, 16, 64):
        side = len(texture) // square
        averaged = texture.reshape(side, square, side, square).mean(axis=(1, 3))
        assert averaged.std() > 3.0


def test_every_class_has_a_mesh_of_its_own():
    kinds = get_args(get_type_hints(RoadUser)["kind"])
    users = [RoadUser(kind, 2.0, 1.0, 1.5, 0.6, None, None, 1.0, "x") for kind in kinds]
    meshes = [road_user_meshes(user)[0] for user in users]
    assert len({corners(mesh).tobytes() for mesh in meshes}) == len(kinds)


SIZES = {
    # least and greatest length, width, height, m
    "car": ((3.6, 1.55, 1.36), (5.1, 2.05, 2.0)),
    "cyclist": ((1.6, 0.4, 1.5), (2.0, 0.8, 2.05)),
    "pedestrian": ((0.4, 0.3, 1.5), (1.05, 0.75, 1.96)),
}


def drawn(kind, seed):
    return road_user_meshes(replace(scene_presets.road_user(kind), shape_seed=seed))


@pytest.mark.parametrize("kind", SIZES)
@settings(max_examples=8)
@given(seed=st.integers(0, 2**63 - 1))
def test_drawn_shapes_are_closed_and_have_plausible_sizes(kind, seed):
    meshes = drawn(kind, seed)
    low, high = bounding_box(*meshes)
    least, greatest = SIZES[kind]
    assert (high - low >= least).all() and (high - low <= greatest).all()
    np.testing.assert_allclose(low + high, [0.0, 0.0, high[2]], atol=1e-9)
    assert low[2] == pytest.approx(0.0, abs=1e-9)
    for mesh in (meshes[0], meshes[len(meshes) // 3]):
        for part in mesh:
            assert np.isfinite(part.vertices).all()
            # The cabin and its windows close together with the body.
            if part.name not in ("cabin", "windows"):
                assert _is_closed(part.triangles), part.name


def _is_closed(triangles):
    """Every edge is used once in each direction."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    ahead = Counter(map(tuple, edges.tolist()))
    return max(ahead.values()) == 1 and all(edge[::-1] in ahead for edge in ahead)


@pytest.mark.parametrize("kind", SIZES)
def test_same_seed_same_bytes_and_other_seeds_other_contours(kind):
    from stixel_cli.scene.road_user import _built_in

    first = corners(drawn(kind, 1000)[0]).tobytes()
    _built_in.cache_clear()
    assert corners(drawn(kind, 1000)[0]).tobytes() == first
    one, other = (shapely.Polygon(outline(corners(drawn(kind, seed)[0]))) for seed in (1000, 1001))
    assert one.intersection(other).area / one.union(other).area < 0.97


def test_null_keeps_the_car_of_earlier_versions():
    """Checksum of the corners in micrometres, from the revision before `shape_seed` existed."""
    (mesh,) = road_user_meshes(scene_presets.road_user("car"))
    steps = np.rint(1e6 * corners(mesh)).astype("<i8")
    assert zlib.crc32(steps.tobytes()) == 93015083


def test_cars_have_round_wheels_and_lengths_over_the_whole_range():
    lengths = []
    for seed in range(1000, 1024):
        (mesh,) = drawn("car", seed)
        lengths.append(np.ptp(bounding_box(mesh)[:, 0]))
        tyres = next(part.vertices for part in mesh if part.name == "tyres")
        front_left = tyres[: len(tyres) // 4]
        assert np.ptp(front_left[:, 0]) == pytest.approx(0.64, abs=1e-9)
    assert min(lengths) < 4.1 and max(lengths) > 4.8


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
