from dataclasses import replace

import numpy as np
import pytest
import scene_presets

from stixel_cli.scene.build import build_scenario
from stixel_cli.scene.contour import is_star_convex
from stixel_cli.scene.ego import ego_motion


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
def test_a_scenario_holds_the_whole_truth(kind):
    path = scene_presets.path("s_curve", kind)
    motion = ego_motion(scene_presets.ego("turning"), path.duration, path.sample_time)
    scenario = build_scenario(motion, scene_presets.road_user(kind), path)
    count = len(motion.times)
    assert scenario.target_poses_world.shape == scenario.target_rates_world.shape == (count, 3)
    np.testing.assert_array_equal(scenario.ego_poses_world, motion.poses_world)
    np.testing.assert_array_equal(scenario.times, motion.times)
    np.testing.assert_allclose(scenario.target_poses_world[0, :2], path.start)
    assert scenario.contour_target.ndim == 2 and scenario.contour_target.shape[1] == 2
    assert scenario.star_convex == is_star_convex(scenario.contour_target)


def test_the_same_scenario_again():
    path, road_user = scene_presets.path("turn", "car"), scene_presets.road_user("car")
    motion = ego_motion(scene_presets.ego("parked"), path.duration, path.sample_time)
    first, again = (build_scenario(motion, road_user, path) for _ in range(2))
    assert first.contour_target.tobytes() == again.contour_target.tobytes()
    assert first.target_poses_world.tobytes() == again.target_poses_world.tobytes()


def test_an_impossible_path_is_refused():
    path = replace(scene_presets.path("turn", "car"), start=(0.0, -3.0))
    motion = ego_motion(scene_presets.ego("parked"), 1.0, 0.1)
    with pytest.raises(ValueError, match=r"path\.start"):
        build_scenario(motion, scene_presets.road_user("car"), path)
