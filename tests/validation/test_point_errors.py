"""Errors of points, the noise that is fitted to them, and faces of labelled boxes."""

import dataclasses
import json

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import rectangle
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.fabricated import FabricatedParameters, fabricate_scans
from stixel_cli.measurements.rays import ConstantNoise, FittedNoise, StereoNoise
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.studies.rq3 import preset
from stixel_cli.validation.pair_errors import face_depths
from stixel_cli.validation.point_errors import point_errors, ranges_along
from stixel_cli.validation.point_statistics import fit_noise

RIG = Rig(640, 480, 60.0, None, None, None, 0.3, 1.5, 0.0, None)
BOX = rectangle(4.5, 1.8)


def fabricated(noise):
    values = "fabricated", None, "tangent", noise, 0.0, 80.0
    return FabricatedParameters(*values, dropout=None, clutter_rate=0.0)


EXACT = fabricated(ConstantNoise("constant", 0.0))


def scenario(count=10, depth=15.0):
    times = 0.1 * np.arange(count)
    target = np.stack([3.0 * times - 1.5, depth + 0.0 * times, 0.3 * times], axis=-1)
    ego = np.stack([0.2 * times, times, 0.5 * np.pi + 0.05 * times], axis=-1)
    return Scenario(times, ego, target, np.tile([3.0, 0.0, 0.3], (count, 1)), BOX[None])


TRUTH = scenario()
PERFECT = fabricate_scans(TRUTH, RIG, EXACT, seed=0)


SCAN = np.repeat(np.arange(len(PERFECT)), np.diff(PERFECT.offsets))
"""Of each perfect point."""
INDEX = np.arange(len(SCAN)) - PERFECT.offsets[SCAN]
OFFSET = PERFECT.points_world - PERFECT.sensor_poses_world[SCAN, :2]
LAST = np.flatnonzero(np.diff(SCAN, append=-1))
"""The leftmost point of each scan: angles ascend."""


def with_points(points, keep=None):
    keep = np.ones(len(SCAN), bool) if keep is None else keep
    count = np.bincount(SCAN[keep], minlength=len(PERFECT))
    kept = {"points_world": points[keep], "covariances_world": PERFECT.covariances_world[keep]}
    offsets = np.concatenate([[0], np.cumsum(count)])
    return dataclasses.replace(PERFECT, offsets=offsets, **kept)


def farther(by):
    return PERFECT.points_world + by * OFFSET / np.hypot(*OFFSET.T)[:, None]


def test_perfect_points_have_no_errors_and_bias_along_the_ray_is_measured():
    errors = point_errors(PERFECT, TRUTH, RIG)
    assert len(errors.scans) == len(PERFECT.points_world) > 1000
    np.testing.assert_allclose(errors.along, 0.0, atol=1e-9)
    np.testing.assert_allclose(errors.disparities, 0.0, atol=1e-9)
    assert errors.covered.all()
    assert errors.clutter.sum() == 0
    assert abs(errors.spacing - 640 / 639) < 1e-3
    reach = np.concatenate([errors.reach_left, errors.reach_right])
    # The ray next to the end is up to one column inside.
    assert np.all(np.abs(reach) <= 0.51)
    errors = point_errors(with_points(farther(0.2)), TRUTH, RIG)
    np.testing.assert_allclose(errors.along, 0.2, atol=1e-9)
    np.testing.assert_allclose(-errors.disparities * errors.range_sensitivities, 0.2, rtol=0.03)


def test_image_borders_follow_the_principal_point_and_ends_outside_are_unknown():
    # The target, in the middle before, is cut by the image's left border.
    rig = dataclasses.replace(RIG, principal_u=20.0)
    points = fabricate_scans(TRUTH, rig, EXACT, seed=0)
    errors = point_errors(points, TRUTH, rig)
    assert 0 < len(errors.scans) < len(PERFECT.points_world)
    assert errors.columns.min() == pytest.approx(-20.5)
    np.testing.assert_allclose(errors.along[errors.columns > -20.0], 0.0, atol=1e-9)
    assert errors.covered.all()
    assert np.isnan(errors.reach_left).any()
    assert np.isfinite(errors.reach_right).all()
    truth = dataclasses.replace(TRUTH, target_poses_world=TRUTH.target_poses_world - [5.5, 0, 0])
    errors = point_errors(fabricate_scans(truth, RIG, EXACT, seed=0), truth, RIG)
    assert 2 <= np.isnan(errors.reach_left).sum() <= 9
    assert np.nanmax(np.abs(errors.reach_left)) <= 0.51
    assert np.abs(errors.reach_right).max() <= 0.51
    assert errors.covered.all()


def test_points_outside_the_silhouette_count_as_fattening():
    points = PERFECT.points_world.copy()
    side = np.stack([-OFFSET[:, 1], OFFSET[:, 0]], axis=-1) / np.hypot(*OFFSET.T)[:, None]
    points[LAST] += 0.1 * side[LAST]
    errors = point_errors(with_points(points), TRUTH, RIG)
    first = np.searchsorted(errors.scans, np.arange(len(PERFECT)))
    beside = errors.inside < 0.0
    assert set(np.flatnonzero(beside)) <= set(first)
    assert beside.sum() >= 9
    columns = 0.1 * RIG.focal / 14.5
    np.testing.assert_allclose(errors.inside[beside], -columns, atol=1.3)
    assert abs(np.mean(errors.reach_left) - columns) < 1.0
    assert abs(np.mean(errors.reach_right)) < 0.5


