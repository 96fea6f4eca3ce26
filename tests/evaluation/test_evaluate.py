import dataclasses
import json

import numpy as np
import pytest

from stixel_cli.evaluation import evaluate as of_scans
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.metric_table import OF_ESTIMATES
from stixel_cli.geometry.pose import world_from_target
from stixel_cli.measurements.scans import FieldOfView, Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track

OUTLINE = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]], float)
COUNT = 5
TIMES = 0.1 * np.arange(COUNT)
POSES = np.stack([TIMES, 10.0 + TIMES, 0.5 * TIMES], axis=-1)
RATES = np.tile([3.0, 4.0, 0.5], (COUNT, 1))
SCENARIO = Scenario(TIMES, np.zeros((COUNT, 3)), POSES, RATES, OUTLINE[None])
EACH = [(np.zeros((n, 2)), np.tile(np.eye(2), (n, 1, 1))) for n in (2, 0, 2, 2, 2)]
SCANS = Scans.of_each(TIMES, np.zeros((COUNT, 3)), EACH)


def track_with(shifts):
    """A track that is off the truth by `shifts` (K, 3), pose for pose."""
    poses = POSES + shifts
    contours = np.stack([world_from_target(OUTLINE, pose) for pose in poses])
    states = np.pad(poses, ((0, 0), (0, 5))), np.tile(0.25 * np.eye(8), (COUNT, 1, 1))
    shape = contours, np.full((COUNT, 4), 0.1)
    used = [0, 1], [], [2], [4, 5], [6, 7]
    return Track.of_scans(TIMES, states, shape, used, np.array([1.0, np.nan, 2.0, 4.0, 2.0]))


SHIFTS = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0.1], [0, 0, -0.1], [8, 6, 0]], float)


def test_summary_matches_a_calculation_by_hand():
    scores = evaluate(track_with(SHIFTS), SCENARIO, SCANS)
    np.testing.assert_allclose(scores.centre_error, [0, 1, 0, 0, 10], atol=1e-12)
    np.testing.assert_allclose(scores.orientation_error, [0, 0, 0.1, -0.1, 0], atol=1e-12)
    np.testing.assert_allclose(scores.nees_position, [0, 2, 0, 0, 200], atol=1e-9)
    np.testing.assert_allclose(scores.nis, [0.5, np.nan, 2.0, 2.0, 1.0])
    metrics = scores.metrics
    # The area that a square of area 1 shares with itself turned by 0.1 rad.
    turned = 2.0 / (1.0 + np.cos(0.1) + np.sin(0.1))
    turned_iou = turned / (2.0 - turned)
    # The second is shifted by half a side, not quite along a side: turned by 0.05 rad.
    shift = np.cos(0.05), np.sin(0.05)
    common = (2.0 - shift[0]) * (2.0 - shift[1])
    assert scores.iou[1] == pytest.approx(common / (8.0 - common), abs=1e-12)
    np.testing.assert_allclose(scores.iou[[0, 2, 3, 4]], [1, turned_iou, turned_iou, 0], atol=1e-9)
    expected = {
        "track_lost": 0,
        "time_to_loss_s": None,
        # The last centre is 10 m away, and its standard deviation is 0.5 m.
        "sure_and_wrong_share": 0.2,
        "diverged": 0,
        "time_to_divergence_s": None,
        "centre_rmse_m": np.sqrt(101 / 5),
        "centre_mean_m": 11 / 5,
        "orientation_rmse_deg": np.degrees(np.sqrt(0.02 / 5)),
        # The track stands still; the truth moves at 5 m/s and turns by 0.5 rad/s.
        "speed_error_m_s": 5.0,
        "yaw_rate_error_deg_s": np.degrees(0.5),
        "iou_mean": (1 + scores.iou[1] + 2 * turned_iou) / 5,
        "low_overlap_share": 0.2,
        # The box of a square is the square.
        "iou_box_mean": (1 + scores.iou[1] + 2 * turned_iou) / 5,
        "iou_star_convex_upper_bound": 1.0,
        # Steps of 0.05 below the IoUs 1, 0.32, 0.91 twice, and 0; the step that has it counts half.
        "success": (20 + 6.5 + 2 * 18.5 + 0.5) / 20 / 5,
        # 3 of 5 centres are exact, one is off by 1 m: 9 steps of 3/5, one half way, 10 of 4/5.
        "precision": (9 * 0.6 + 0.7 + 10 * 0.8) / 20,
        "length_error_m": 0.0,
        "width_error_m": 0.0,
        # Equal squares, turned or not, have equal moments: only the centres differ.
        "gaussian_wasserstein_m": 11 / 5,
        # A corner of the turned square is this far outside the other's side.
        "hausdorff_m": (1 + 2 * (np.cos(0.1) + np.sin(0.1) - 1) + 10) / 5,
        "nees_position_mean": 202 / 5,
        "nees_orientation_mean": 2 * 0.04 / 5,
        "nis_mean": 5.5 / 4,
        "scans": 5,
        "empty_scans": 1,
        "points_per_scan_mean": 8 / 5,
        "points_used_mean": 7 / 5,
    }
    others = {"contour_distance_m", "seen_contour_error_m", "band_coverage"}
    others |= {"hidden_contour_error_m", "hidden_band_coverage", "iou_baseline"}
    assert metrics.keys() == expected.keys() | others
    assert {n: metrics[n] for n in expected} == pytest.approx(expected, abs=1e-8)


