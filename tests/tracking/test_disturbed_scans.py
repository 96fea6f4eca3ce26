"""`tracker=contour` through dropout, empty scans and clutter, and with another class's prior."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.metric_table import OF_SIZE
from stixel_cli.evaluation.verdict import misfits_class, verdict
from stixel_cli.measurements.disturbance import disturb_scans
from stixel_cli.measurements.fabricated import fabricate_scans
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.tracking.contour import contour
from stixel_cli.tracking.contour.class_shape import class_shape
from stixel_cli.tracking.contour.contour import track
from stixel_cli.tracking.contour.contour_filter import ClassFilter
from stixel_cli.tracking.contour.contour_rays import rays_of, sight_of
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.several import start_from_scans
from stixel_cli.tracking.start import noisy_start

USERS = ("car", "cyclist", "pedestrian")
SEED = 0


@cache
def clean(user, duration=2):
    """Configuration, scenario and fabricated scans of a road user that crosses."""
    words = ["measurement=fabricated", "measurement/noise=constant", "tracker=contour"]
    words += [f"measurement.noise.range_std={0.1 if user == 'car' else 0.05}"]
    words += [f"road_user={user}", "path=crossing", f"path.duration={duration}"]
    p = compose(words).configuration
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(ego, p.road_user, p.path)
    return p, scenario, fabricate_scans(scenario, p.rig, p.measurement, SEED)


def followed(user, scans, start, duration=2):
    """The metrics of a track of the scans."""
    p, scenario, _ = clean(user, duration)
    initial = noisy_start(scenario, p.start, SEED)
    if start == "scans":
        initial = start_from_scans(scans, compose(["start=scans"]).configuration.start, p.prior)
    return evaluate(track(scans, initial, p.prior, p.tracker), scenario, scans).metrics


@cache
def undisturbed(user, start, duration=2):
    """The metrics of a track of the clean scans."""
    return followed(user, clean(user, duration)[2], start, duration)


def disturbed(user, duration):
    """The scans with 1 s of dropout, clutter of 10 % of the points; every seventh scan is empty."""
    _, _, scans = clean(user, duration)
    rate = 0.1 * len(scans.points_world) / len(scans)
    # Not the greatest range: there clutter would hardly ever be near the target.
    found = disturb_scans(scans, (1.0, 1.9), rate, 20.0, SEED)
    empty = np.zeros((0, 2)), np.zeros((0, 2, 2))
    each = [empty if k % 7 == 6 else points_of(found, k) for k in range(len(found))]
    return with_points(found, each)


def points_of(scans, k):
    """Points and covariances of scan k."""
    return scans.points_world[scans.rows(k)], scans.covariances_world[scans.rows(k)]


def with_points(scans, each):
    """The scans with these points and covariances."""
    view = scans.field_of_view
    return Scans.of_each(scans.times, scans.sensor_poses_world, each, field_of_view=view)


@pytest.mark.parametrize(
    ("user", "start"), [("car", "default"), ("cyclist", "scans"), ("pedestrian", "scans")]
)
def test_dropout_empty_scans_and_clutter_cost_little(user, start):
    scans, duration = disturbed(user, 3), 3
    assert (np.diff(scans.offsets) == 0).sum() >= 13
    before = undisturbed(user, start, duration)
    after = followed(user, scans, start, duration)
    assert (before["track_lost"], after["track_lost"]) == (0, 0)
    # The outline of a cyclist is so thin that a few centimetres across it cost more.
    assert user == "cyclist" or after["iou_mean"] > before["iou_mean"] - 0.05
    assert after["iou_box_mean"] > before["iou_box_mean"] - 0.06


@cache
def of_prior(user, prior, sensor="fabricated"):
    """The track of a road user with the prior of another class, from the scans alone."""
    words = [f"prior={prior}", "tracker=contour", f"measurement={sensor}", "start=scans"]
    p = compose(words).configuration
    scans = clean(user)[2]
    return track(scans, start_from_scans(scans, p.start, p.prior), p.prior, p.tracker)


@pytest.mark.parametrize("user", USERS)
def test_an_unknown_class_is_found(user):
    _, scenario, scans = clean(user)
    result = of_prior(user, "unknown")
    metrics = evaluate(result, scenario, scans, road_user=user).metrics
    assert metrics["class_error"] == 0
    assert result.class_probabilities[user][10:].min() > 0.9, "after one second"
    assert verdict(metrics)[-1].startswith(f"Class: {user}, ")
    assert not misfits_class(metrics)
    assert metrics["iou_box_mean"] > undisturbed(user, "scans")["iou_box_mean"] - 0.05


OTHERS = {"car": "pedestrian", "cyclist": "car", "pedestrian": "cyclist"}
"""A class to one that is not its own."""


@pytest.mark.parametrize(
    ("user", "prior", "fits"),
    [*((user, user, True) for user in USERS), *((*pair, False) for pair in OTHERS.items())],
)
def test_a_wrong_class_is_reported_without_the_truth(user, prior, fits):
    _, scenario, scans = clean(user)
    result = of_prior(user, prior)
    metrics = evaluate(result, scenario, scans, road_user=user).metrics
    assert (metrics["track_lost"], metrics["diverged"]) == (0, 0)
    assert (result.class_replaced is None) == fits
    assert metrics.get("class_error") == (None if fits else 0)
    assert any("do not fit the prior" in text for text in verdict(metrics)) != fits
    # Of the scans alone: a truth elsewhere changes nothing.
    away = scenario.target_poses_world + np.array([30.0, 0.0, 1.0])
    moved = dataclasses.replace(scenario, target_poses_world=away)
    for name in OF_SIZE:
        assert evaluate(result, moved, scans).metrics[name] == metrics[name]


def test_each_scan_has_the_state_of_the_class_that_it_reports(monkeypatch):
    p, scenario, whole = clean("cyclist")
    count = 6
    each = [points_of(whole, k) for k in range(count)]
    first = whole.times[:count], whole.sensor_poses_world[:count]
    scans = Scans.of_each(*first, each, field_of_view=whole.field_of_view)
    unknown = compose(["prior=unknown", "tracker=contour", "measurement=fabricated"]).configuration
    initial = noisy_start(scenario, p.start, SEED)
    monkeypatch.setattr(contour, "not_ruled_out", lambda filters, own: filters)

    def reporting(classes):
        chosen = iter(classes)
        monkeypatch.setattr(
            contour, "reported_class", lambda weights, assumed: [*weights][next(chosen)]
        )
        return track(scans, initial, unknown.prior, unknown.tracker)

    known = [reporting(np.full(count, i)) for i in range(len(USERS))]
    result = reporting(np.arange(count) % len(USERS))
    for k in range(count):
        one = known[k % len(USERS)]
        for name in ("means", "covariances", "contours_world", "contour_std", "nis"):
            np.testing.assert_array_equal(getattr(result, name)[k], getattr(one, name)[k])
        rows, own = (t.used_points[slice(*t.used_offsets[k : k + 2])] for t in (result, one))
        np.testing.assert_array_equal(rows, own)


@pytest.mark.parametrize("user", USERS)
def test_the_other_classes_change_nothing_while_the_prior_fits(user):
    p, scenario, scans = clean(user)
    initial = noisy_start(scenario, p.start, SEED)
    # Of a lidar's points a class has one form, and so one filter.
    tracker = dataclasses.replace(p.tracker, seen_by="lidar")
    seen = class_shape(user), sight_of(user, tracker)
    alone = ClassFilter(initial, p.prior, *seen, tracker, face_errors=0)
    bank = track(scans, initial, p.prior, tracker)
    for k, interval in enumerate(intervals(scans.times)):
        rays = rays_of(*points_of(scans, k), scans.sensor_poses_world[k], scans.field_of_view)
        used = alone.step(interval, rays)
        one = alone.report()
        np.testing.assert_array_equal(bank.means[k], one.means[0])
        rows = slice(*bank.used_offsets[k : k + 2])
        np.testing.assert_array_equal(bank.used_points[rows], used + scans.offsets[k])
        more = np.linalg.eigvalsh(bank.covariances[k] - one.covariances[0])
        assert more.min() > -1e-9
    # But the estimate is less certain, until it is clear that they do not fit.
    assert np.abs(more).max() < 1e-9


@pytest.mark.parametrize(("user", "prior"), list((OTHERS | {"car": "unknown"}).items()))
def test_classes_that_are_dropped_would_change_nothing(user, prior, monkeypatch):
    expected = of_prior(user, prior)
    monkeypatch.setattr(contour, "not_ruled_out", lambda filters, own: filters)
    found = of_prior.__wrapped__(user, prior)
    np.testing.assert_array_equal(found.means, expected.means)
    np.testing.assert_array_equal(found.class_replaced, expected.class_replaced)
    for name, values in found.class_probabilities.items():
        np.testing.assert_allclose(values, expected.class_probabilities[name], atol=1e-12)


def test_a_pedestrian_beside_a_post_is_found_with_the_prior_of_a_car():
    """A car takes in the post, too: with the stated covariance the odds stay open for longer."""
    p, scenario, scans = clean("pedestrian")
    place = scenario.target_poses_world[0, :2]
    away = place - scans.sensor_poses_world[0, :2]
    aside = np.array([-away[1], away[0]]) / np.hypot(*away)
    post = place + 1.5 * aside + np.array([[0.0, 0.0], [0.05, 0.0], [0.1, 0.0]])
    more = post, np.tile(0.05**2 * np.eye(2), (len(post), 1, 1))
    pairs = [zip(points_of(scans, k), more, strict=True) for k in range(len(scans))]
    beside = with_points(scans, [[np.concatenate(pair) for pair in one] for one in pairs])
    car = compose(["prior=car", "tracker=contour", "measurement=fabricated"]).configuration
    found = track(beside, noisy_start(scenario, p.start, SEED), car.prior, car.tracker)
    assert found.class_probabilities["pedestrian"][10:].min() > 0.99
