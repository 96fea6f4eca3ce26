import dataclasses

import numpy as np
import pytest
from seen_targets import SENSOR, scans_seen, start_at
from tracking_cases import CAR

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.tracking.contour import contour_filter, contour_recovery
from stixel_cli.tracking.contour.class_shape import class_shape
from stixel_cli.tracking.contour.contour import track
from stixel_cli.tracking.contour.contour_rays import rays_of, sight_of
from stixel_cli.tracking.contour.contour_recovery import RECENT, cluster_of, is_inconsistent

TRACKER = dataclasses.replace(
    compose(["tracker=contour"]).configuration.tracker, seen_by="fabricated"
)
SHAPE = class_shape("cyclist")
CYCLIST = dataclasses.replace(
    CAR, road_user="cyclist", length=float(SHAPE.size[0]), width=float(SHAPE.size[1])
)


def coming(heading, rate, count=20):
    """Poses (count, 3) of a cyclist that comes towards the sensor and turns, degrees and rad/s."""
    headings = np.radians(heading) + 0.1 * rate * np.arange(count)
    steps = 0.3 * np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    return np.column_stack([np.array([0.0, 12.0]) + np.cumsum(steps, axis=0), headings])


def wrong_side(poses, degrees):
    """A start whose heading is on the other side of the line of sight, and certain."""
    initial = start_at(poses, (0.0, 0.0, np.radians(degrees)))
    return dataclasses.replace(initial, covariance=np.diag([0.04, 0.04, 0.002, 0.1, 0.1, 0.002]))


@pytest.mark.parametrize(
    ("heading", "rate", "error"), [(-90, 0.3, 20), (-105, 0.4, -20), (-75, -0.4, 20)]
)
def test_a_cyclist_seen_from_its_end_is_found_again_on_the_other_side(heading, rate, error):
    poses = coming(heading, rate)
    scans = scans_seen(SHAPE.outline, poses, noise=0.02)
    result = track(scans, wrong_side(poses, error), CYCLIST, TRACKER)
    assert np.hypot(*(result.means[10:, :2] - poses[10:, :2]).T).max() < 0.1
    assert np.abs(wrap_angle(result.means[10:, 2] - poses[10:, 2])).max() < np.radians(5)


def test_a_track_that_the_scans_do_not_contradict_is_left_as_it_is(monkeypatch):
    poses = coming(-105, 0.4)
    scans = scans_seen(SHAPE.outline, poses, noise=0.02)
    with_recovery = track(scans, start_at(poses), CYCLIST, TRACKER)
    monkeypatch.setattr(contour_filter, "is_inconsistent", lambda nis, degrees: False)
    without = track(scans, start_at(poses), CYCLIST, TRACKER)
    assert with_recovery.means.tobytes() == without.means.tobytes()


def test_a_track_is_inconsistent_after_enough_scans_with_a_great_innovation():
    degrees = np.array([4, 4, 0, 4, 4])
    nis = np.array([0.1, 4.0, np.nan, 4.0, 4.0])
    assert [is_inconsistent(nis[:k], degrees[:k]) for k in range(1, 6)] == [False] * 4 + [True]
    assert not is_inconsistent(nis[: RECENT - 1], degrees[: RECENT - 1])
    assert not is_inconsistent(nis / 2.0, degrees)


def test_the_cluster_of_the_points_has_their_neighbours_but_nothing_larger_than_the_class():
    sight = sight_of("cyclist", TRACKER)
    points = np.array([[0.0, 10.0], [0.3, 10.0], [0.6, 10.2], [4.0, 10.0], [0.0, 14.0]])
    rays = rays_of(points, np.tile(1e-4 * np.eye(2), (5, 1, 1)), SENSOR)
    np.testing.assert_array_equal(cluster_of(rays, points, np.array([1]), sight), [0, 1, 2])
    wall = np.column_stack([np.arange(12) * 0.4 - 2.0, np.full(12, 10.0)])
    rays = rays_of(wall, np.tile(1e-4 * np.eye(2), (12, 1, 1)), SENSOR)
    np.testing.assert_array_equal(cluster_of(rays, wall, np.array([5, 6]), sight), [5, 6])


def test_the_update_begins_again_from_turns_to_both_sides():
    turns = contour_recovery.TURNS
    assert turns[0] == 0.0  # of equal results the first one, not turned, is taken
    np.testing.assert_allclose(np.sort(turns), np.sort(-turns), atol=1e-12)
