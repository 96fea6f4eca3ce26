import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stixel_cli.evaluation.evaluate import (
    centre_errors,
    evaluate,
    intersections_over_unions,
    normalised_errors,
    orientation_errors,
)
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track

OUTLINE = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]], float)
COUNT = 5
TIMES = 0.1 * np.arange(COUNT)
POSES = np.stack([TIMES, 10.0 + TIMES, 0.5 * TIMES], axis=-1)
SCENARIO = Scenario(TIMES, np.zeros((COUNT, 3)), POSES, np.zeros((COUNT, 3)), OUTLINE, True)
SCANS = Scans(
    times=TIMES,
    sensor_poses_world=np.zeros((COUNT, 3)),
    offsets=np.array([0, 2, 2, 4, 6, 8]),
    points_world=np.zeros((8, 2)),
    covariances_world=np.tile(np.eye(2), (8, 1, 1)),
)
REQUIRED = {
    "centre_rmse_m",
    "centre_mean_m",
    "orientation_rmse_deg",
    "iou_mean",
    "iou_second_half",
    "iou_final",
    "low_overlap_share",
    "nees_position_mean",
    "nis_mean",
    "scans",
    "points_per_scan_mean",
}


def track_with(shifts):
    """A track that is off the truth by `shifts` (K, 3), pose for pose."""
    poses = POSES + shifts
    contours = np.stack([world_from_target(OUTLINE, pose) for pose in poses])
    directions = contours - poses[:, None, :2]
    return Track(
        times=TIMES,
        means=np.concatenate([poses, np.zeros((COUNT, 5))], axis=1),
        covariances=np.tile(0.25 * np.eye(8), (COUNT, 1, 1)),
        contours_world=contours,
        contour_directions=directions / np.linalg.norm(directions, axis=-1, keepdims=True),
        contour_std=np.full((COUNT, 4), 0.1),
        used_offsets=np.array([0, 2, 2, 3, 5, 7]),
        used_points=np.array([0, 1, 2, 4, 5, 6, 7]),
        nis=np.array([1.0, np.nan, 2.0, 4.0, 2.0]),
        nis_degrees_of_freedom=np.array([2, 0, 1, 2, 2]),
    )


SHIFTS = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0.1], [0, 0, -0.1], [8, 6, 0]], float)


def test_summary_matches_a_calculation_by_hand():
    scores = evaluate(track_with(SHIFTS), SCENARIO, SCANS)
    np.testing.assert_allclose(scores.centre_error, [0, 1, 0, 0, 10], atol=1e-12)
    np.testing.assert_allclose(scores.orientation_error, [0, 0, 0.1, -0.1, 0], atol=1e-12)
    np.testing.assert_allclose(scores.nees_position, [0, 2, 0, 0, 200], atol=1e-9)
    np.testing.assert_allclose(scores.nis, [0.5, np.nan, 2.0, 2.0, 1.0])
    metrics = scores.metrics
    assert set(metrics) >= REQUIRED
    # The area that a square of area 1 shares with itself turned by 0.1 rad.
    turned = 2.0 / (1.0 + np.cos(0.1) + np.sin(0.1))
    turned_iou = turned / (2.0 - turned)
    # The second is shifted by half a side, not quite along a side: turned by 0.05 rad.
    shift = np.cos(0.05), np.sin(0.05)
    common = (2.0 - shift[0]) * (2.0 - shift[1])
    assert scores.iou[1] == pytest.approx(common / (8.0 - common), abs=1e-12)
    np.testing.assert_allclose(scores.iou[[0, 2, 3, 4]], [1, turned_iou, turned_iou, 0], atol=1e-9)
    expected = {
        "centre_rmse_m": np.sqrt(101 / 5),
        "centre_mean_m": 11 / 5,
        "centre_rmse_second_half_m": np.sqrt(100 / 3),
        "centre_final_m": 10.0,
        "orientation_rmse_deg": np.degrees(np.sqrt(0.02 / 5)),
        "orientation_rmse_second_half_deg": np.degrees(np.sqrt(0.02 / 3)),
        "iou_mean": (1 + scores.iou[1] + 2 * turned_iou) / 5,
        "iou_second_half": 2 * turned_iou / 3,
        "iou_final": 0.0,
        "low_overlap_share": 0.2,
        "nees_position_mean": 202 / 5,
        "nees_heading_mean": 2 * 0.04 / 5,
        "nis_mean": 5.5 / 4,
        "scans": 5,
        "empty_scans": 1,
        "points_per_scan_mean": 8 / 5,
        "points_used_mean": 7 / 5,
    }
    assert metrics == pytest.approx(expected, abs=1e-12)


