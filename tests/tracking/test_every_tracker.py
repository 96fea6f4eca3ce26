"""What holds for every tracker: frames, bytes, scans without points, long gaps, lost targets."""

import dataclasses
import pickle
from functools import cache
from importlib import import_module
from typing import get_args

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from seen_targets import moved, scans_seen, start_at, turning
from tracking_cases import START, scans_of

from stixel_cli.config.annotations import kinds_of
from stixel_cli.config.compose import compose
from stixel_cli.config.schema import Tracker
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.geometry.pose import rectangle, rotation, wrap_angle
from stixel_cli.measurements.scans import FARTHEST, Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import check_finite

OUTLINE = rectangle(4.2, 1.7)
EMPTY = np.zeros((0, 2))
# `tracker=file` reads its track.
KINDS = ["no_data", *(kind for one in get_args(Tracker) for kind in kinds_of(one))]
KINDS.remove("file")
# The peers are not ours to mend.
WAYS = [kind for kind in KINDS if kind != "pyrecest"] + ["gp_ekf tracker.seen_by=null"]
WAYS += [f"{name} measurement=fabricated" for name in ("contour", "gp_ekf")]
SMOOTHED = [f"{name} tracker.lag=null" for name in ("contour", "gp_ekf")]


def tracker_of(words):
    """`track` of the scans and the initial state, with the settings `words`."""
    if words == "pyrecest":
        pytest.importorskip("pyrecest")
    configuration = compose(f"tracker={words}".split()).configuration
    module = import_module(type(configuration.tracker).__module__.removesuffix("_parameters"))
    settings = configuration.prior, configuration.tracker
    return lambda scans, initial: module.track(scans, initial, *settings)


def given():
    """Scans of a car that turns, and the start of its track."""
    poses = turning(8, 4.0, 0.3)
    return scans_seen(OUTLINE, poses, noise=0.05), start_at(poses)


@cache
def plain_track(words):
    return tracker_of(words)(*given())


@pytest.mark.parametrize("words", WAYS)
def test_no_frame_of_the_world_matters(words):
    angle, shift = -2.0, (3.0, 40.0)
    turn = rotation(angle)
    plain, other = plain_track(words), tracker_of(words)(*moved(*given(), angle, np.array(shift)))
    assert_array_equal(other.used_points, plain.used_points)
    assert_allclose(other.means[:, :2], plain.means[:, :2] @ turn.T + shift, atol=1e-6)
    turned = wrap_angle(other.means[:, 2] - plain.means[:, 2] - angle)
    assert_allclose(turned, 0.0, atol=1e-6)
    assert_allclose(other.means[:, 3:5], plain.means[:, 3:5] @ turn.T, atol=1e-6)
    assert_allclose(other.means[:, 5:], plain.means[:, 5:], atol=1e-6)
    spreads = turn @ plain.covariances[:, :2, :2] @ turn.T
    assert_allclose(other.covariances[:, :2, :2], spreads, atol=1e-6)
    assert_allclose(other.contours_world, plain.contours_world @ turn.T + shift, atol=1e-5)
    assert_allclose(other.contour_std, plain.contour_std, atol=1e-6)
    assert_allclose(other.nis, plain.nis, rtol=1e-5, atol=1e-7)


# `gm_mem_ekf` updates with one point after the other.
@pytest.mark.parametrize("words", [one for one in WAYS if one != "gm_mem_ekf"])
def test_the_order_of_the_points_does_not_matter(words):
    scans, initial = given()
    rows = np.arange(len(scans.points_world))
    rows = np.concatenate([rows[scans.rows(k)][::-1] for k in range(len(scans))])
    points, covariances = scans.points_world[rows], scans.covariances_world[rows]
    turned = dataclasses.replace(scans, points_world=points, covariances_world=covariances)
    plain, other = plain_track(words), tracker_of(words)(turned, initial)
    assert_allclose(other.means, plain.means, atol=1e-6)
    assert_allclose(other.covariances, plain.covariances, atol=1e-6)


@pytest.mark.parametrize("words", WAYS)
def test_the_same_scans_give_the_same_bytes(words):
    assert pickle.dumps(plain_track(words)) == pickle.dumps(tracker_of(words)(*given()))


@pytest.mark.parametrize("words", WAYS)
def test_without_points_and_with_far_ones_it_predicts_and_knows_less_and_less(words):
    track, far = tracker_of(words), np.array([[60.0, 60.0], [-40.0, 2.0]])
    empty = track(scans_of([EMPTY] * 3), START)
    assert_allclose(empty.means[-1, :2], START.mean[:2] + 0.3 * START.mean[3:5], atol=0.1)
    assert np.isnan(empty.nis).all() and not empty.nis_degrees_of_freedom.any()
    assert np.diff(np.trace(empty.covariances[:, :2, :2], axis1=1, axis2=2)).min() > 0.0
    assert not words.endswith("random_matrix") or np.diff(empty.contour_std, axis=0).min() > 0.0
    clutter = track(scans_of([far, EMPTY, far[:1]]), START)
    assert len(clutter.used_points) == 0
    assert_array_equal(clutter.means, empty.means)
    assert_array_equal(clutter.covariances, empty.covariances)
    assert track(scans_of([]), START).means.shape == (0, empty.means.shape[1])


@pytest.mark.parametrize("name", KINDS)
def test_a_target_that_jumps_away_gives_a_warning(name):
    track, poses = tracker_of(name), turning(24, 2.0, 0.1, (-3.0, 12.0))
    jumped = poses + np.where(np.arange(24) < 8, 0.0, 25.0)[:, None] * [0.0, 1.0, 0.0]
    rates = np.gradient(poses, 0.1, axis=0)
    # A tracker without scans cannot lose them.
    for path, warned in ((poses, False), (jumped, name != "no_data")):
        scans = scans_seen(OUTLINE, path, noise=0.03)
        truth = Scenario(scans.times, scans.sensor_poses_world, path, rates, OUTLINE[None])
        metrics = evaluate(track(scans, start_at(poses)), truth, scans).metrics
        assert metrics["diverged"] == warned
        assert verdict(metrics)[0].startswith("WARNING") == warned
        if warned:
            assert metrics["time_to_divergence_s"] == pytest.approx(0.8)


@pytest.mark.parametrize("words", KINDS + SMOOTHED)
@pytest.mark.parametrize("gap", [1e4, 2.0 * FARTHEST])
def test_a_long_gap(words, gap):
    poses = turning(8, 2.0, 0.1, (-3.0, 12.0))
    scans = scans_seen(OUTLINE, poses, noise=0.03)
    late = scans.times - FARTHEST + np.where(np.arange(8) < 5, 0.0, gap)
    scans = dataclasses.replace(scans, times=np.minimum(late, FARTHEST))
    try:
        track = tracker_of(words)(scans, start_at(poses))
    except ValueError as error:
        # The peers end in one line that names the scan.
        assert words == "pyrecest" and "failed at scan" in str(error)
    else:
        check_finite(track)
        assert (track.smoothed is not None) == (words in SMOOTHED)
        check_finite(track.smoothed or track)


@pytest.mark.parametrize("time", [1e9, np.nan, -np.inf])
def test_later_times_are_refused(time):
    with pytest.raises(ValueError, match="time of scan 1"):
        Scans.of_each([0.0, time], np.zeros((2, 3)), [(EMPTY, np.zeros((0, 2, 2)))] * 2)