def test_missed_points_leave_uncovered_columns_and_gross_errors_are_clutter():
    keep = (INDEX < 40) | (INDEX >= 60)
    errors = point_errors(with_points(PERFECT.points_world, keep), TRUTH, RIG)
    assert np.abs(np.sum(~errors.covered) - 20 * len(PERFECT)) <= len(PERFECT)
    points = np.where(keep[:, None], PERFECT.points_world, farther(-4.0))
    errors = point_errors(with_points(points), TRUTH, RIG)
    np.testing.assert_array_equal(errors.clutter, 20)
    assert len(errors.scans) == keep.sum()


@pytest.mark.parametrize("width", [1, 2, 3])
def test_missed_block_is_found_at_any_width(width):
    every = INDEX % width == 0
    block = (INDEX // width % 8 == 5) & (INDEX > 30) & (INDEX < 60)
    whole = point_errors(with_points(PERFECT.points_world, every), TRUTH, RIG)
    errors = point_errors(with_points(PERFECT.points_world, every & ~block), TRUTH, RIG)
    assert abs(whole.spacing - errors.spacing) < 1e-9
    lost = np.count_nonzero(whole.covered) - np.count_nonzero(errors.covered)
    assert abs(lost / np.count_nonzero(block) - 1.0) < 0.1


def test_far_points_with_large_spread_are_kept():
    # At 34 m a pixel of disparity is worth 7 m: 2 m alone would cut the noise at 0.3 px.
    truth = scenario(depth=34.0)
    for std in (0.1, 0.2):
        noisy = fabricated(StereoNoise("stereo", std))
        errors = point_errors(fabricate_scans(truth, RIG, noisy, seed=0), truth, RIG)
        assert errors.clutter.sum() == 0
        assert abs((errors.along / errors.range_sensitivities).std() / std - 1.0) < 0.1


def test_background_points_are_not_clutter():
    offset = OFFSET[LAST]
    turn = 7.0 / RIG.focal * np.stack([-offset[:, 1], offset[:, 0]], axis=-1)
    points = PERFECT.points_world.copy()
    points[LAST] = PERFECT.sensor_poses_world[SCAN[LAST], :2] + 2.0 * (offset + turn)
    # Every scan: one point of the target, and one twice as far, 7 px left of its left end.
    both = with_points(points, (INDEX == 5) | (INDEX[LAST][SCAN] == INDEX))
    errors = point_errors(both, TRUTH, RIG)
    np.testing.assert_array_equal(errors.clutter, 0)
    assert len(errors.scans) == len(LAST)


def test_ranges_end_at_the_first_edge_that_faces_the_sensor():
    contour = np.array([[10.0, -3.0], [13.0, -3.0], [13.0, 3.0], [10.0, 3.0]])
    ranges = ranges_along(contour, np.array([0.0, 0.2, -0.2, 1.0]))
    np.testing.assert_allclose(ranges[:3], 10.0 / np.cos([0.0, 0.2, 0.2]))
    assert ranges[3] == np.inf


def test_scan_without_visible_target_has_no_errors_and_other_times_are_refused():
    for depth in (-20.0, 1.0):
        truth = scenario(count=3, depth=depth)
        empty = np.zeros((0, 2)), np.zeros((0, 2, 2))
        none = Scans.of_each(truth.times, truth.ego_poses_world, [empty] * 3)
        errors = point_errors(none, truth, RIG)
        assert len(errors.scans) == 0 and not errors.covered.any()
        assert np.isnan(errors.spacing) and np.isnan(errors.reach_left).all()
    with pytest.raises(ValueError, match="times"):
        point_errors(PERFECT, scenario(count=9), RIG)


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
    return point_errors(fabricate_scans(truth, RIG, fabricated(noise), seed), truth, RIG)


@pytest.mark.parametrize("name", KNOWN)
def test_known_parameters_are_recovered(name):
    known = KNOWN[name]
    found = fit_noise([errors_of(known, seed) for seed in range(8)])
    assert found.columns_per_point == known.columns_per_point
    tolerances = {"range_bias": 0.02, "disparity_std": 0.02, "edge_metres": 0.01}
    tolerances |= {"edge_metres_std": 0.015, "edge_disparity_std": 0.06, "missed_share": 0.015}
    for key, tolerance in tolerances.items():
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


def test_far_ranges_are_fitted_like_near_ones_and_exact_points_without_noise():
    known = dataclasses.replace(KNOWN["plain"], range_bias=0.2, disparity_std=0.2)
    found = fit_noise([errors_of(known, seed, nearest=25.0) for seed in range(4)])
    assert abs(found.disparity_std - 0.2) < 0.01
    assert abs(found.range_bias - 0.2) < 0.1
    assert found.missed_share < 0.001
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


SMALL = Rig(160, 120, 60.0, None, None, None, 0.3, 1.2, 0.0, None)


def test_the_faces_of_a_car_are_those_that_a_column_sees():
    # Frame of the rays: x ahead, y to the left; the rear is 10 m ahead, the column of u0 sees it.
    contour = rectangle(4.0, 1.8) + np.array([12.0, 0.0])
    depths = face_depths(contour, SMALL)
    seen = np.flatnonzero(np.isfinite(depths))
    assert depths[seen] == pytest.approx(10.0)
    half = 0.9 * SMALL.focal / 10.0
    assert seen[0] == np.ceil(SMALL.u0 - half) and seen[-1] == np.floor(SMALL.u0 + half)
    contour = rectangle(4.0, 1.8) + np.array([12.0, 4.0])
    depths = face_depths(contour, SMALL)
    seen = np.flatnonzero(np.isfinite(depths))
    assert seen[-1] < SMALL.u0
    # From left to right: the rear, then the right side up to the front.
    assert depths[seen[0]] == pytest.approx(10.0) and depths[seen[-1]] > 13.0
    assert (np.diff(depths[seen]) >= -1e-9).all()