def test_low_overlap_share_counts_iou_below_a_fifth():
    """Squares of side 2, one shifted along the other's side by s: (2 - s) / (2 + s)."""
    still = dataclasses.replace(SCENARIO, target_poses_world=POSES * [1, 1, 0])
    shifts = np.zeros((COUNT, 3))
    shifts[:, 2] = -POSES[:, 2]
    shifts[1:, 0] = 1.3, 1.33, 1.34, 2.5
    scores = evaluate(track_with(shifts), still, SCANS)
    np.testing.assert_allclose(scores.iou[1:4], [0.7 / 3.3, 0.67 / 3.33, 0.66 / 3.34], atol=1e-9)
    assert scores.metrics["low_overlap_share"] == pytest.approx(2 / 5)


def test_metrics_are_plain_numbers():
    metrics = evaluate(track_with(SHIFTS), SCENARIO, SCANS).metrics
    assert all(type(value) in (int, float) for value in metrics.values())
    assert json.loads(json.dumps(metrics)) == metrics


def test_metric_without_value_is_none():
    track = track_with(SHIFTS)
    track = dataclasses.replace(
        track,
        nis=np.full(COUNT, np.nan),
        nis_degrees_of_freedom=np.zeros(COUNT, np.int64),
        used_offsets=np.zeros(COUNT + 1, np.int64),
        used_points=np.zeros(0, np.int64),
        covariances=np.zeros_like(track.covariances),
        means=np.where(np.arange(8) == 2, np.nan, track.means),
    )
    scores = evaluate(track, SCENARIO, SCANS)
    for name in ("orientation_rmse_deg", "nees_position_mean", "nees_heading_mean", "nis_mean"):
        assert scores.metrics[name] is None
    assert scores.metrics["centre_mean_m"] == pytest.approx(11 / 5)
    assert scores.metrics["points_used_mean"] == 0.0


def test_non_finite_track_has_low_overlap_and_no_mean_errors():
    track = track_with(SHIFTS)
    track.contours_world[3] = np.nan
    track.means[3] = np.nan
    scores = evaluate(track, SCENARIO, SCANS)
    assert scores.metrics["centre_rmse_m"] is None
    assert scores.metrics["low_overlap_share"] == pytest.approx(0.4)
    assert scores.metrics["centre_final_m"] == pytest.approx(10.0)


def test_evaluate_rejects_scans_of_other_times():
    with pytest.raises(ValueError, match="times of the scans"):
        evaluate(track_with(SHIFTS), SCENARIO, dataclasses.replace(SCANS, times=TIMES + 1.0))
    with pytest.raises(ValueError, match="times of the track"):
        evaluate(dataclasses.replace(track_with(SHIFTS), times=TIMES[:3]), SCENARIO, SCANS)
    # The track's last point is that of row 7.
    evaluate(track_with(SHIFTS), SCENARIO, SCANS)
    with pytest.raises(ValueError, match="used points"):
        few = dataclasses.replace(SCANS, points_world=np.zeros((7, 2)))
        evaluate(track_with(SHIFTS), SCENARIO, few)


def test_single_scan_is_scored():
    short = Scenario(TIMES[:1], np.zeros((1, 3)), POSES[:1], np.zeros((1, 3)), OUTLINE, True)
    whole = track_with(SHIFTS)
    track = Track(
        *(getattr(whole, f.name)[:1] for f in dataclasses.fields(Track)[:6]),
        used_offsets=whole.used_offsets[:2],
        used_points=whole.used_points[:2],
        nis=whole.nis[:1],
        nis_degrees_of_freedom=whole.nis_degrees_of_freedom[:1],
    )
    scans = dataclasses.replace(SCANS, times=TIMES[:1], offsets=SCANS.offsets[:2])
    metrics = evaluate(track, short, scans).metrics
    assert metrics["iou_mean"] == metrics["iou_second_half"] == metrics["iou_final"] == 1.0


SQUARE = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], float)


