"""The bank of classes: weights by hand, and which class is reported."""

import numpy as np
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.scene.parameters import CLASS_ROWS, ROAD_USER_CLASSES
from stixel_cli.tracking.contour.class_probabilities import (
    CONTRADICTED,
    log_weight,
    probabilities_of,
    reported_class,
    start_of_other,
)
from stixel_cli.tracking.contour.class_size import ClassSize, class_size, possible_sizes
from stixel_cli.tracking.track import REPORTED, InitialState


def test_a_weight_matches_a_calculation_by_hand():
    found = log_weight(-6.0, 2.0, 5.0, 3.0, "cyclist")
    variance = CLASS_ROWS["cyclist"].speed ** 2 + 3.0
    expected = -6.0 - 2.0 - 0.5 * 25.0 / variance - 0.5 * np.log(variance)
    assert found == pytest.approx(expected)


def test_a_point_that_fits_better_than_clutter_is_not_left_out_for_free():
    """Of two classes with the same density of the same points, the one that uses more wins."""
    each = -np.log(0.5)
    many, few = (log_weight(n * each, 0.0, 1.0, 0.0, "car") for n in (5, 3))
    assert many > few
    # A point that fits worse than clutter is better left out.
    assert log_weight(5 * each - 2.0, 0.0, 1.0, 0.0, "car") < many


def test_a_speed_that_is_not_measured_says_nothing_about_the_class():
    """A start with the sensor's motion: the speed is that of the ego car."""

    def odds(variance):
        pedestrian, cyclist = (
            log_weight(0.0, 0.0, 9.0, variance, name) for name in ("pedestrian", "cyclist")
        )
        return cyclist - pedestrian

    assert odds(1e4) == pytest.approx(0.0, abs=1e-2)
    assert odds(0.01) > 20.0


def test_a_class_whose_filter_has_no_number_has_no_weight():
    assert log_weight(np.nan, 0.0, 0.0, 0.0, "car") == -1e9
    assert log_weight(0.0, np.inf, 0.0, 0.0, "car") == -1e9


WEIGHTS = {
    "car": np.array([-500.0, -500.0, -500.0, -np.inf]),
    "cyclist": np.array([5.0, 5.0, 5.0, 0.0]),
    "pedestrian": np.array([0.0, 0.0, 20.0, 40.0]),
}


def test_each_scan_reports_the_class_that_is_most_probable_so_far():
    probabilities = probabilities_of(WEIGHTS)
    assert list(probabilities) == list(REPORTED)
    values = np.array(list(probabilities.values()))
    np.testing.assert_allclose(values.sum(axis=0), 1.0)
    np.testing.assert_array_equal(values.argmax(axis=0), [1, 1, 2, 2])
    assert probabilities["cyclist"][0] == pytest.approx(1.0 / (1.0 + np.exp(-5.0)))
    assert probabilities["car"][3] == 0.0


def test_a_class_that_the_size_excludes_has_probability_0():
    probabilities = probabilities_of({name: WEIGHTS[name] for name in ("cyclist", "pedestrian")})
    assert list(probabilities) == list(REPORTED)
    np.testing.assert_array_equal(probabilities["car"], 0.0)
    np.testing.assert_allclose(probabilities["cyclist"] + probabilities["pedestrian"], 1.0)


def test_the_class_of_the_prior_is_reported_until_the_scans_contradict_it():
    for cyclist, expected in ((0.9 * CONTRADICTED, "car"), (1.1 * CONTRADICTED, "cyclist")):
        weights = {"car": 0.0, "cyclist": cyclist, "pedestrian": -9.0}
        assert reported_class(weights, "car") == expected
        assert reported_class(weights, None) == "cyclist"


def test_start_of_another_class_is_uncertain_by_half_of_the_difference():
    initial = InitialState(np.array([1.0, 2.0, np.pi / 2, 0, 0, 0]), 0.01 * np.eye(6))
    other = ClassSize(np.array([2.0, 1.0]), np.array([0.1, 0.1]))
    found = start_of_other(initial, np.array([5.0, 2.0]), other)
    np.testing.assert_array_equal(found.mean, initial.mean)
    expected = np.diag([0.01 + 0.25, 0.01 + 2.25, 0.01, 0.01, 0.01, 0.01])
    np.testing.assert_allclose(found.covariance, expected, atol=1e-12)


def test_sizes_are_those_of_the_priors():
    priors = {name: compose([f"prior={name}"]).configuration.prior for name in ROAD_USER_CLASSES}
    for name, prior in priors.items():
        size = class_size(name)
        np.testing.assert_array_equal(size.mean, [prior.length, prior.width])
        np.testing.assert_array_equal(size.stds, [prior.length_std, prior.width_std])
        np.testing.assert_array_equal(possible_sizes(prior), [size.mean])
    unknown = compose(["prior=unknown"]).configuration.prior
    sizes = possible_sizes(unknown)
    np.testing.assert_array_equal(sizes, [class_size(name).mean for name in ROAD_USER_CLASSES])
    np.testing.assert_allclose([unknown.length, unknown.width], sizes.mean(axis=0), atol=6e-3)
    stds = sizes.std(axis=0) / sizes.mean(axis=0)
    np.testing.assert_allclose([unknown.length_std, unknown.width_std], stds, atol=6e-3)
