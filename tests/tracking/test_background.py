"""A target that is hidden is not what hides it: `stixel_cli.tracking.background`."""

import numpy as np
import pytest
from seen_targets import SENSOR, scans_seen, start_at

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.tracking import gp_ekf
from stixel_cli.tracking.background import Background
from stixel_cli.tracking.contour import contour
from stixel_cli.tracking.contour.class_shape import class_shape
from stixel_cli.tracking.contour.contour_rays import rays_of

PARKED = world_from_target(class_shape("car").outline, np.array([0.0, 8.0, 0.0]))
"""A car 8 m in front of the sensor."""


def passing(user):
    """Poses of a road user that goes from the left to the right behind the parked car."""
    count, speed = {"cyclist": (44, 4.0), "pedestrian": (64, 2.0)}[user]
    xs = -0.5 * 0.1 * speed * count + 0.1 * speed * np.arange(count)
    return np.column_stack([xs, np.full(count, 16.0), np.zeros(count)])


@pytest.mark.parametrize("tracker", [contour, gp_ekf], ids=["contour", "gp_ekf"])
@pytest.mark.parametrize("begins_hidden", [False, True], ids=["seen first", "hidden first"])
@pytest.mark.parametrize("user", ["cyclist", "pedestrian"])
def test_a_target_that_is_hidden_is_not_the_car_that_hides_it(tracker, user, begins_hidden):
    name = tracker.__name__.rpartition(".")[2]
    p = compose(["measurement=fabricated", f"road_user={user}", f"tracker={name}"]).configuration
    poses = passing(user)
    poses = poses[len(poses) // 2 - 5 if begins_hidden else 0 :]
    scans = scans_seen(class_shape(user).outline, poses, noise=0.02, before=PARKED)
    track = tracker.track(scans, start_at(poses), p.prior, p.tracker)
    errors = np.hypot(*(track.means[:, :2] - poses[:, :2]).T)
    spread = np.sqrt(np.trace(track.covariances[:, :2, :2], axis1=1, axis2=2))
    assert (np.diff(track.used_offsets)[np.abs(poses[:, 0]) < 2.0] == 0).all()
    assert track.class_replaced is None
    assert (errors < 3.0 * spread + 0.1).all()
    assert errors[-5:].max() < 0.3


def test_what_stood_elsewhere_is_known_once_the_target_may_be_there():
    near, far = np.array([[0.5, 10.0], [0.7, 10.0]]), np.array([[6.0, 12.0], [6.2, 12.0]])
    points = np.concatenate([near, far])
    rays = rays_of(points, np.tile(1e-4 * np.eye(2), (4, 1, 1)), SENSOR)
    background, place = Background(), np.array([0.0, 10.0])
    assert not background.others(rays, place, 1.0, 0.1, False).any()
    # Its place is known: ranges tell it from what is beside it.
    assert not background.others(rays, place, 1.0, 0.2, False).any()
    expected = [False, False, True, True]
    np.testing.assert_array_equal(background.others(rays, place, 1.0, 2.0, False), expected)
    np.testing.assert_array_equal(background.others(rays, place, 1.0, 0.1, True), expected)


def test_an_object_that_reaches_the_target_is_not_remembered():
    """The points of one object are neighbours: a part of it is within the target's reach."""
    points = np.column_stack([np.linspace(1.0, 6.0, 26), np.full(26, 10.0)])
    rays = rays_of(points, np.tile(1e-4 * np.eye(2), (26, 1, 1)), SENSOR)
    background, place = Background(), np.array([0.0, 10.0])
    assert not background.others(rays, place, 1.0, 0.1, True).any()
