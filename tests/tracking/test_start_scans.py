"""Initial states from the first scans alone."""

from dataclasses import replace

import numpy as np
import pytest
from tracking_cases import scans_of

from stixel_cli.config.compose import compose
from stixel_cli.errors import ConfigurationError
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, world_from_target
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.contour.class_size import possible_sizes
from stixel_cli.tracking.motion import transition
from stixel_cli.tracking.several import start_from_scans

CONFIGURATION = compose(["start=scans"]).configuration
START, PRIOR = CONFIGURATION.start, CONFIGURATION.prior
"""Of a car, 4.2 m × 1.7 m."""

WALL = np.array([[-8.0, 14.0], [-7.6, 14.0], [-7.2, 14.0]])
"""A thing that does not move, 30 degrees to the left."""


def approaching(first=0, count=12):
    """A car at 5 m/s, heading down and left, with the wall; the first scans are empty."""
    rates = np.array([-1.5, -4.77, 0.0])
    heading = np.arctan2(rates[1], rates[0])
    poses = [np.array([-1.0, 24.0, heading]) + 0.1 * k * rates for k in range(count)]
    front = np.stack([np.full(7, 2.1), np.linspace(-0.85, 0.85, 7)], axis=1)
    left = np.stack([np.linspace(-2.1, 2.1, 15), np.full(15, 0.85)], axis=1)
    sides = np.concatenate([front, left])
    points = [np.concatenate([WALL, world_from_target(sides, pose)]) for pose in poses]
    return scans_of([np.zeros((0, 2))] * first + points[first:]), poses[0], rates


@pytest.mark.parametrize("first", [0, 4])
def test_the_cluster_that_moves_is_found_and_moved_back_to_before_the_first_scan(first):
    scans, pose, rates = approaching(first)
    state = start_from_scans(scans, START, PRIOR)
    predicted = transition(0.1) @ state.mean
    np.testing.assert_allclose(predicted[:3], pose, atol=0.2)
    np.testing.assert_allclose(predicted[3:], rates, atol=0.15)
    assert np.all(np.linalg.eigvalsh(state.covariance) > 0.0)


def test_bearing_and_range_choose_a_cluster_that_stands():
    scans, _, _ = approaching()
    chosen = replace(START, bearing=(20.0, 40.0), range=(10.0, 20.0))
    state = start_from_scans(scans, chosen, PRIOR)
    assert np.hypot(*(state.mean[:2] - WALL.mean(axis=0))) < 0.5 * PRIOR.length
    assert np.hypot(*state.mean[3:5]) < 0.1
    assert np.sqrt(state.covariance[2, 2]) > 1.0, "the heading is unknown"


def test_of_several_clusters_inside_the_one_nearest_to_the_middle_is_taken():
    places = [(-2.0, 10.0), (2.0, 10.0), (2.0, 14.0)]
    offsets = np.array([[-0.2, 0.0], [0.0, 0.0], [0.2, 0.0]])
    scans = scans_of([np.concatenate([np.array(place) + offsets for place in places])] * 3)
    prior = compose(["road_user=pedestrian"]).configuration.prior
    for bounds, place in (
        ({"bearing": (0.0, 20.0)}, (-2.0, 10.0)),
        ({"bearing": (-20.0, 0.0), "range": (12.0, 16.0)}, (2.0, 14.0)),
        ({"bearing": (-20.0, 0.0), "range": (5.0, 15.0)}, (2.0, 10.0)),
        ({"range": (12.0, 20.0)}, (2.0, 14.0)),
    ):
        state = start_from_scans(scans, replace(START, **bounds), prior)
        assert np.hypot(*(state.mean[:2] - place)) < 0.5, bounds


def test_two_points_start_a_track_and_a_wall_larger_than_the_class_none():
    start = replace(START, bearing=(-10.0, 10.0))
    state = start_from_scans(scans_of([np.array([[0.0, 9.0], [0.1, 9.0]])]), start, PRIOR)
    assert np.isfinite(state.mean).all()
    assert np.sqrt(state.covariance[3, 3]) >= 10.0
    wall = np.stack([np.linspace(-10.0, 10.0, 60), np.full(60, 15.0)], axis=1)
    with pytest.raises(ValueError, match="no scan has a cluster"):
        start_from_scans(scans_of([wall] * 3), replace(START, bearing=(-30.0, 30.0)), PRIOR)


