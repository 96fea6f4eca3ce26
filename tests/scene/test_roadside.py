import numpy as np
import pytest
import shapely

from stixel_cli.rendering.placement import motion_of, numbered_objects
from stixel_cli.scene.mesh import bounding_box, corners
from stixel_cli.scene.parameters import World
from stixel_cli.scene.scenario import Scenario
from stixel_cli.scene.world import ROAD, VIEW, roadside_objects

WORLD = World("roadside", 1, 1.0)


def driven(length, count=80):
    """An ego car that turns by 90 degrees over `length` m; a target that crosses ahead of it."""
    s = np.linspace(0.0, 1.0, count)
    angle = 0.5 * np.pi * s
    radius = length / (0.5 * np.pi)
    ego = np.stack([radius * (np.cos(angle) - 1), radius * np.sin(angle), angle + 0.5 * np.pi], 1)
    return ego, ego[:, :2] + np.stack([-20.0 + 40.0 * s, np.full(count, 15.0)], axis=1)


def first_parts(objects):
    """They tell what an object is: a house begins with its walls, a tree with its trunk."""
    return {mesh[0].name for mesh in objects}


@pytest.fixture(scope="module")
def objects():
    return roadside_objects(WORLD, *driven(150.0))


def test_the_way_and_the_view_of_the_target_are_free(objects):
    ego, targets = driven(150.0)
    way = shapely.LineString(ego[:, :2])
    views = shapely.union_all(shapely.linestrings(np.stack([ego[:, :2], targets], axis=1)))
    assert len(objects) > 41
    for mesh in objects[1:]:
        hull = shapely.convex_hull(shapely.MultiPoint(corners(mesh).reshape(-1, 3)[:, :2]))
        assert hull.distance(way) > 0.99 * ROAD
        assert hull.distance(views) > 0.99 * VIEW


def test_objects_are_near_the_way_and_on_its_asphalt(objects):
    road, *others = objects
    low, high = bounding_box(road)[:, :2]
    assert first_parts(others) >= {"walls", "trunk", "pole", "body", "woods"}
    for mesh in others:
        inner = bounding_box(mesh)[:, :2]
        assert (inner[0] >= low).all() and (inner[1] <= high).all()
    ego, _ = driven(150.0)
    for k in (0, 40, 79):
        near = [mesh for mesh in others if mesh[0].name != "woods"]
        places = np.array([bounding_box(mesh)[:, :2].mean(axis=0) for mesh in near])
        assert (np.hypot(*(places - ego[k, :2]).T) < 40.0).sum() >= 8


def test_a_long_drive_has_an_id_for_every_object_and_a_standing_car_has_a_world():
    for ego, targets in (
        driven(1500.0),
        (np.tile([0.0, 0.0, 0.5 * np.pi], (3, 1)), [[0, 9.0]] * 3),
    ):
        still = np.zeros(len(ego), dtype=np.int64)
        scenario = Scenario(
            np.arange(float(len(ego))),
            ego,
            np.column_stack([targets, np.zeros(len(ego))]),
            np.zeros((len(ego), 3)),
            np.zeros((1, 4, 2)),
            still,
            True,
        )
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
        hull = shapely.convex_hull(shapely.MultiPoint(corners(mesh).reshape(-1, 3)[:, :2]))
        assert hull.distance(way) > 0.99 * ROAD
        assert np.ptp(bounding_box(mesh)[:, 2]) < 1.7


def test_the_same_motion_gives_the_same_world_and_another_seed_another(objects):
    def content(found):
        return [(mesh[0].name, corners(mesh).tobytes()) for mesh in found]

    assert content(roadside_objects(WORLD, *driven(150.0))) == content(objects)
    other = World("roadside", 2, 1.0)
    assert content(roadside_objects(other, *driven(150.0))) != content(objects)
