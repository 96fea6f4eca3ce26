"""The bank of classes: weights by hand, and which track it reports."""

import dataclasses

import numpy as np
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.tracking.class_bank import (
    CONTRADICTED,
    CORRELATED_SCANS,
    SPEEDS,
    contradicted,
    log_weights,
    most_probable,
    start_of_other,
)
from stixel_cli.tracking.class_size import CLASSES, ClassSize, class_size, possible_sizes
from stixel_cli.tracking.track import InitialState, Track

COUNT = 4


def track(mark, likelihoods, degrees, deviations=0.0, speed=0.0):
    """A track of `COUNT` scans whose numbers are `mark`, with one point of row `mark` each."""
    means = np.full((COUNT, 8), float(mark))
    means[:, 3:5] = 0.0, speed
    fields = {
        "times": 0.1 * np.arange(COUNT),
        "means": means,
        "covariances": np.full((COUNT, 8, 8), float(mark)),
        "contours_world": np.full((COUNT, 5, 2), float(mark)),
        "contour_directions": np.full((COUNT, 5, 2), float(mark)),
        "contour_std": np.full((COUNT, 5), float(mark)),
        "used_offsets": np.arange(COUNT + 1),
        "used_points": np.full(COUNT, mark),
        "nis": np.full(COUNT, float(mark)),
        "nis_degrees_of_freedom": np.full(COUNT, degrees),
        "log_likelihoods": np.broadcast_to(np.asarray(likelihoods, float), COUNT),
        "size_deviations": np.broadcast_to(np.asarray(deviations, float), COUNT),
    }
    return Track(**fields)


def test_weights_match_a_calculation_by_hand():
    weights = log_weights(
        track(0, [-1.0, -2.0, -3.0, 0.0], 2, [0.0, 1.0, 2.0, 3.0], 5.0), "cyclist"
    )
    gains = np.array([-1.0, -3.0, -6.0, -6.0])
    of_size, of_speed = np.array([0.0, 0.5, 2.0, 4.5]), 0.5 * (5.0 / SPEEDS["cyclist"]) ** 2
    expected = gains / CORRELATED_SCANS - of_size - of_speed - np.log(SPEEDS["cyclist"])
    np.testing.assert_allclose(weights, expected)


def test_a_point_that_fits_better_than_clutter_is_not_left_out_for_free():
    """Of two classes with the same density of the same points, the one that uses more wins."""
    each = -np.log(0.5)
    many, few = log_weights(track(0, 5 * each, 5), "car"), log_weights(track(0, 3 * each, 3), "car")
    assert (many > few).all()
    # A point that fits worse than clutter is better left out.
    worse = log_weights(track(0, 5 * each - 2.0, 6), "car")
    assert (worse < many).all()


def test_a_class_whose_tracker_has_no_number_has_no_weight():
    assert (log_weights(track(0, [0.0, np.nan, 0.0, 0.0], 1), "car")[1:] == -1e9).all()


def test_each_scan_reports_the_class_that_is_most_probable_so_far():
    tracks = {
        "car": track(0, -500.0, 3, speed=2.0),
        "cyclist": track(1, [50.0, 50.0, 0.0, 0.0], 3, speed=2.0),
        "pedestrian": track(2, [0.0, 0.0, 200.0, 200.0], 3, speed=2.0),
    }
    found = most_probable(tracks, None)
    chosen = [1, 1, 2, 2]
    np.testing.assert_array_equal(found.means[:, 0], chosen)
    np.testing.assert_array_equal(found.used_points, chosen)
    for name in ("covariances", "contours_world", "contour_directions", "contour_std", "nis"):
        np.testing.assert_array_equal(getattr(found, name).reshape(COUNT, -1)[:, 0], chosen)
    probabilities = np.array([found.class_probabilities[name] for name in tracks])
    np.testing.assert_allclose(probabilities.sum(axis=0), 1.0)
    np.testing.assert_array_equal(probabilities.argmax(axis=0), chosen)
    # What comes later does not change it.
    later = dict(tracks, car=track(0, [-500.0, -500.0, -500.0, 1e6], 3, speed=2.0))
    np.testing.assert_array_equal(most_probable(later, None).means[:3, 0], chosen[:3])


def test_the_class_of_the_prior_is_reported_until_the_scans_contradict_it():
    off = [0.0, 1.1 * CONTRADICTED, 0.0, 0.0]
    tracks = {
        "car": track(0, -9.0, 3, off, speed=1.0),
        "cyclist": track(1, 9.0, 3, speed=1.0),
        "pedestrian": track(2, -99.0, 3, speed=1.0),
    }
    found = most_probable(tracks, "car")
    np.testing.assert_array_equal(found.means[:, 0], [0, 1, 1, 1])
    np.testing.assert_array_equal(found.size_deviations, off)
    np.testing.assert_array_equal(found.class_replaced, [False, True, True, True])
    # The other classes fit less well: the track is the same as without them.
    tracks["cyclist"] = track(1, -99.0, 3, speed=1.0)
    assert most_probable(tracks, "car") is tracks["car"]


