"""Shared errors: the stated directions are the derivatives of the points by each error."""

import numpy as np
import pytest

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rotation
from stixel_cli.measurements.disturbance import disturb_scans
from stixel_cli.measurements.scans import Scans, SharedErrors

SENSOR = np.array([3.0, -2.0, 1.2])
RATES = np.array([4.0, 1.0, 0.3])
POINTS = np.array([[5.0, 9.0], [1.0, 12.0], [8.0, 14.0]])


def placed(sensor: np.ndarray, in_sensor: np.ndarray) -> np.ndarray:
    return sensor[:2] + in_sensor @ rotation(sensor[2]).T


@pytest.mark.parametrize(
    ("errors", "changes"),
    [
        (SharedErrors(position=0.2), np.array([[0.2, 0.0, 0.0], [0.0, 0.2, 0.0]])),
        (SharedErrors(heading=1e-5), np.array([[0.0, 0.0, 1e-5]])),
        (SharedErrors(time=1e-5), 1e-5 * RATES[None]),
    ],
)
def test_an_error_of_the_sensors_pose_moves_points_as_that_pose_does(errors, changes):
    in_sensor = (POINTS - SENSOR[:2]) @ rotation(SENSOR[2])
    found = errors.directions(POINTS, SENSOR, RATES)
    assert found.shape == (3, 2, errors.count)
    for j, change in enumerate(changes):
        np.testing.assert_allclose(
            found[:, :, j], placed(SENSOR + change, in_sensor) - POINTS, atol=1e-8
        )


def test_an_error_of_the_disparity_changes_the_depth_as_the_rig_does():
    focal, baseline = 700.0, 0.5
    coefficients = np.array([0.3, -0.2, 0.8])
    right, depth = ((POINTS - SENSOR[:2]) @ rotation(SENSOR[2] - STRAIGHT_AHEAD)).T
    curve = (right / depth)[:, None] ** np.arange(3) @ coefficients
    # The measured disparity is too large by the curve, so the true depth is greater.
    step = 1e-6
    true = focal * baseline / (focal * baseline / depth - step * curve)
    camera = SENSOR - [0.0, 0.0, STRAIGHT_AHEAD]
    moved = placed(camera, (true / depth)[:, None] * np.stack([right, depth], axis=1))
    scaled = tuple((coefficients / (focal * baseline)).tolist())
    found = SharedErrors(disparity=(scaled,)).directions(POINTS, SENSOR, RATES)
    np.testing.assert_allclose(found[:, :, 0], (moved - POINTS) / step, rtol=1e-4)


def test_an_error_of_all_ranges_is_along_the_rays():
    found = SharedErrors(range_bias=0.1).directions(POINTS, SENSOR, RATES)[:, :, 0]
    offsets = POINTS - SENSOR[:2]
    np.testing.assert_allclose(np.hypot(*found.T), 0.1)
    np.testing.assert_allclose(found[:, 0] * offsets[:, 1], found[:, 1] * offsets[:, 0])


def test_scans_carry_their_shared_errors_and_the_sensors_motion():
    errors = SharedErrors(range_bias=0.1, time=0.5)
    poses = np.array([[0.0, 0.0, 3.1], [2.0, 1.0, -3.1]])
    each = [(POINTS, np.tile(np.eye(2), (3, 1, 1)))] * 2
    scans = Scans.of_each([0.0, 0.5], poses, each, shared_errors=errors)
    disturbed = disturb_scans(scans, None, 1.0, None, 0)
    assert disturbed.shared_errors == errors
    still, moving = (disturbed.shared_directions(k, POINTS)[:, :, 1] for k in range(2))
    np.testing.assert_allclose(still, 0.0)
    rates = np.array([4.0, 2.0, (2.0 * np.pi - 6.2) / 0.5])
    np.testing.assert_allclose(moving, errors.directions(POINTS, poses[1], rates)[:, :, 1])


def test_without_a_stated_error_there_is_no_direction():
    assert SharedErrors().count == 0
    assert SharedErrors().directions(POINTS, SENSOR, RATES).shape == (3, 2, 0)
