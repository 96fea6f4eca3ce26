"""Objects of all that moves: clusters, their tracks, and the places that they left."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
import tracking_cases
from numpy.testing import assert_allclose, assert_array_equal

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.measurements.scans import FieldOfView
from stixel_cli.tracking import several
from stixel_cli.tracking.followed import BEGIN, LEAST_SCANS, assign, follow
from stixel_cli.tracking.motion import transition
from stixel_cli.tracking.several import (
    confirmed,
    find_tracks,
    free_and_occupied,
    own_scans,
    track_each,
)

CONFIGURATION = compose(["start=scans", "tracker=box"]).configuration
PRIOR = CONFIGURATION.prior
REAR = np.stack([np.linspace(-0.85, 0.85, 8), np.zeros(8)], axis=1)
WALL = np.stack([np.linspace(-9.0, -8.0, 5), np.full(5, 25.0)], axis=1)
SIZES = np.array([[PRIOR.length, PRIOR.width]])


def scans_of(points_of_each, poses=None):
    """Scans at 10 Hz of points (n, 2) m whose standard deviation is 0.1 m, of a wide view."""
    scans = replace(tracking_cases.scans_of(points_of_each), field_of_view=None)
    return scans if poses is None else replace(scans, sensor_poses_world=poses)


def found_in(scans):
    """The road users that move."""
    return find_tracks(scans, PRIOR, CONFIGURATION.start)


def car(place, velocity, k):
    """The rear of a car at scan k, (8, 2) m."""
    return REAR + np.array(place) + 0.1 * k * np.array(velocity)


def two_cars(count):
    """A car that drives away, one that comes towards the sensor, and a wall."""
    cars = [((0.0, 10.0), (0.0, 6.0)), ((4.0, 30.0), (0.0, -8.0))]
    return scans_of([np.concatenate([*(car(*one, k) for one in cars), WALL]) for k in range(count)])


def test_each_of_two_cars_that_pass_has_its_track_and_no_point_is_in_both():
    scans = two_cars(15)
    found = found_in(scans)
    assert [len(one.rows) for one in found] == [15, 15]
    rows = [np.concatenate([*one.rows.values()]) for one in found]
    assert_array_equal(scans.points_world[rows[0]], [
        point for k in range(15) for point in car((0.0, 10.0), (0.0, 6.0), k)
    ])  # fmt: skip
    assert not set(rows[0]) & set(rows[1]) and len(rows[1]) == 15 * 8
    truth = ((0.0, 10.0), (4.0, 30.0)), ((0.0, 6.0), (0.0, -8.0))
    for one, place, velocity in zip(found, *truth, strict=True):
        # The visible side is the nearer one. The class is wider than these cars.
        mean = transition(0.1) @ one.initial.mean
        assert_allclose(mean[:2], np.add(place, [0.0, 0.5 * PRIOR.length]), atol=0.3)
        assert_allclose(mean[3:5], velocity, atol=0.05)
        assert mean[2] == pytest.approx(np.arctan2(velocity[1], velocity[0]), abs=0.01)


def test_nearest_neighbours_are_global():
    # The nearest of both states is the first place; the sum is least if the second takes the other.
    unit = np.diag([1.0, 1.0, 9.0, 9.0])
    states = [(np.array([0.0, 0.0, 0.0, 0.0]), unit), (np.array([-1.0, 0.0, 0.0, 0.0]), unit)]
    places = [np.array([0.4, 0.0]), np.array([2.4, 0.0])]
    assert assign(states, places, [np.eye(2)] * 2) == {0: 1, 1: 0}
    # A place outside of all gates has no state, and two states never share one.
    assert assign(states, [np.array([50.0, 0.0])], [np.eye(2)]) == {}
    assert assign(states, places[:1], [np.eye(2)]) == {0: 0}
    assert assign([], places, [np.eye(2)] * 2) == assign(states, [], []) == {}


def seen_in(scans_seen, count):
    """Scans of a car at 5 m/s that is seen in some of them."""
    points = [car((0.0, 12.0), (0.0, 5.0), k) for k in range(count)]
    return scans_of([one if k in scans_seen else one[:0] for k, one in enumerate(points)])


@pytest.mark.parametrize(
    ("seen", "scans"),
    [
        ({3, 4}, []),
        ({3, 4, 5}, [[3, 5]]),
        ({3, 4, 6}, []),
        (set(range(2, 8)) | set(range(8 + LEAST_SCANS, 20)), [[2, 7], [8 + LEAST_SCANS, 19]]),
        (set(range(2, 8)) | set(range(7 + LEAST_SCANS, 20)), [[2, 19]]),
    ],
)
def test_a_track_begins_without_a_gap_and_ends_without_clusters(seen, scans):
    assert BEGIN == 3
    tracks = [one for one in follow(seen_in(seen, 20), SIZES) if len(one.rows) >= BEGIN]
    assert [[min(one.rows), max(one.rows)] for one in tracks] == scans


def test_what_stands_still_and_what_is_seen_shortly_is_no_road_user():
    assert found_in(scans_of([WALL] * 12)) == ()
    assert found_in(seen_in(range(LEAST_SCANS - 1), 12)) == ()
    (one,) = found_in(seen_in(range(4, 4 + LEAST_SCANS), 12))
    assert [*one.rows] == list(range(4, 4 + LEAST_SCANS))
    with pytest.raises(ValueError, match=r"source\.target: auto finds no cluster"):
        track_each((), seen_in(range(4), 12), "", {})


@pytest.mark.parametrize(("error", "count"), [(0.04, 0), (0.2, 1)])
def test_the_error_of_the_sensors_motion_moves_nothing(error, count):
    # At 20 m/s what stands still seems to move by this share of the sensor's motion.
    poses = np.array([[0.0, 2.0 * k, STRAIGHT_AHEAD] for k in range(12)])
    parked = [car((3.0, 45.0 + error * pose[1]), (0.0, 0.0), 0) for pose in poses]
    assert len(found_in(scans_of(parked, poses))) == count


def test_a_thing_larger_than_the_class_is_no_road_user():
    long = np.stack([np.linspace(-6.0, 6.0, 40), np.zeros(40)], axis=1)
    scans = scans_of([long + np.array([0.0, 15.0 + 0.5 * k]) for k in range(12)])
    assert follow(scans, SIZES) == []


def test_the_tracker_gets_the_points_of_its_own_road_user():
    scans = dataclasses.replace(two_cars(12), field_of_view=FieldOfView(-0.5, 0.6))
    found = found_in(scans)
    some = [*found[1].rows][2::2]
    later = dataclasses.replace(found[1], rows={k: found[1].rows[k] for k in some})
    own, rows = own_scans(scans, later)
    assert own.field_of_view == scans.field_of_view
    assert len(own) == 9 and np.diff(own.offsets).tolist() == [8, 0] * 4 + [8]
    assert_array_equal(own.points_world, scans.points_world[rows])
    settings = {"prior": PRIOR, "tracker": CONFIGURATION.tracker}
    both = (found[0], later)
    tracks = track_each(both, scans, "stixel_cli.tracking.baselines.box:track", settings)
    assert [one.first for one in tracks] == [0, 2]
    assert [one.confirmed for one in tracks] == [found[0].confirmed, found[1].confirmed]
    assert [len(one.track.times) for one in tracks] == [12, 9]
    assert set(tracks[1].track.used_points) <= set(rows)
    for one, velocity in zip(tracks, (6.0, -8.0), strict=True):
        assert one.track.means[-1, 4] == pytest.approx(velocity, abs=0.5)


COUNT, SPEED = 20, 8.0
DRIVEN = 0.1 * SPEED * np.arange(COUNT)
POSES = np.stack([np.zeros(COUNT), DRIVEN, np.full(COUNT, STRAIGHT_AHEAD)], axis=1)
HALF_VIEW = 0.35
"""Of the field of view, rad; its border meets the fence at 4.1 m to the side 11 m ahead."""


def fence(ego_y, *parts):
    """Points of a fence beside the way, at fixed places 0.2 m apart, in parts ahead of the ego."""
    y = np.arange(0.0, 60.0, 0.2)
    seen = np.any([(y >= ego_y + low) & (y < ego_y + high) for low, high in parts], axis=0)
    return np.stack([np.full(seen.sum(), 4.1), y[seen]], axis=1)


def driving(points_of_each):
    """Scans of an ego car that drives ahead; its view is `HALF_VIEW` wide to both sides."""
    view = FieldOfView(-HALF_VIEW, HALF_VIEW)
    return replace(scans_of(points_of_each, POSES), field_of_view=view)


@pytest.mark.parametrize(
    "parts",
    [
        [(11.3, 15.0)],  # cut by the border of the view: the places left are outside of it
        [(11.3, 24.0), (25.0, 29.0)],  # a far end that stereo tears off: the fence is still there
    ],
)
def test_a_fence_that_slides_along_is_no_track(parts):
    scans = driving([fence(y, *parts) for y in DRIVEN])
    (sliding,) = follow(scans, SIZES)
    assert len(sliding.rows) == COUNT and sliding.mean[3] == pytest.approx(SPEED, abs=0.5)
    assert found_in(scans) == ()


@pytest.mark.parametrize(
    ("counts", "number"),
    [
        ([(9, 2)] * 8, 5),  # as soon as the speed is certain
        ([(9, 0)] * 2 + [(0, 0)] + [(1, 0)] * 3, 8),  # free places in three scans in a row
        ([(9, 0)] * 2 + [(9, 3)] * 8, None),  # a few of the places are free
        ([(0, 0), (9, 0), (9, 0)] * 8, None),
        ([(0, 0)] * 12, None),
    ],
)
def test_a_fast_cluster_moves_if_the_places_that_it_left_are_free(counts, number, monkeypatch):
    scans = driving([car((0.0, 14.0), (0.0, SPEED), k) for k in range(COUNT)])
    (one,) = follow(scans, SIZES)
    given = iter(counts + [(0, 0)] * COUNT)
    monkeypatch.setattr(several, "free_and_occupied", lambda *_: next(given))
    assert confirmed(scans, one) == number


def test_a_followed_car_with_the_speed_of_the_ego_is_a_track():
    cars = [car((0.0, 14.0), (0.0, SPEED), k) for k in range(COUNT)]
    fences = [fence(y, (11.3, 15.0)) for y in DRIVEN]
    scans = driving([np.concatenate(pair) for pair in zip(cars, fences, strict=True)])
    (one,) = found_in(scans)
    assert one.confirmed == LEAST_SCANS - 1
    assert len(one.rows) == COUNT and all(len(rows) == 8 for rows in one.rows.values())


def test_two_clusters_of_one_car_are_one_track_and_two_cars_abreast_are_two():
    rear = [car((0.0, 14.0), (0.0, SPEED), k) for k in range(COUNT)]
    side = np.array([[0.85, 2.4], [0.85, 2.7]])
    places = np.stack([0.0 * DRIVEN, 14.0 + DRIVEN], axis=1)
    seen = [np.vstack([points, side + at]) for points, at in zip(rear, places, strict=True)]
    scans = driving(seen)
    assert len(follow(scans, SIZES)) == 2
    (one,) = found_in(scans)
    assert_array_equal(np.concatenate([*one.rows.values()]), np.arange(len(scans.points_world)))
    abreast = driving([np.concatenate([points, points + np.array([3.2, 0.0])]) for points in rear])
    assert [len(found.rows) for found in found_in(abreast)] == [COUNT, COUNT]


def test_a_parked_car_is_left_behind_without_a_track_and_one_that_drives_off_has_one():
    assert found_in(driving([car((2.5, 34.0), (0.0, 0.0), 0)] * COUNT)) == ()
    starts = 6
    scans = driving([car((2.5, 20.0), (0.0, 9.0), max(0, k - starts)) for k in range(COUNT)])
    (one,) = found_in(scans)
    assert min(one.rows) == 0 and one.confirmed > starts


def test_places_are_free_occupied_hidden_or_out_of_view():
    before = np.array([[0.0, 10.0], [3.0, 10.0], [-3.0, 10.0], [9.0, 10.0]])
    now = np.array([[0.0, 30.0], [3.1, 10.2], [-1.4, 5.0], [6.0, 40.0]])
    scans = driving([before, now, *[np.zeros((0, 2))] * (COUNT - 2)])
    scans.sensor_poses_world[1] = scans.sensor_poses_world[0]
    rows, own = np.arange(4), np.array([7])

    def counts(these):
        return free_and_occupied(scans, 1, own, rows[these])

    assert counts([0]) == (1, 0)
    assert counts([1]) == (0, 1)
    assert counts([2]) == counts([3]) == (0, 0)
    assert counts([0, 1, 2, 3]) == (1, 1)