def test_a_target_leaves_the_view_of_its_sensor():
    # Seen from the origin along y, it moves from 0 to 2.4 m to the left at 10 m: bearings to 13.5°.
    count = 25
    poses = np.stack([-0.1 * np.arange(count), np.full(count, 10.0), np.zeros(count)], axis=1)
    sensors = np.tile([0.0, 0.0, 0.5 * np.pi], (count, 1))
    times = 0.1 * np.arange(count)
    scenario = Scenario(times, sensors, poses, np.zeros((count, 3)), OUTLINE[None])
    view = FieldOfView(-0.1, np.arctan2(1.05, 10.0))
    empty = np.zeros((0, 2)), np.zeros((0, 2, 2))
    scans = Scans.of_each(times, sensors, [empty] * count, view)
    assert np.flatnonzero(of_scans.out_of_view(scenario, scans))[0] == 11
    states = np.zeros((count, 8)), np.tile(np.eye(8), (count, 1, 1))
    contours = np.tile(OUTLINE, (count, 1, 1)), np.ones((count, 4))
    unused = [np.zeros(0, int)] * count
    track = Track.of_scans(times, states, contours, unused, np.full(count, np.nan))
    metrics = evaluate(track, scenario, scans).metrics
    assert metrics["time_out_of_view_s"] == pytest.approx(1.1)
    unknown = dataclasses.replace(scans, field_of_view=None)
    assert "time_out_of_view_s" not in evaluate(track, scenario, unknown).metrics


def test_contour_errors_match_a_calculation_by_hand():
    """A true square of side 2 at (0, 10); estimates of sides 2.2 and 3 about the same centre."""
    still = np.tile([0.0, 10.0, 0.0], (COUNT, 1))
    scenario = dataclasses.replace(SCENARIO, target_poses_world=still)
    sizes = np.array([1.0, 1.1, 1.1, 1.5, 0.5])[:, None, None]
    means = np.concatenate([still, np.zeros((COUNT, 5))], axis=1)
    contours = {"contours_world": sizes * OUTLINE + [0.0, 10.0]}
    contours |= {"contour_std": np.full((COUNT, 4), 0.07)}
    track = dataclasses.replace(track_with(np.zeros((COUNT, 3))), means=means, **contours)
    metrics = evaluate(track, scenario, SCANS).metrics
    sides = 2 * np.array([0.0, 0.1, 0.1, 0.5, -0.5])
    assert metrics["length_error_m"] == pytest.approx(np.sqrt(np.mean(sides**2)))
    assert metrics["width_error_m"] == pytest.approx(metrics["length_error_m"])
    # The corners are farthest apart.
    corners = np.sqrt(2) * np.abs(sides) / 2
    assert metrics["hausdorff_m"] == pytest.approx(corners.mean())
    # The side that the sensor at the origin sees is half a difference of sides away: straight
    # outwards if the estimate is larger; if it is smaller, half of the side is next to a corner.
    x = np.linspace(-1, 1, 19)
    to_smaller = np.hypot(0.5, np.maximum(np.abs(x) - 0.5, 0.0)).mean()
    seen = np.array([0.0, 0.1, 0.1, 0.5, to_smaller])
    assert metrics["seen_contour_error_m"] == pytest.approx(seen.mean(), abs=1e-9)
    # Without noise in the pose, the hidden sides are as far away, but for one corner each.
    assert metrics["hidden_contour_error_m"] == pytest.approx(seen.mean(), abs=0.02)
    assert metrics["hidden_band_coverage"] == pytest.approx(metrics["band_coverage"], abs=0.03)
    # Along a ray at the angle a from a side's normal, the sides are 0.1 / cos a apart: within
    # 1.96 * 0.07 where cos a > 0.729, on |tan a| < 0.939 of a side from -1 to 1.
    shares = np.mean(np.abs(np.tile(np.linspace(-1, 1, 18, endpoint=False), 4)) < 0.939)
    assert metrics["band_coverage"] == pytest.approx((1 + 2 * shares) / 5)
    # A square of side s has the variance s² / 12 along each axis.
    apart = np.sqrt(2) * np.abs(sides) / np.sqrt(12)
    assert metrics["gaussian_wasserstein_m"] == pytest.approx(apart.mean(), abs=1e-9)


