"""After the scans of any sensor: dropout, clutter, and errors that all points share."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from stixel_cli.config.compose import compose
from stixel_cli.errors import ConfigurationError
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, target_from_world, world_from_target
from stixel_cli.measurements.disturbance import disturb_scans
from stixel_cli.measurements.scans import FieldOfView, Scans, SharedErrors, points_along

FIELD = (-0.5, 0.4)


def scans(count=30):
    """Three points per scan of a sensor that moves and turns, from 5.0 s on."""
    times = 5.0 + 0.1 * np.arange(count)
    poses = np.stack([times, 2.0 * times, 0.5 * np.pi + 0.05 * times], axis=-1)
    angles, ranges = np.array([-0.2, 0.0, 0.1]), np.array([10.0, 20.0, 30.0])
    along, across = 0.01 * ranges, 1e-6 * ranges**2
    each = [points_along(pose, angles, ranges, along, across) for pose in poses]
    return Scans.of_each(times, poses, each, FieldOfView(*FIELD))


SCANS = scans()


def test_scans_are_empty_in_the_dropout_and_those_without_any_point_have_no_clutter():
    found = disturb_scans(SCANS, (0.5, 1.5), 0.0, 40.0, seed=0)
    assert_array_equal(np.diff(found.offsets), np.repeat([3, 0, 3], [5, 11, 14]))
    kept = np.delete(np.arange(90), slice(15, 48))
    for name in ("points_world", "covariances_world"):
        assert_array_equal(getattr(found, name), getattr(SCANS, name)[kept])
    assert found.field_of_view == SCANS.field_of_view == FieldOfView(*FIELD)
    empty = SCANS.of_rows(np.arange(0))
    assert len(disturb_scans(empty, None, 5.0, 40.0, seed=0).points_world) == 0


def test_clutter_is_even_over_field_of_view_and_range_and_follows_the_points():
    found = disturb_scans(SCANS, (0.0, 0.0), 20.0, 40.0, seed=0)
    assert len(found.points_world[found.rows(0)]) == 0
    clutter = []
    for k in range(1, 30):
        points = found.points_world[found.rows(k)]
        assert_array_equal(points[:3], SCANS.points_world[SCANS.rows(k)])
        clutter.append(target_from_world(points[3:], SCANS.sensor_poses_world[k]))
    x, y = np.concatenate(clutter).T
    distances, angles = np.hypot(x, y), np.arctan2(y, x)
    assert 500 < len(distances) < 660
    assert distances.max() <= 40.0
    assert abs(np.mean(distances < 20.0) - 0.25) < 0.06
    assert angles.min() >= FIELD[0] and angles.max() <= FIELD[1]
    assert abs(angles.mean() - np.mean(FIELD)) < 0.05


def test_clutter_has_the_variances_of_the_point_of_nearest_range():
    found = disturb_scans(SCANS, None, 20.0, 40.0, seed=0)
    points, covariances = found.points_world[3:10], found.covariances_world[3:10]
    offsets = points - SCANS.sensor_poses_world[0, :2]
    ranges = np.hypot(*offsets.T)
    along = np.einsum("ni,nij,nj->n", offsets, covariances, offsets) / ranges**2
    like = np.array([10.0, 20.0, 30.0])[np.clip(np.rint(ranges / 10.0), 1, 3).astype(int) - 1]
    assert_allclose(along, 0.01 * like, rtol=1e-6)
    across = np.trace(covariances, axis1=1, axis2=2) - along
    assert_allclose(across, 1e-6 * ranges**2, rtol=1e-6)


def test_clutter_without_a_field_of_view_and_its_seeds():
    found = disturb_scans(replace(SCANS, field_of_view=None), None, 20.0, None, seed=0)
    x, y = target_from_world(found.points_world[found.rows(0)], SCANS.sensor_poses_world[0]).T
    angles = np.arctan2(y, x)
    assert np.hypot(x, y).max() <= 30.0 + 1e-9
    assert angles.min() >= -0.2 - 1e-9 and angles.max() <= 0.1 + 1e-9
    whole, again = (disturb_scans(SCANS, None, 3.0, 40.0, seed=1) for _ in range(2))
    other = disturb_scans(SCANS, None, 3.0, 40.0, seed=2)
    part = disturb_scans(SCANS, (0.0, 1.0), 3.0, 40.0, seed=1)
    assert whole.points_world.tobytes() == again.points_world.tobytes()
    assert not np.array_equal(whole.offsets, other.offsets)
    assert_array_equal(part.points_world[part.rows(20)], whole.points_world[whole.rows(20)])


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("measurement.dropout=[2,1]", r"measurement\.dropout: the second must be at least"),
        ("measurement.dropout=[-1,1]", r"measurement\.dropout"),
        ("measurement.clutter_rate=-1", r"measurement\.clutter_rate"),
    ],
)
@pytest.mark.parametrize("kind", ["lidar", "own_scans_here:scans"])
def test_wrong_values_are_refused_with_their_key(kind, text, fault, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own_scans_here.py").write_text("def scans(scenario, seed): ...\n")
    with pytest.raises(ConfigurationError, match=fault):
        compose([f"measurement={kind}", text])


SENSOR = np.array([3.0, -2.0, 1.2])
RATES = np.array([4.0, 1.0, 0.3])
POINTS = np.array([[5.0, 9.0], [1.0, 12.0], [8.0, 14.0]])


@pytest.mark.parametrize(
    ("errors", "changes"),
    [
        (SharedErrors(position=0.2), np.array([[0.2, 0.0, 0.0], [0.0, 0.2, 0.0]])),
        (SharedErrors(heading=1e-5), np.array([[0.0, 0.0, 1e-5]])),
        (SharedErrors(time=1e-5), 1e-5 * RATES[None]),
    ],
)
def test_an_error_of_the_sensors_pose_moves_points_as_that_pose_does(errors, changes):
    in_sensor = target_from_world(POINTS, SENSOR)
    found = errors.directions(POINTS, SENSOR, RATES)
    assert found.shape == (3, 2, errors.count)
    for j, change in enumerate(changes):
        moved = world_from_target(in_sensor, SENSOR + change)
        assert_allclose(found[:, :, j], moved - POINTS, atol=1e-8)


def test_an_error_of_the_disparity_changes_the_depth_as_the_rig_does():
    focal, baseline = 700.0, 0.5
    coefficients = np.array([0.3, -0.2, 0.8])
    camera = SENSOR - [0.0, 0.0, STRAIGHT_AHEAD]
    right, depth = target_from_world(POINTS, camera).T
    curve = (right / depth)[:, None] ** np.arange(3) @ coefficients
    # The measured disparity is too large by the curve, so the true depth is greater.
    step = 1e-6
    true = focal * baseline / (focal * baseline / depth - step * curve)
    moved = world_from_target((true / depth)[:, None] * np.stack([right, depth], axis=1), camera)
    scaled = tuple((coefficients / (focal * baseline)).tolist())
    found = SharedErrors(disparity=(scaled,)).directions(POINTS, SENSOR, RATES)
    assert_allclose(found[:, :, 0], (moved - POINTS) / step, rtol=1e-4)


def test_an_error_of_all_ranges_is_along_the_rays_and_none_has_no_direction():
    found = SharedErrors(range_bias=0.1).directions(POINTS, SENSOR, RATES)[:, :, 0]
    offsets = POINTS - SENSOR[:2]
    assert_allclose(np.hypot(*found.T), 0.1)
    assert_allclose(found[:, 0] * offsets[:, 1], found[:, 1] * offsets[:, 0])
    assert SharedErrors().count == 0
    assert SharedErrors().directions(POINTS, SENSOR, RATES).shape == (3, 2, 0)


def test_scans_carry_their_shared_errors_and_the_sensors_motion():
    errors = SharedErrors(range_bias=0.1, time=0.5)
    poses = np.array([[0.0, 0.0, 3.1], [2.0, 1.0, -3.1]])
    each = [(POINTS, np.tile(np.eye(2), (3, 1, 1)))] * 2
    scans = Scans.of_each([0.0, 0.5], poses, each, shared_errors=errors)
    disturbed = disturb_scans(scans, None, 1.0, None, 0)
    assert disturbed.shared_errors == errors
    target = np.array([20.0, 5.0, 0.3])
    still, moving = (disturbed.pose_shifts(k, target) for k in range(2))
    assert_allclose(still[:, 1], 0.0)
    rates = np.array([4.0, 2.0, (2.0 * np.pi - 6.2) / 0.5])
    # By the time it moves as the sensor's frame does, and turns with it.
    assert_allclose(moving[:2], errors.directions(target[None, :2], poses[1], rates)[0])
    assert moving[2, 1] == pytest.approx(0.5 * rates[2])
