"""The street, the roadside and the occluders: nothing of them is in anybody's way."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scene_presets
import shapely

from stixel_cli.config.compose import compose
from stixel_cli.engine.keys import canonical
from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import rectangle, world_from_target
from stixel_cli.rendering.placement import motion_of, numbered_objects
from stixel_cli.scene.background import KERB, MARK, PAVEMENTS
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.mesh import bounding_box, corners
from stixel_cli.scene.parameters import World
from stixel_cli.scene.path import build_scenario, path_poses
from stixel_cli.scene.scenario import Scenario
from stixel_cli.scene.world import CLEARANCE, ROAD, VIEW, occluder, roadside_objects, world_objects


@pytest.fixture(scope="module")
def objects():
    return world_objects(scene_presets.world())


@pytest.fixture(scope="module")
def obstacles(objects):
    """Hulls of the ground projections of all that stands, and the raised pavements."""
    raised = [shapely.box(*pavement) for pavement in PAVEMENTS]
    return shapely.union_all([*map(hull_of, objects[1:]), *raised])


def hull_of(mesh):
    return shapely.convex_hull(shapely.MultiPoint(corners(mesh).reshape(-1, 3)[:, :2]))


def test_world_has_one_flat_road_first_a_limited_size_and_parts_for_the_renderers(objects):
    assert [mesh[0].name for mesh in objects].index("asphalt") == 0
    assert 30 < len(objects) < 200
    assert sum(len(corners(mesh)) for mesh in objects) < 40_000
    low, high = bounding_box(objects[0])
    assert (low[:2] <= -150).all() and (high[:2] >= 150).all()
    assert low[2] == 0.0 and high[2] == KERB
    asphalt, _, marks = objects[0][:3]
    assert asphalt.texture.astype(float).std() > 15.0
    assert (marks.vertices[:, 2] == MARK).all()
    for part in objects[0][:3]:
        points = part.vertices[part.triangles]
        normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        assert (normals[:, 2] > 0.0).all() and (normals[:, :2] == 0.0).all()
    for mesh in objects:
        for part in mesh:
            assert part.triangles.dtype == np.int32 and np.isfinite(part.vertices).all()
            assert part.uvs.shape == (len(part.triangles), 3, 2)
            assert part.texture.dtype == np.uint8
            assert all(side & (side - 1) == 0 for side in part.texture.shape[:2])


def test_background_surrounds_the_ego_car_and_tall_objects_are_behind_the_target(objects):
    boxes = [bounding_box(mesh) for mesh in objects[1:]]
    assert all(abs(low[2]) < 0.2 for low, _ in boxes)
    tall = [shapely.box(*low[:2], *high[:2]) for low, high in boxes if high[2] > 4]
    tall = shapely.union_all(tall)
    for angle in np.radians(np.arange(0, 360, 5)):
        ray = shapely.LineString([(0, 0), (220 * np.cos(angle), 220 * np.sin(angle))])
        assert ray.intersects(tall)
    # In the default rig's view, past the default path, nearer than 50 m.
    low, high = np.array(boxes).swapaxes(0, 1)
    aside = np.abs(0.5 * (low[:, 0] + high[:, 0])) < 0.57 * low[:, 1]
    chosen = np.flatnonzero((high[:, 2] > 4.0) & (low[:, 1] > 28.0) & (low[:, 1] < 50.0) & aside)
    assert {"walls", "trunk", "pole"} <= {objects[1 + i][0].name for i in chosen}
    assert len(chosen) >= 8


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
@pytest.mark.parametrize("name", scene_presets.PATHS)
def test_preset_paths_are_free_of_objects(obstacles, kind, name):
    path, road_user = scene_presets.path(name, kind), scene_presets.road_user(kind)
    motion = ego_motion(scene_presets.ego("parked"), path.duration, path.sample_time)
    outline = rectangle(road_user.length, road_user.width)
    for pose in path_poses(path, motion.times)[0]:
        footprint = shapely.Polygon(world_from_target(outline, pose))
        assert footprint.distance(obstacles) > 0.2


@pytest.mark.parametrize("name", scene_presets.EGOS)
def test_ego_paths_are_free_of_objects(obstacles, name):
    for pose in ego_motion(scene_presets.ego(name), 10.0, 0.5).poses_world:
        assert shapely.Point(pose[:2]).distance(obstacles) > 1.5


def content(*meshes):
    parts = [part for mesh in meshes for part in mesh]
    return [(part.name, corners((part,)).tobytes(), part.texture.tobytes()) for part in parts]


def test_world_is_repeatable_and_depends_on_its_seed_and_contrast(objects):
    assert content(*world_objects(scene_presets.world())) == content(*objects)
    assert content(*world_objects(World("street", 2, 1.0))) != content(*objects)
    ground = world_objects(World("street", 1, 0.0))[0]
    assert ground[0].texture.std(axis=(0, 1)).max() == 0.0


WORLD = World("roadside", 1, 1.0)


def driven(length, count=80):
    """An ego car that turns by 90 degrees over `length` m; a target that crosses ahead of it."""
    s = np.linspace(0.0, 1.0, count)
    angle = 0.5 * np.pi * s
    radius = length / (0.5 * np.pi)
    ego = np.stack([radius * (np.cos(angle) - 1), radius * np.sin(angle), angle + 0.5 * np.pi], 1)
    return ego, ego[:, :2] + np.stack([-20.0 + 40.0 * s, np.full(count, 15.0)], axis=1)


def first_parts(beside):
    """They tell what an object is: a house begins with its walls, a tree with its trunk."""
    return {mesh[0].name for mesh in beside}


@pytest.fixture(scope="module")
def beside():
    return roadside_objects(WORLD, *driven(150.0))


def test_the_way_and_the_view_are_free_and_objects_near_the_way_on_its_asphalt(beside):
    ego, targets = driven(150.0)
    way = shapely.LineString(ego[:, :2])
    views = shapely.union_all(shapely.linestrings(np.stack([ego[:, :2], targets], axis=1)))
    assert len(beside) > 41
    road, *others = beside
    for hull in map(hull_of, others):
        assert hull.distance(way) > 0.99 * ROAD
        assert hull.distance(views) > 0.99 * VIEW
    low, high = bounding_box(road)[:, :2]
    assert first_parts(others) >= {"walls", "trunk", "pole", "body", "woods"}
    for mesh in others:
        inner = bounding_box(mesh)[:, :2]
        assert (inner[0] >= low).all() and (inner[1] <= high).all()
    near = [mesh for mesh in others if mesh[0].name != "woods"]
    for k in (0, 40, 79):
        places = np.array([bounding_box(mesh)[:, :2].mean(axis=0) for mesh in near])
        assert (np.hypot(*(places - ego[k, :2]).T) < 40.0).sum() >= 8


def test_a_long_drive_has_an_id_for_every_object_and_a_standing_car_has_a_world():
    parked = np.tile([0.0, 0.0, 0.5 * np.pi], (3, 1)), [[0, 9.0]] * 3
    for ego, targets in (driven(1500.0), parked):
        poses = np.column_stack([targets, np.zeros(len(ego))])
        shape = np.zeros((1, 4, 2)), np.zeros(len(ego), dtype=np.int64), True
        scenario = Scenario(np.arange(float(len(ego))), ego, poses, 0.0 * poses, *shape)
        motion = motion_of(WORLD, scenario)
        assert 10 < len(numbered_objects(WORLD, motion)) <= 253
        assert motion_of(World("street", 1, 1.0), scenario) == ()


def test_a_fenced_way_has_fences_and_hedges_beside_it_and_is_free():
    ego, targets = driven(150.0)
    found = roadside_objects(World("fenced", 1, 1.0), ego, targets)
    low = [mesh for mesh in found if mesh[0].name in ("fence", "hedge")]
    assert first_parts(low) == {"fence", "hedge"} and len(low) > 10
    assert not {"body", "pole", "bollard"} & first_parts(found)
    way = shapely.LineString(ego[:, :2])
    for mesh in low:
        assert hull_of(mesh).distance(way) > 0.99 * ROAD
        assert np.ptp(bounding_box(mesh)[:, 2]) < 1.7


def test_the_same_motion_gives_the_same_world_and_another_seed_another(beside):
    worlds = (World("roadside", seed, 1.0) for seed in (1, 2))
    same, other = (roadside_objects(world, *driven(150.0)) for world in worlds)
    assert content(*same) == content(*beside) != content(*other)


NONE = World("street", 1, 1.0)
OCCLUDERS = ("parked_car", "post", "hedge")


@cache
def crossing(road_user="cyclist"):
    path = scene_presets.path("crossing", road_user)
    motion = ego_motion(scene_presets.ego("parked"), path.duration, path.sample_time)
    return build_scenario(motion, scene_presets.road_user(road_user), path)


def test_without_an_occluder_settings_in_keys_and_the_scene_are_those_of_before():
    world = compose().configuration.world
    assert world.occluder == "none"
    fields = {"kind": "street", "seed": 1, "contrast": {"float": "1.0"}}
    assert canonical(world) == {"stixel_cli.scene.parameters.World": fields}
    occluded = canonical(replace(world, occluder="hedge"))
    fields["occluder"] = "hedge"
    assert occluded == {"stixel_cli.scene.parameters.World": fields}
    scenario = crossing()
    assert motion_of(NONE, scenario) == ()
    before = numbered_objects(NONE)
    hedge = replace(NONE, occluder="hedge")
    *others, last = numbered_objects(hedge, motion_of(hedge, scenario))
    assert last[0] == max(identity for identity, _ in before) + 1
    for (number, mesh), (other, same) in zip(before, others, strict=True):
        assert number == other and content(mesh) == content(same)


@pytest.mark.parametrize("kind", OCCLUDERS)
@pytest.mark.parametrize("road_user", scene_presets.ROAD_USERS)
def test_it_hides_the_target_for_a_part_of_a_crossing_and_is_in_nobodys_way(kind, road_user):
    scenario = crossing(road_user)
    egos, targets = scenario.ego_poses_world, scenario.target_poses_world[:, :2]
    sights = shapely.linestrings(np.stack([egos[:, :2], targets], axis=1))
    ways = shapely.multipoints(np.concatenate([egos[:, :2], targets]))
    made = []
    for seed in (1, 2):
        mesh = occluder(replace(NONE, seed=seed, occluder=kind), egos, targets)
        points = shapely.multipoints(corners(mesh).reshape(-1, 3)[:, :2])
        assert points.distance(ways) > CLEARANCE
        hidden = shapely.intersects(shapely.convex_hull(points), sights)
        assert hidden.any() and not hidden[0] and not hidden[-1]
        if kind == "hedge":
            assert 0.2 < hidden.mean() < 0.5
        made.append(content(mesh))
    assert made[0] != made[1]
    again = occluder(replace(NONE, seed=1, occluder=kind), egos, targets)
    assert content(again) == made[0]


def test_a_target_that_comes_nearer_along_the_line_of_sight_leaves_no_place():
    egos = np.tile([0.0, 0.0, 0.5 * np.pi], (30, 1))
    targets = np.stack([np.zeros(30), np.linspace(20.0, 5.0, 30)], axis=1)
    with pytest.raises(UserError, match=r"world\.occluder"):
        occluder(replace(NONE, occluder="hedge"), egos, targets)