def test_contour_distance_is_the_mean_of_both_ways():
    """A true square of side 2 within an estimate of side 4 about the same centre."""
    track = track_with(np.zeros((COUNT, 3)))
    middle = track.means[:, None, :2]
    track.contours_world[:] = 2.0 * (track.contours_world - middle) + middle
    beyond = np.maximum(np.abs(np.linspace(-2, 2, 18, endpoint=False)) - 1.0, 0.0)
    outer = np.hypot(1.0, beyond).mean()
    metrics = evaluate(track, SCENARIO, SCANS).metrics
    assert metrics["contour_distance_m"] == pytest.approx((1.0 + outer) / 2)


def test_where_only_the_box_is_known_the_outline_has_no_scores():
    scores = evaluate(track_with(SHIFTS), dataclasses.replace(SCENARIO, only_box=True), SCANS)
    known = evaluate(track_with(SHIFTS), SCENARIO, SCANS).metrics
    outline = {"iou_mean", "iou_star_convex_upper_bound", "low_overlap_share", "hausdorff_m"}
    outline |= {"gaussian_wasserstein_m", "contour_distance_m", "seen_contour_error_m"}
    outline |= {"band_coverage", "hidden_contour_error_m", "hidden_band_coverage"}
    assert np.isnan(scores.iou).all()
    for name, value in scores.metrics.items():
        assert value == (None if name in outline else known[name]), name
    assert known["iou_box_mean"] > 0 and known["success"] > 0


def test_metrics_are_plain_numbers_or_none():
    metrics = evaluate(track_with(SHIFTS), SCENARIO, SCANS).metrics
    assert all(type(value) in (int, float) for value in metrics.values() if value is not None)
    assert json.loads(json.dumps(metrics)) == metrics
    unsure = track_with(SHIFTS)
    states = unsure.means, np.zeros_like(unsure.covariances)
    contours = unsure.contours_world, unsure.contour_std
    unused = Track.of_scans(TIMES, states, contours, [[]] * COUNT, np.full(COUNT, np.nan))
    metrics = evaluate(unused, SCENARIO, SCANS).metrics
    for name in ("nees_position_mean", "nees_orientation_mean", "nis_mean"):
        assert metrics[name] is None
    assert metrics["centre_mean_m"] == pytest.approx(11 / 5) and metrics["points_used_mean"] == 0.0


@pytest.mark.parametrize("field", ["means", "covariances", "contours_world"])
def test_a_track_that_is_not_finite_has_no_scores(field):
    track = track_with(SHIFTS)
    getattr(track, field)[2] = np.nan
    with pytest.raises(ValueError, match=f"{field} of its track are not finite at scan 2"):
        evaluate(track, SCENARIO, SCANS)


def test_classes_are_compared_with_the_road_user_and_the_prior():
    cyclist = np.array([0.2, 0.3, 0.6, 0.7, 0.9])
    values = {"car": 0.0 * cyclist, "cyclist": cyclist, "pedestrian": 1.0 - cyclist}
    track = dataclasses.replace(track_with(SHIFTS), class_probabilities=values)
    names = ("car_probability", "cyclist_probability", "pedestrian_probability")
    names += ("class_error", "class_replaced_share")
    replaced = np.array([False, False, True, True, True])
    for road_user, of_prior, expected in (
        ("cyclist", None, [0.0, 0.9, 0.1, 0.0, None]),
        ("pedestrian", replaced, [0.0, 0.9, 0.1, 1.0, 0.6]),
        (None, replaced, [0.0, 0.9, 0.1, None, 0.6]),
    ):
        own = dataclasses.replace(track, class_replaced=of_prior)
        metrics = evaluate(own, SCENARIO, SCANS, road_user).metrics
        assert [metrics[name] for name in names] == pytest.approx(expected)
    assert not set(names) & set(evaluate(track_with(SHIFTS), SCENARIO, SCANS).metrics)
    # A track that names no class names no wrong one.
    of_none = dataclasses.replace(track, class_probabilities=values | {"other": 2.0 * cyclist})
    metrics = evaluate(of_none, SCENARIO, SCANS, "pedestrian").metrics
    assert metrics["class_error"] is None


