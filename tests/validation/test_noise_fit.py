"""The fitted noise is recovered from scans that it made itself."""

import dataclasses
import json

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from stixel_cli.errors import UserError
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.fabricated import FabricatedParameters, fabricate_scans
from stixel_cli.measurements.rays import ConstantNoise, FittedNoise
from stixel_cli.scene.scenario import Scenario
from stixel_cli.studies.rq3 import preset
from stixel_cli.validation.point_errors import point_errors
from stixel_cli.validation.point_statistics import fit_noise

RIG = Rig(640, 480, 60.0, None, None, None, 0.3, 1.5, 0.0, None)
BOX = np.array([[2.25, -0.9], [2.25, 0.9], [-2.25, 0.9], [-2.25, -0.9]])
KNOWN = {
    "plain": FittedNoise("fitted", 1, 0.0, 0.1, *5 * [0.0], 1.0),
    "like a cyclist": FittedNoise("fitted", 3, 0.12, 0.15, 7.0, -0.08, 0.1, 0.25, 0.06, 6.0),
    "fat edges": FittedNoise("fitted", 2, 0.0, 0.08, 3.0, 0.06, 0.03, 0.4, 0.0, 2.0),
}


def errors_of(noise, seed, count=60, nearest=7.0):
    times = 0.1 * np.arange(count)
    # Away from the camera and turning: all ranges from 7 to 25 m, all sides.
    target = np.stack([0.0 * times, nearest + 3.0 * times, 1.3 * times], axis=-1)
    ego = np.tile([0.0, 0.0, 0.5 * np.pi], (count, 1))
    truth = Scenario(times, ego, target, np.tile([0.0, 3.0, 1.3], (count, 1)), BOX[None])
    measurement = FabricatedParameters(
        "fabricated", None, "tangent", noise, 0.0, 80.0, dropout=None, clutter_rate=0.0
    )
    return point_errors(fabricate_scans(truth, RIG, measurement, seed), truth, RIG)


@pytest.mark.parametrize("name", KNOWN)
def test_known_parameters_are_recovered(name):
    known = KNOWN[name]
    found = fit_noise([errors_of(known, seed) for seed in range(8)])
    assert found.columns_per_point == known.columns_per_point
    for key, tolerance in {
        "range_bias": 0.02,
        "disparity_std": 0.02,
        "edge_metres": 0.01,
        "edge_metres_std": 0.015,
        "edge_disparity_std": 0.06,
        "missed_share": 0.015,
    }.items():
        assert abs(getattr(found, key) - getattr(known, key)) < tolerance, key
    assert abs(found.correlation_columns - known.correlation_columns) < 0.6
    if known.missed_share > 0.0:
        assert abs(found.missed_columns - known.missed_columns) < 1.0


def test_missed_outermost_points_do_not_count_as_moved_ends():
    known = FittedNoise("fitted", 3, *7 * [0.0], 3.0)
    known = dataclasses.replace(known, missed_share=0.15, missed_columns=9.0)
    found = fit_noise([errors_of(known, seed) for seed in range(8)])
    assert abs(found.missed_share - 0.15) < 0.02
    # In columns at a range of 14 m, 40 px a metre.
    assert 40.0 * found.edge_metres_std < 2.0
    assert abs(40.0 * found.edge_metres) < 0.6


def test_far_ranges_are_fitted_like_near_ones():
    known = dataclasses.replace(KNOWN["plain"], range_bias=0.2, disparity_std=0.2)
    found = fit_noise([errors_of(known, seed, nearest=25.0) for seed in range(4)])
    assert abs(found.disparity_std - 0.2) < 0.01
    assert abs(found.range_bias - 0.2) < 0.1
    assert found.missed_share < 0.001


def test_points_without_noise_give_a_fit_without_noise():
    found = fit_noise([errors_of(ConstantNoise("constant", 0.0), 0, count=10)])
    assert found.disparity_std == found.range_bias == 0.0
    assert found.missed_share == 0.0


def test_too_few_points_are_refused():
    far = errors_of(KNOWN["plain"], 0, count=1)
    for name in ("scans", "columns", "along", "range_sensitivities", "inside"):
        object.__setattr__(far, name, getattr(far, name)[:5])
    with pytest.raises(UserError, match="too few to fit"):
        fit_noise([far])


def test_a_preset_file_gives_the_same_noise():
    noise = KNOWN["like a cyclist"]
    text = preset(noise, "some points", "stixel study rq3")
    assert text.startswith("# Fitted to some points.\n# Made by: stixel study rq3\n")
    assert TypeAdapter(FittedNoise).validate_json(json.dumps(yaml.safe_load(text))) == noise
