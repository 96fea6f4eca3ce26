from dataclasses import replace

import numpy as np
import pytest
import scene_presets
import shapely

from stixel_cli.config.compose import compose
from stixel_cli.engine.keys import canonical
from stixel_cli.errors import UserError
from stixel_cli.rendering.placement import motion_of, numbered_objects
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.mesh import corners
from stixel_cli.scene.parameters import World
from stixel_cli.scene.path import build_scenario
from stixel_cli.scene.world import CLEARANCE, occluder

NONE = World("street", 1, 1.0)
OCCLUDERS = ("parked_car", "post", "hedge")


def crossing(road_user="cyclist"):
    path = scene_presets.path("crossing", road_user)
    motion = ego_motion(scene_presets.ego("parked"), path.duration, path.sample_time)
    return build_scenario(motion, scene_presets.road_user(road_user), path)


def content(mesh):
    return corners(mesh).tobytes()


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
