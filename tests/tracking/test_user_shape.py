"""A class of a file, an outline of one's own, and what the scans say of the class."""

import json

import numpy as np
import pytest
from refusals import refused

from stixel_cli.config.compose import compose
from stixel_cli.scene.parameters import CLASS_ROWS, ROAD_USER_CLASSES
from stixel_cli.tracking.contour.class_shape import class_shape, visible_shape
from stixel_cli.tracking.contour.class_size import (
    CLASS_SHAPES,
    ClassSize,
    class_size,
    possible_sizes,
)
from stixel_cli.tracking.contour.contour import (
    CONTRADICTED,
    probabilities_of,
    reported_class,
    start_of_other,
)
from stixel_cli.tracking.contour.contour_filter import log_weight
from stixel_cli.tracking.contour.user_shape import MOST_VERTICES, read_class, read_outline
from stixel_cli.tracking.track import REPORTED, InitialState

BIKE = [[1.2, 0.35], [-1.2, 0.06], [-1.2, -0.06], [1.2, -0.35]]


def outline_file(tmp_path, vertices=BIKE):
    file = tmp_path / "bike.csv"
    np.savetxt(file, vertices, "%.17g", ",", header="x,y", comments="")
    return file


def test_an_outline_is_centred_and_counter_clockwise(tmp_path):
    clockwise = np.array(BIKE)[::-1] + np.array([5.0, 1.0])
    vertices = read_outline(outline_file(tmp_path, clockwise))
    np.testing.assert_allclose(sorted(vertices.tolist()), sorted(BIKE), atol=1e-9)
    x, y = vertices.T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0
    file = tmp_path / "bike.npz"
    np.savez(file, x=clockwise[:, 0], y=clockwise[:, 1])
    np.testing.assert_array_equal(read_outline(file), vertices)


@pytest.mark.parametrize(
    ("vertices", "fault"),
    [
        (BIKE[:2], "2 vertices"),
        (np.random.default_rng(0).normal(size=(MOST_VERTICES + 1, 2)), "vertices"),
        ([BIKE[0], BIKE[2], BIKE[1], BIKE[3]], "cross itself"),
        (20.0 * np.array(BIKE), "at most 30 m"),
        ([[0, 0], [1, 0], [2, 0]], "cross itself"),
        ([[0, 0], [np.nan, 0], [1, 1]], "bike.csv"),
    ],
)
def test_an_outline_that_is_none_is_refused(tmp_path, vertices, fault):
    with refused(fault):
        read_outline(outline_file(tmp_path, vertices))


def class_file(tmp_path, without=None, **changes):
    file = tmp_path / "van.json"
    values = CLASS_SHAPES["car"] | changes
    values.pop(without, None)
    file.write_text(json.dumps(values), encoding="utf-8")
    return file


def test_a_class_of_a_file_is_known_as_ours_are_but_for_a_sensor_that_it_lacks(tmp_path):
    file = class_file(tmp_path)
    assert read_class(file) == CLASS_SHAPES["car"]
    np.testing.assert_array_equal(class_shape(str(file)).outline, class_shape("car").outline)
    class_file(tmp_path, without="lidar")
    with pytest.raises(ValueError, match="--sensor lidar"):
        visible_shape(str(file), "lidar")


LIDAR = CLASS_SHAPES["car"]["lidar"]


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"radii": [1000] * 359}, "radii: must be 360 numbers"),
        ({"radii": ["1000"] * 360}, "radii: must be 360 numbers"),
        ({"radii": [0] * 360}, "radii"),
        ({"size": [4520, 10]}, "size must be"),
        ({"size": 4520}, "size: must be 2 numbers"),
        ({"size_stds": [True, True]}, "size_stds"),
        ({"sonar": LIDAR}, "sonar: not an entry"),
        ({"lidar": [1]}, "lidar: must map"),
        ({"lidar": LIDAR | {"insets": [1e9] * 48}}, "lidar.insets: must be 48 numbers"),
        ({"lidar": LIDAR | {"std_factor": [1]}}, "lidar.std_factor: must be a number"),
        ({"lidar": LIDAR | {"std_factor": 0}}, "lidar: stds must be ≥ 0 and std_factor > 0"),
        ({"lidar": {}}, "lidar.depth_biases: must be 216 numbers"),
    ],
)
def test_a_class_file_with_a_fault_is_refused(tmp_path, changes, fault):
    with refused(fault):
        read_class(class_file(tmp_path, **changes))