def test_a_smoothed_track_has_metrics_of_its_own_and_changes_no_other():
    filtered, later = track_with(SHIFTS), track_with(0.5 * SHIFTS)
    both = dataclasses.replace(filtered, smoothed=dataclasses.replace(later, lag=3))
    found, plain, of_later = (evaluate(track, SCENARIO, SCANS) for track in (both, filtered, later))
    own = {f"smoothed_{name}": of_later.metrics[name] for name in OF_ESTIMATES}
    assert found.metrics == plain.metrics | own | {"smoothed_lag": 3}
    assert found.metrics["smoothed_centre_mean_m"] < found.metrics["centre_mean_m"]
    np.testing.assert_array_equal(found.centre_error, plain.centre_error)
    whole = dataclasses.replace(filtered, smoothed=dataclasses.replace(later, lag=None))
    assert evaluate(whole, SCENARIO, SCANS).metrics["smoothed_lag"] == COUNT - 1


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
    short = Scenario(TIMES[:1], np.zeros((1, 3)), POSES[:1], np.zeros((1, 3)), OUTLINE[None])
    whole = track_with(SHIFTS)
    names = [f.name for f in dataclasses.fields(Track)[:6]] + ["nis", "nis_degrees_of_freedom"]
    cut = {name: getattr(whole, name)[:1] for name in names}
    cut |= {name: getattr(whole, name)[:2] for name in ("used_offsets", "used_points")}
    track = Track(**cut)
    scans = dataclasses.replace(SCANS, times=TIMES[:1], offsets=SCANS.offsets[:2])
    metrics = evaluate(track, short, scans).metrics
    assert metrics["iou_mean"] == 1.0


def test_normalised_errors_of_known_covariances():
    errors = np.array([[1.0, 0.0], [2.0, 1.0], [1.0, 1.0]])
    covariances = np.array([np.diag([0.5, 9.0]), [[2.0, 1.0], [1.0, 2.0]], np.diag([1.0, 0.0])])
    found = of_scans.normalised_errors(errors, covariances)
    np.testing.assert_allclose(found, [1.0, 1.0, np.nan], rtol=0, atol=1e-12)


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


def test_without_any_truth_that_counts_there_are_metrics_of_the_scans():
    unknown = dict.fromkeys(("target_poses_world", "target_rates_world"), np.nan * POSES)
    unknown |= {"contours_target": np.zeros((1, 0, 2))}
    for changes in ({"scored": np.zeros(COUNT, dtype=bool)}, unknown):
        scenario = dataclasses.replace(SCENARIO, **changes)
        metrics = evaluate(track_with(SHIFTS), scenario, SCANS).metrics
        assert metrics["scans"] == 5 and metrics["nis_mean"] == pytest.approx(5.5 / 4)
        for name in ("centre_rmse_m", "orientation_rmse_deg", "iou_mean", "low_overlap_share"):
            assert metrics.get(name) is None


def test_the_baseline_is_the_true_outline_at_the_mean_of_its_points():
    # Points on the near side of a square of side 2; the third is of something else.
    still = dataclasses.replace(SCENARIO, target_poses_world=np.tile([0.0, 10.0, 0.0], (COUNT, 1)))
    points = np.tile([[-0.5, 9.0], [0.5, 9.0]], (4, 1))
    points[6:] = [0.0, 9.0], [5.0, 9.0]
    scans = dataclasses.replace(SCANS, points_world=points)
    metrics = evaluate(track_with(SHIFTS), still, scans).metrics
    # Moved by half a side, at each of the four scans with points.
    assert metrics["iou_baseline"] == pytest.approx(1 / 3)
    away = dataclasses.replace(SCANS, points_world=points + 9.0)
    assert evaluate(track_with(SHIFTS), still, away).metrics["iou_baseline"] is None
