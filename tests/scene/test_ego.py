import numpy as np
import pytest
import scene_presets
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.config.compose import compose
from stixel_cli.measurements.fabricated import fabricate_scans
from stixel_cli.scene.ego import Parked, Straight, Turning, ego_motion, ego_poses
from stixel_cli.scene.path import path_poses
from stixel_cli.scene.scenario import Scenario


@pytest.mark.parametrize("name", scene_presets.EGOS)
def test_world_frame_equals_the_first_ego_frame(name):
    motion = ego_motion(scene_presets.ego(name), 10.0, 0.1)
    assert motion.times.shape == (100,) and motion.poses_world.shape == (100, 3)
    np.testing.assert_array_equal(motion.poses_world[0], [0.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(motion.times, 0.1 * np.arange(100))


def test_parked_ego_stays_and_straight_ego_moves_forward():
    assert (ego_motion(Parked("parked"), 2.0, 0.5).poses_world == [0.0, 0.0, np.pi / 2]).all()
    poses = ego_motion(Straight("straight", 3.0), 2.0, 0.5).poses_world
    np.testing.assert_allclose(poses, [[0, 1.5 * k, np.pi / 2] for k in range(4)], atol=1e-12)


@given(st.floats(0, 30), st.floats(-90, 90), st.floats(0.1, 20))
def test_ego_moves_along_its_heading(speed, yaw_rate, time):
    ego, step = Turning("turning", speed, yaw_rate), 1e-5
    before, here, after = ego_poses(ego, np.array([time - step, time, time + step]))
    rates = (after - before) / (2 * step)
    expected = [speed * np.cos(here[2]), speed * np.sin(here[2]), np.radians(yaw_rate)]
    np.testing.assert_allclose(rates, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("duration", "sample_time", "count"),
    [(10.0, 0.1, 100), (0.3, 0.1, 3), (0.04, 0.1, 1), (1.0, 10.0, 1), (1.26, 0.1, 13)],
)
def test_number_of_scans_is_duration_over_sample_time(duration, sample_time, count):
    motion = ego_motion(Parked("parked"), duration, sample_time)
    assert len(motion.times) == len(motion.poses_world) == count


@pytest.mark.parametrize("name", scene_presets.EGOS)
@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
@pytest.mark.parametrize("path", ["turn", "crossing", "approach"])
def test_no_scan_of_the_studies_is_empty(name, kind, path):
    """The presets of the ego car keep the target in view: fabricated without noise."""
    chosen = compose(
        [
            *(f"ego={name}", f"road_user={kind}", f"path={path}"),
            *("measurement=fabricated", "measurement.noise.disparity_std=0"),
        ]
    ).configuration
    motion = ego_motion(chosen.ego, chosen.path.duration, chosen.path.sample_time)
    poses, rates = path_poses(chosen.path, motion.times)
    half = 0.5 * np.array([chosen.prior.length, chosen.prior.width])
    box = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    scenario = Scenario(motion.times, motion.poses_world, poses, rates, box[None])
    scans = fabricate_scans(scenario, chosen.rig, chosen.measurement, seed=0)
    assert np.diff(scans.offsets).min() > 0