def composed(*overrides):
    return compose(["measurement=fabricated", "tracker=contour", *overrides]).configuration


def test_the_prior_names_the_files_in_full(tmp_path, monkeypatch):
    file, bike = class_file(tmp_path), outline_file(tmp_path)
    monkeypatch.chdir(tmp_path)
    prior = composed("prior.road_user=van.json").prior
    assert prior.road_user == prior.class_file == str(file)
    size = ["road_user=cyclist", "prior.length=2.4", "prior.width=0.7"]
    prior = composed("prior.outline=bike.csv", *size).prior
    assert (prior.outline, prior.class_file) == (str(bike), None)


@pytest.mark.parametrize(
    ("overrides", "fault"),
    [
        (["prior.road_user=truck"], "prior.road_user: 'truck' is not known"),
        (["prior.road_user=no.json"], "no.json is missing"),
        (["prior.road_user=van.json", "prior.length=4"], "give prior.length=4.52"),
        (["prior.road_user=blind.json"], "--sensor outline"),
        (["prior.outline=bike.csv"], "give prior.length=2.4 prior.width=0.7"),
        (["prior=unknown", "prior.outline=bike.csv"], "prior.outline: needs a class"),
        (["prior.outline=no.csv"], "no.csv is missing"),
        (["prior.outline="], "prior.outline: is empty"),
    ],
)
def test_a_prior_with_a_wrong_file_is_refused(tmp_path, monkeypatch, overrides, fault):
    class_file(tmp_path, without="outline").rename(tmp_path / "blind.json")
    class_file(tmp_path)
    outline_file(tmp_path)
    monkeypatch.chdir(tmp_path)
    with refused(fault):
        composed(*overrides)


def test_a_weight_matches_a_calculation_by_hand_and_leaves_no_point_out_for_free():
    found = log_weight(-6.0, 2.0, 5.0, 3.0, "cyclist")
    variance = CLASS_ROWS["cyclist"].speed ** 2 + 3.0
    expected = -6.0 - 2.0 - 0.5 * 25.0 / variance - 0.5 * np.log(variance)
    assert found == pytest.approx(expected)
    # Of two classes with the same density of the same points, the one that uses more wins.
    each = -np.log(0.5)
    many, few = (log_weight(n * each, 0.0, 1.0, 0.0, "car") for n in (5, 3))
    assert many > few
    # A point that fits worse than clutter is better left out.
    assert log_weight(5 * each - 2.0, 0.0, 1.0, 0.0, "car") < many
    assert log_weight(np.nan, 0.0, 0.0, 0.0, "car") == -1e9
    assert log_weight(0.0, np.inf, 0.0, 0.0, "car") == -1e9


def test_a_speed_that_is_not_measured_says_nothing_about_the_class():
    """A start with the sensor's motion: the speed is that of the ego car."""

    for variance, least, most in ((1e4, -1e-2, 1e-2), (0.01, 20.0, np.inf)):
        pedestrian = log_weight(0.0, 0.0, 9.0, variance, "pedestrian")
        cyclist = log_weight(0.0, 0.0, 9.0, variance, "cyclist")
        assert least < cyclist - pedestrian < most


ODDS = [[-500.0, -500.0, -500.0, -np.inf], [5.0, 5.0, 5.0, 0.0], [0.0, 0.0, 20.0, 40.0]]
WEIGHTS = dict(zip(ROAD_USER_CLASSES, np.array(ODDS), strict=True))


def test_each_scan_reports_the_possible_class_that_is_most_probable_so_far():
    probabilities = probabilities_of(WEIGHTS)
    assert list(probabilities) == list(REPORTED)
    values = np.array(list(probabilities.values()))
    np.testing.assert_allclose(values.sum(axis=0), 1.0)
    np.testing.assert_array_equal(values.argmax(axis=0), [1, 1, 2, 2])
    assert probabilities["cyclist"][0] == pytest.approx(1.0 / (1.0 + np.exp(-5.0)))
    assert probabilities["car"][3] == 0.0
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