@pytest.mark.parametrize(
    ("ratios", "degrees", "first"),
    [
        ([1.0, 1.2, 0.7, 1.2], 5, 3),
        # With many degrees of freedom at the scans that fit, the others count less.
        ([1.0, 1.2, 0.7, 1.2], [50, 5, 50, 5], None),
        ([0.9, np.nan, 1.2, 0.95], 5, 3),
        ([np.nan, np.nan, 9.0, 9.0], 5, None),
        ([0.9] * 9, 5, None),
        ([0.3] + 9 * [0.5] + 5 * [0.8] + 3 * [0.3], 5, 13),
    ],
)
def test_points_that_fit_badly_scan_after_scan_contradict_a_class(ratios, degrees, first):
    count = len(ratios)
    degrees = np.broadcast_to(degrees, count)
    own = dataclasses.replace(
        track(0, 0.0, 3),
        means=np.zeros((count, 8)),
        covariances=np.zeros((count, 8, 8)),
        size_deviations=np.zeros(count),
        nis=degrees * np.array(ratios),
        nis_degrees_of_freedom=degrees,
    )
    found = contradicted(own, "car")
    np.testing.assert_array_equal(found, np.arange(count) >= (count if first is None else first))


def test_only_its_own_track_contradicts_a_class():
    """A larger gate takes points of other objects: on lidar a pedestrian became a car."""
    tracks = {name: track(i, 99.0 * i, 3, speed=1.0) for i, name in enumerate(CLASSES)}
    for name, own in tracks.items():
        assert most_probable(tracks, name) is own
    fast = track(0, 0.0, 3, speed=1.1 * CONTRADICTED * SPEEDS["pedestrian"])
    assert contradicted(fast, "pedestrian").all()


def test_a_bank_needs_likelihoods():
    plain = dataclasses.replace(track(0, 0.0, 1), log_likelihoods=None)
    with pytest.raises(ValueError, match="likelihoods"):
        log_weights(plain, "car")


def test_start_of_another_class_is_uncertain_by_half_of_the_difference():
    initial = InitialState(np.array([1.0, 2.0, np.pi / 2, 0, 0, 0]), 0.01 * np.eye(6))
    other = ClassSize(np.array([2.0, 1.0]), np.array([0.1, 0.1]))
    found = start_of_other(initial, np.array([5.0, 2.0]), other)
    np.testing.assert_array_equal(found.mean, initial.mean)
    expected = np.diag([0.01 + 0.25, 0.01 + 2.25, 0.01, 0.01, 0.01, 0.01])
    np.testing.assert_allclose(found.covariance, expected, atol=1e-12)


def test_sizes_are_those_of_the_priors():
    priors = {name: compose([f"prior={name}"]).configuration.prior for name in CLASSES}
    for name, prior in priors.items():
        size = class_size(name)
        np.testing.assert_array_equal(size.mean, [prior.length, prior.width])
        np.testing.assert_array_equal(size.stds, [prior.length_std, prior.width_std])
        np.testing.assert_array_equal(possible_sizes(prior), [size.mean])
    unknown = compose(["prior=unknown"]).configuration.prior
    sizes = possible_sizes(unknown)
    np.testing.assert_array_equal(sizes, [class_size(name).mean for name in CLASSES])
    np.testing.assert_allclose([unknown.length, unknown.width], sizes.mean(axis=0), atol=6e-3)
    stds = sizes.std(axis=0) / sizes.mean(axis=0)
    np.testing.assert_allclose([unknown.length_std, unknown.width_std], stds, atol=6e-3)


def test_a_speed_that_is_not_measured_yet_contradicts_no_class():
    """A start with the sensor's motion: the speed is that of the ego car."""
    tracks = {name: track(i, 99.0 * i, 3, speed=9.0) for i, name in enumerate(CLASSES)}
    uncertain = np.tile(9.0 * np.eye(8), (COUNT, 1, 1))
    own = dataclasses.replace(tracks["pedestrian"], covariances=uncertain)
    assert most_probable(dict(tracks, pedestrian=own), "pedestrian") is own
    measured = dataclasses.replace(own, covariances=0.01 * uncertain)
    found = most_probable(dict(tracks, pedestrian=measured), "pedestrian")
    assert found.class_replaced.any()
