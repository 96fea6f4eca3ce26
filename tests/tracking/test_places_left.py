"""What slides along with the sensor is a structure, unless the places that it left are free."""

from dataclasses import replace

import numpy as np
import pytest
from scans_of_clusters import LONGEST, PRIOR, STD, car, scans_of

from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.measurements.scans import FieldOfView
from stixel_cli.tracking.followed import LEAST_SCANS, follow
from stixel_cli.tracking.several import clusters
from stixel_cli.tracking.several.clusters import confirmed, find_tracks, free_and_occupied

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
    (sliding,) = follow(scans, LONGEST)
    assert len(sliding.rows) == COUNT and sliding.mean[3] == pytest.approx(SPEED, abs=0.5)
    assert find_tracks(scans, PRIOR, STD) == ()


@pytest.mark.parametrize(
    ("counts", "number"),
    [
        ([(9, 0)] * 8, 5),  # as soon as the speed is certain
        ([(9, 0)] * 3 + [(0, 0)] * 6 + [(1, 0)] * 3, 12),  # free places in three of four scans
        ([(9, 0)] * 2 + [(9, 9)] * 8, None),  # a few of the places are free
        ([(0, 0), (9, 0)] * 8, None),
        ([(0, 0)] * 12, None),
    ],
)
def test_a_fast_cluster_moves_if_the_places_that_it_left_are_free(counts, number, monkeypatch):
    scans = driving([car((0.0, 14.0), (0.0, SPEED), k) for k in range(COUNT)])
    (one,) = follow(scans, LONGEST)
    given = iter(counts + [(0, 0)] * COUNT)
    monkeypatch.setattr(clusters, "free_and_occupied", lambda *_: next(given))
    assert confirmed(scans, one, 4.0) == number


def test_a_followed_car_with_the_speed_of_the_ego_is_a_track():
    scans = driving(
        [
            np.concatenate([car((0.0, 14.0), (0.0, SPEED), k), fence(y, (11.3, 15.0))])
            for k, y in enumerate(DRIVEN)
        ]
    )
    (one,) = find_tracks(scans, PRIOR, STD)
    assert one.confirmed == LEAST_SCANS - 1
    assert len(one.rows) == COUNT and all(len(rows) == 8 for rows in one.rows.values())


def test_two_clusters_of_one_car_are_one_track_and_two_cars_abreast_are_two():
    rear = [car((0.0, 14.0), (0.0, SPEED), k) for k in range(COUNT)]
    side = np.array([[0.85, 2.4], [0.85, 2.7]])
    torn = [
        np.concatenate([points, side + np.array([0.0, 14.0 + y])])
        for points, y in zip(rear, DRIVEN, strict=True)
    ]
    scans = driving(torn)
    assert len(follow(scans, LONGEST)) == 2
    (one,) = find_tracks(scans, PRIOR, STD)
    np.testing.assert_array_equal(
        np.concatenate([*one.rows.values()]), np.arange(len(scans.points_world))
    )
    abreast = driving([np.concatenate([points, points + np.array([3.2, 0.0])]) for points in rear])
    assert [len(found.rows) for found in find_tracks(abreast, PRIOR, STD)] == [COUNT, COUNT]


def test_a_parked_car_is_left_behind_without_a_track_and_one_that_drives_off_has_one():
    assert find_tracks(driving([car((2.5, 34.0), (0.0, 0.0), 0)] * COUNT), PRIOR, STD) == ()
    starts = 6
    scans = driving([car((2.5, 20.0), (0.0, 9.0), max(0, k - starts)) for k in range(COUNT)])
    (one,) = find_tracks(scans, PRIOR, STD)
    assert min(one.rows) == 0 and one.confirmed > starts


def test_places_are_free_occupied_hidden_or_out_of_view():
    before = np.array([[0.0, 10.0], [3.0, 10.0], [-3.0, 10.0], [9.0, 10.0]])
    now = np.array([[0.0, 30.0], [3.1, 10.2], [-1.4, 5.0], [6.0, 40.0]])
    scans = driving([before, now, *[np.zeros((0, 2))] * (COUNT - 2)])
    scans.sensor_poses_world[1] = scans.sensor_poses_world[0]
    rows, own = np.arange(4), np.array([7])

    def counts(these, length=4.0):
        return free_and_occupied(scans, 1, own, rows[these], length)

    assert counts([0]) == (1, 0)
    assert counts([1]) == (0, 1)
    assert counts([2]) == counts([3]) == (0, 0)
    assert counts([0, 1, 2, 3]) == (1, 1)
    # Nearer to the cluster than an object's length, the point may be of the object itself.
    assert counts([1], length=35.0) == (0, 0)