@pytest.mark.parametrize(
    ("true", "estimated", "error"),
    [
        ([0.0, 0.0, 1.0], [3.0, 4.0, 1.0], 5.0),
        ([-1.5, 2.0, 0.0], [-1.5, 2.0, 9.0], 0.0),
        ([1e6, 0.0, 0.0], [1e6, -0.25, 0.0], 0.25),
    ],
)
def test_centre_error_is_the_distance(true, estimated, error):
    found = centre_errors(np.array([estimated]), np.array([true]))
    np.testing.assert_allclose(found, [error], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("true", "estimated", "error"),
    [
        (0.1, 0.3, 0.2),
        (np.pi - 0.1, -np.pi + 0.2, 0.3),
        (-np.pi + 0.1, np.pi - 0.2, -0.3),
        (0.0, 7.0 * np.pi, np.pi),
        (0.0, -np.pi, np.pi),
        (2.0 * np.pi, 0.0, 0.0),
    ],
)
def test_orientation_error_is_wrapped(true, estimated, error):
    found = orientation_errors(np.array([estimated]), np.array([true]))
    np.testing.assert_allclose(found, [error], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("true", "estimated", "score"),
    [
        (SQUARE, SQUARE, 1.0),
        (SQUARE, SQUARE[::-1], 1.0),
        (SQUARE, np.add(SQUARE, [1, 0]), 1.0 / 3.0),
        (SQUARE, np.add(SQUARE, [1, 1]), 1.0 / 7.0),
        (SQUARE, SQUARE * 0.5, 0.25),
        (SQUARE, np.add(SQUARE, [5, 0]), 0.0),
        (SQUARE, np.add(SQUARE, [2, 0]), 0.0),
        (SQUARE, SQUARE * 0.0, 0.0),
        (SQUARE, SQUARE * np.nan, 0.0),
        # A bow tie is two triangles of area 1.
        (SQUARE, SQUARE[[0, 1, 3, 2]], 0.5),
        # An L of area 3.
        (np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float), SQUARE, 0.75),
    ],
)
def test_iou_of_known_polygons(true, estimated, score):
    found = intersections_over_unions(estimated[None], true[None])
    np.testing.assert_allclose(found, [score], rtol=0, atol=1e-12)


def test_iou_does_not_depend_on_the_scale():
    """A pedestrian's area is well below 1 m²."""
    for scale in (0.01, 0.3, 50.0):
        found = intersections_over_unions(scale * SQUARE[None] + scale, scale * SQUARE[None])
        np.testing.assert_allclose(found, [1.0 / 7.0], rtol=0, atol=1e-12)


def test_iou_repairs_self_intersecting_polygons():
    estimated = np.array([SQUARE, SQUARE[[0, 1, 3, 2]], SQUARE * np.nan, np.add(SQUARE, [1, 0])])
    found = intersections_over_unions(estimated, np.array([SQUARE] * 4))
    np.testing.assert_allclose(found, [1.0, 0.5, 0.0, 1.0 / 3.0], rtol=0, atol=1e-12)


def test_normalised_error_of_known_values():
    errors = np.array([[1.0, 0.0], [2.0, 1.0], [1.0, 1.0]])
    covariances = np.array([np.diag([0.5, 9.0]), [[2.0, 1.0], [1.0, 2.0]], np.diag([1.0, 0.0])])
    found = normalised_errors(errors, covariances)
    np.testing.assert_allclose(found, [1.0, 1.0, np.nan], rtol=0, atol=1e-12)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**31), angle=st.floats(-4, 4), shift=st.floats(-100, 100))
def test_iou_is_invariant_to_rigid_motions(seed, angle, shift):
    random = np.random.default_rng(seed)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    first, second = random.uniform(-1, 1, (2, 1, 7, 2))
    plain = intersections_over_unions(first, second)
    moved = intersections_over_unions(first @ turn.T + shift, second @ turn.T + shift)
    np.testing.assert_allclose(moved, plain, atol=1e-9)
    np.testing.assert_allclose(intersections_over_unions(second, first), plain, atol=1e-12)
    assert 0.0 <= plain[0] <= 1.0


def test_only_scans_with_a_truth_that_counts_are_scored():
    poses = SCENARIO.target_poses_world.copy()
    poses[3] = np.nan
    counted = np.array([True, True, True, True, False])
    scenario = dataclasses.replace(SCENARIO, target_poses_world=poses, scored=counted)
    scores = evaluate(track_with(SHIFTS), scenario, SCANS)
    assert scores.metrics["scored_scans"] == 3 and scores.metrics["scans"] == 5
    assert scores.metrics["centre_mean_m"] == pytest.approx(1 / 3)
    assert np.isnan(scores.iou).tolist() == [False, False, False, True, False]
    assert "scored_scans" not in evaluate(track_with(SHIFTS), SCENARIO, SCANS).metrics


def test_if_no_scan_counts_there_are_no_scores():
    scenario = dataclasses.replace(SCENARIO, scored=np.zeros(5, dtype=bool))
    metrics = evaluate(track_with(SHIFTS), scenario, SCANS).metrics
    assert metrics["scored_scans"] == 0 and metrics["scans"] == 5
    for name in ("centre_rmse_m", "orientation_rmse_deg", "iou_mean", "low_overlap_share"):
        assert metrics.get(name) is None
    assert metrics["nis_mean"] == pytest.approx(5.5 / 4)