def test_without_a_cluster_the_message_names_the_keys():
    bearing = replace(START, bearing=(0.0, 5.0))
    # The command names the stage, `start`, before it.
    for points, start, fault in (
        (WALL, START, "no cluster of the class's size moves: give start.bearing"),
        (WALL, bearing, r"no scan has a cluster .* in bearing \[0.0, 5.0\] degrees"),
        (np.zeros((0, 2)), START, "no cluster"),
    ):
        with pytest.raises(ValueError, match=fault):
            start_from_scans(scans_of([points] * 5), start, PRIOR)


def test_a_distant_target_of_a_slow_and_sparse_lidar_is_found():
    """One scan a second of a lorry that turns, 90 m away: rays are 1.1 m apart, and it is alone."""
    headings = np.array([0.2, 0.6, 0.1, 0.5, 0.3])
    steps = 6.0 * np.stack([np.cos(headings), np.sin(headings)], axis=1)
    centres = np.array([-60.0, 65.0]) + np.cumsum(steps, axis=0)
    side = np.stack([np.arange(-4.4, 4.5, 1.1), np.full(9, -1.5)], axis=1)
    poses = np.column_stack([centres, headings])
    points = [world_from_target(side, pose) for pose in poses]
    scans = scans_of(points, times=np.arange(5.0))
    prior = replace(PRIOR, length=8.5, width=3.0)
    state = start_from_scans(scans, START, prior)
    predicted = transition(1.0) @ state.mean
    assert np.hypot(*(predicted[:2] - centres[0])) < 2.0
    np.testing.assert_allclose(predicted[3:5], 6.0 * np.array([0.94, 0.34]), atol=1.0)


def test_a_start_of_no_known_class_is_a_mixture_of_all():
    side = np.stack([np.linspace(-0.4, 0.4, 9), np.full(9, 12.0)], axis=1)
    scans = scans_of([side] * 3)
    start = replace(START, bearing=(-30.0, 30.0))
    unknown = compose(["prior=unknown"]).configuration.prior
    priors = [replace(PRIOR, length=size[0], width=size[1]) for size in possible_sizes(unknown)]
    each = [start_from_scans(scans, start, prior) for prior in priors]
    mixed = start_from_scans(scans, start, unknown)
    means = np.array([one.mean for one in each])
    np.testing.assert_allclose(mixed.mean, means.mean(axis=0))
    spread = np.cov(means.T, bias=True)
    covariance = np.mean([one.covariance for one in each], axis=0) + spread
    np.testing.assert_allclose(mixed.covariance, covariance, atol=1e-12)


def test_a_cluster_too_large_for_the_class_may_be_of_another_class():
    side = np.stack([np.linspace(-2.2, 2.2, 30), np.full(30, 12.0)], axis=1)
    scans = scans_of([side] * 3)
    start = replace(START, bearing=(-30.0, 30.0))
    priors = [compose([f"prior={name}"]).configuration.prior for name in ("pedestrian", "unknown")]
    of_pedestrian, unknown = (start_from_scans(scans, start, prior) for prior in priors)
    np.testing.assert_array_equal(of_pedestrian.mean, unknown.mean)
    np.testing.assert_array_equal(of_pedestrian.covariance, unknown.covariance)


def test_a_car_ahead_that_is_chosen_may_have_the_motion_of_the_sensor():
    poses = np.array([[0.0, 1.5 * k, STRAIGHT_AHEAD] for k in range(4)])
    rear = np.stack([np.linspace(-0.85, 0.85, 9), np.full(9, 20.0)], axis=1)
    unit = np.tile(0.01 * np.eye(2), (9, 1, 1))
    seen = [(rear + pose[:2], unit) for pose in poses]
    scans = Scans.of_each(0.1 * np.arange(4), poses, seen)
    chosen = replace(START, bearing=(-5.0, 5.0), motion="sensor")
    predicted = transition(0.1) @ start_from_scans(scans, chosen, PRIOR).mean
    expected = [0.0, 20.0 + 0.5 * PRIOR.length, STRAIGHT_AHEAD, 0.0, 15.0, 0.0]
    np.testing.assert_allclose(predicted, expected, atol=1e-9)
    with pytest.raises(ConfigurationError, match=r"start\.bearing: start\.motion=sensor needs"):
        compose(["start=scans", "start.motion=sensor"])
