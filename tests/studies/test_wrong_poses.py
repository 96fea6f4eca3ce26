"""Scans put into the world by wrong poses of the sensor."""

import numpy as np
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.measurements.fabricated import fabricate_scans
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.studies.wrong_poses import wrong_poses

OVERRIDES = ("measurement=fabricated", "measurement/noise=constant", "path=depart", "ego=straight")
SPEED = 5.0


@pytest.fixture(scope="module")
def scenario():
    p = compose((*OVERRIDES, f"ego.speed={SPEED}", "path.duration=0.6")).configuration
    return build_scenario(ego_motion(p.ego, 0.6, 0.1), p.road_user, p.path)


@pytest.fixture(scope="module")
def true(scenario):
    p = compose(OVERRIDES).configuration
    return fabricate_scans(scenario, p.rig, p.measurement, seed=3)


def test_right_poses_change_nothing_but_what_is_stated(scenario, true):
    found = wrong_poses(scenario, 3)
    np.testing.assert_allclose(found.points_world, true.points_world, atol=1e-12)
    np.testing.assert_allclose(found.covariances_world, true.covariances_world, atol=1e-12)
    np.testing.assert_array_equal(found.sensor_poses_world, true.sensor_poses_world)
    file = compose(("measurement=file", "measurement.path=scans.csv")).configuration.measurement
    assert found.shared_errors == file.shared_errors != true.shared_errors


def test_each_error_moves_the_points_as_it_should(scenario, true):
    poses, rows = true.sensor_poses_world, true.rows(4)
    offsets = true.points_world[rows] - poses[4, :2]
    turned = wrong_poses(scenario, 3, yaw_deg=90.0)
    moved = turned.points_world[rows] - poses[4, :2]
    np.testing.assert_allclose(moved, offsets[:, ::-1] * [-1.0, 1.0], atol=1e-9)
    variances = turned.covariances_world[rows, 0, 0]
    np.testing.assert_allclose(variances, true.covariances_world[rows, 1, 1], atol=1e-12)
    farther = wrong_poses(scenario, 3, range_m=0.25).points_world[rows] - poses[4, :2]
    along = offsets / np.hypot(*offsets.T)[:, None]
    np.testing.assert_allclose(farther - offsets, 0.25 * along, atol=1e-9)
    # The ego car drives along y; the first pose has no earlier one.
    late = wrong_poses(scenario, 3, late_s=0.1)
    shift = late.points_world - true.points_world
    np.testing.assert_allclose(shift[rows], [[0.0, -0.1 * SPEED]] * len(offsets), atol=1e-9)
    np.testing.assert_allclose(shift[true.rows(0)], 0.0, atol=1e-9)
    drifting = wrong_poses(scenario, 3, drift_m_s=0.5)
    np.testing.assert_allclose(drifting.sensor_poses_world[4] - poses[4], [0.2, 0.0, 0.0])
    shift = drifting.points_world[rows] - true.points_world[rows]
    np.testing.assert_allclose(shift, [[0.2, 0.0]] * len(offsets), atol=1e-9)
