import json

import numpy as np
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.tracking.contour.class_shape import class_shape, visible_shape
from stixel_cli.tracking.contour.class_size import CLASS_SHAPES
from stixel_cli.tracking.contour.user_shape import MOST_VERTICES, read_class, read_outline

BIKE = [[1.2, 0.35], [-1.2, 0.06], [-1.2, -0.06], [1.2, -0.35]]


def outline_file(tmp_path, vertices=BIKE):
    file = tmp_path / "bike.csv"
    rows = [f"{x},{y}" for x, y in vertices]
    file.write_text("\n".join(["x,y", *rows]), encoding="utf-8")
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
    with pytest.raises(UserError, match=fault) as caught:
        read_outline(outline_file(tmp_path, vertices))
    assert "\n" not in str(caught.value)


def class_file(tmp_path, **changes):
    file = tmp_path / "van.json"
    file.write_text(json.dumps(CLASS_SHAPES["car"] | changes), encoding="utf-8")
    return file


def test_a_class_of_a_file_is_known_as_ours_are(tmp_path):
    file = class_file(tmp_path)
    assert read_class(file) == CLASS_SHAPES["car"]
    np.testing.assert_array_equal(class_shape(str(file)).outline, class_shape("car").outline)


def test_a_class_file_without_the_sensor_that_the_tracker_names_is_refused(tmp_path):
    file = tmp_path / "van.json"
    known = {name: value for name, value in CLASS_SHAPES["car"].items() if name != "lidar"}
    file.write_text(json.dumps(known), encoding="utf-8")
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
    with pytest.raises(UserError, match=fault) as caught:
        read_class(class_file(tmp_path, **changes))
    assert "\n" not in str(caught.value)


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
    blind = {k: v for k, v in CLASS_SHAPES["car"].items() if k != "outline"}
    (tmp_path / "blind.json").write_text(json.dumps(blind), encoding="utf-8")
    class_file(tmp_path)
    outline_file(tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises((ConfigurationError, UserError), match=fault) as caught:
        composed(*overrides)
    assert "\n" not in str(caught.value)
