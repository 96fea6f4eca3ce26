"""Smoothed tracks, and errors that are considered."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from seen_targets import scans_seen, start_at, turning
from tracking_cases import CAR, START, scans_of, seen_car

from stixel_cli.config.compose import compose
from stixel_cli.measurements.scans import NO_SHARED_ERRORS, SharedErrors
from stixel_cli.tracking import gp_ekf
from stixel_cli.tracking.consider import JointCovariance
from stixel_cli.tracking.contour import contour, contour_filter, contour_recovery
from stixel_cli.tracking.contour.class_shape import class_shape
from stixel_cli.tracking.contour.class_size import class_size
from stixel_cli.tracking.kalman import Step, smooth

COUNT, SIZE = 12, 3
LAGS = (0, 1, 3, COUNT - 1, COUNT + 5, None)
NAMES = ("contour", "gp_ekf")
SHIPPED = {name: compose([f"tracker={name}"]).configuration.tracker for name in NAMES}
TRACKERS = {name: dataclasses.replace(one, lag=4) for name, one in SHIPPED.items()}
CONTOUR = dataclasses.replace(TRACKERS["contour"], seen_by="fabricated", road_user="fixed")
KNOWN = dataclasses.replace(CAR, length=4.52, width=1.83)
POSES = turning(20, 4.0, 0.3)


def random_model(seed):
    """Transitions, noises, measurement matrices and noises, and measurements of a linear case."""
    random = np.random.default_rng(seed)
    square = random.standard_normal((COUNT, SIZE, SIZE))
    return {
        "transitions": np.eye(SIZE) + 0.2 * random.standard_normal((COUNT, SIZE, SIZE)),
        "noises": 0.1 * square @ square.transpose(0, 2, 1),
        "matrices": random.standard_normal((COUNT, 2, SIZE)),
        "variances": random.uniform(0.1, 1.0, (COUNT, 2)),
        "measured": random.standard_normal((COUNT, 2)),
    }


def filtered(model):
    """The steps of a Kalman filter that starts at zero with a covariance of one."""
    mean, covariance, steps = np.zeros(SIZE), np.eye(SIZE), [None]
    for matrix, noise, row, variances, measured in zip(*model.values(), strict=True):
        predicted = matrix @ mean, matrix @ covariance @ matrix.T + noise
        mean, covariance = predicted
        gain = covariance @ row.T @ np.linalg.inv(row @ covariance @ row.T + np.diag(variances))
        mean = mean + gain @ (measured - row @ mean)
        covariance = covariance - gain @ row @ covariance
        steps.append(Step(mean, covariance, *predicted, steps[-1], matrix))
    return steps[1:]


def joint_posterior(model, scans):
    """Means and covariances of all states given the first `scans`: one dense Gaussian.

    The states are a linear function of the first one and of all process noises.
    """
    blocks = np.zeros((COUNT, SIZE, COUNT + 1, SIZE))
    for k, matrix in enumerate(model["transitions"]):
        before = blocks[k - 1] if k else np.eye(SIZE, (COUNT + 1) * SIZE).reshape(SIZE, -1, SIZE)
        blocks[k] = np.einsum("ij,jkl->ikl", matrix, before)
        blocks[k, :, k + 1] = np.eye(SIZE)
    states = blocks.reshape(COUNT * SIZE, -1)
    prior = np.zeros((len(states[0]), len(states[0])))
    for k, noise in enumerate([np.eye(SIZE), *model["noises"]]):
        prior[k * SIZE :][:SIZE, k * SIZE :][:, :SIZE] = noise
    covariance = states @ prior @ states.T
    rows = np.zeros((2 * scans, COUNT * SIZE))
    for k in range(scans):
        rows[2 * k : 2 * k + 2, k * SIZE : (k + 1) * SIZE] = model["matrices"][k]
    spread = rows @ covariance @ rows.T + np.diag(model["variances"][:scans].ravel())
    gain = np.linalg.solve(spread, rows @ covariance).T
    means = gain @ model["measured"][:scans].ravel()
    posterior = (covariance - gain @ rows @ covariance).reshape(COUNT, SIZE, COUNT, SIZE)
    return means.reshape(COUNT, SIZE), np.stack([posterior[k, :, k] for k in range(COUNT)])


@pytest.mark.parametrize("lag", LAGS)
@pytest.mark.parametrize("seed", range(3))
def test_smoothed_is_the_joint_posterior_of_the_scans_up_to_the_lag(seed, lag):
    model = random_model(seed)
    means, covariances = smooth(filtered(model), lag)
    for k in range(COUNT):
        known = COUNT if lag is None else min(k + lag + 1, COUNT)
        expected_means, expected_covariances = joint_posterior(model, known)
        np.testing.assert_allclose(means[k], expected_means[k], atol=1e-9)
        np.testing.assert_allclose(covariances[k], expected_covariances[k], atol=1e-9)


def test_nothing_goes_back_across_a_restart_another_report_or_a_full_turn():
    steps = filtered(random_model(0))
    after = dataclasses.replace(steps[6], transition=None)
    broken = [*steps[:6], after]
    for step in steps[7:]:
        broken.append(dataclasses.replace(step, before=broken[-1]))
    means, covariances = smooth(broken, None)
    first_means, first_covariances = smooth(steps[:6], None)
    np.testing.assert_allclose(means[:6], first_means, atol=1e-12)
    np.testing.assert_allclose(covariances[:6], first_covariances, atol=1e-12)
    np.testing.assert_array_equal(means[6:], smooth(steps, None)[0][6:])
    # Of two hypotheses, the past of the one that holds is taken, not what was reported then.
    held, other = filtered(random_model(0)), filtered(random_model(1))
    mixed = [*other[:4], *held[4:]]
    means, _ = smooth(mixed, 2)
    np.testing.assert_array_equal(means[2:], smooth(held, 2)[0][2:])
    np.testing.assert_array_equal(means[:2], smooth(other, 2)[0][:2])
    turn = 2.0 * np.pi * np.eye(SIZE)[2]
    turned = [*steps[:6]]
    for k, step in enumerate(steps[6:]):
        predicted = step.predicted_mean + min(k, 1) * turn
        means = {"mean": step.mean + turn, "predicted_mean": predicted}
        turned.append(dataclasses.replace(step, **means, before=turned[-1]))
    means, expected = smooth(turned, None)[0], smooth(steps, None)[0]
    np.testing.assert_allclose(means[:6], expected[:6], atol=1e-9)
    np.testing.assert_allclose(means[6:], expected[6:] + turn, atol=1e-9)


@cache
def tracks(name, count=None, shared_errors=NO_SHARED_ERRORS, **options):
    """The track of the first `count` scans of a car that turns."""
    if name != "contour":
        tracker = dataclasses.replace(TRACKERS[name], **options)
        return gp_ekf.track(scans_of(seen_car(20, 30)[:count]), START, CAR, tracker)
    scans = scans_seen(class_shape("car").outline, POSES[:count], noise=0.03)
    scans = dataclasses.replace(scans, shared_errors=shared_errors)
    tracker = dataclasses.replace(CONTOUR, **options)
    return contour.track(scans, start_at(POSES), KNOWN, tracker)


@pytest.mark.parametrize("name", TRACKERS)
def test_the_filtered_track_does_not_depend_on_the_lag(name):
    plain, both = tracks(name, lag=0), tracks(name)
    assert plain.smoothed is None and plain.lag == 0
    assert both.lag == 0 and both.smoothed.lag == 4 and both.smoothed.smoothed is None
    for field in ("means", "covariances", "contours_world", "contour_std", "used_points"):
        assert getattr(plain, field).tobytes() == getattr(both, field).tobytes()
    np.testing.assert_allclose(both.smoothed.means[-1], both.means[-1], atol=1e-9)
    assert not np.allclose(both.smoothed.means[5], both.means[5], atol=1e-4)


@pytest.mark.parametrize("name", TRACKERS)
def test_a_smoothed_estimate_knows_no_scan_beyond_its_lag(name):
    whole = tracks(name).smoothed
    for k in (3, 9):
        known = tracks(name, count=k + 5).smoothed
        np.testing.assert_allclose(known.means[k], whole.means[k], atol=1e-12)
        np.testing.assert_allclose(known.covariances[k], whole.covariances[k], atol=1e-12)
        np.testing.assert_allclose(known.contours_world[k], whole.contours_world[k], atol=1e-12)


def test_of_one_side_the_smoothed_track_states_the_covariance_of_the_filter():
    track = tracks("gp_ekf", lag=None)
    np.testing.assert_array_equal(track.covariances, track.smoothed.covariances)
    assert np.abs(track.means - track.smoothed.means)[:-1, :2].max() > 0.01


def test_smoothing_brings_the_contour_nearer():
    track = tracks("contour", lag=5)
    errors = [one.means[:, :2] - POSES[:, :2] for one in (track, track.smoothed)]
    filtered, smoothed = (np.sqrt(np.mean(error**2)) for error in errors)
    assert smoothed < 0.95 * filtered


def test_a_shared_error_moves_no_smoothed_estimate_but_stays_in_its_covariance():
    """It is shared by all scans, so later ones do not take it away."""
    plain = tracks("contour", seen_by="stixels")
    error = SharedErrors(disparity=((0.0012, 0.0, 0.0),))
    shared = tracks("contour", shared_errors=error, seen_by="stixels")
    np.testing.assert_array_equal(shared.smoothed.means, plain.smoothed.means)
    pairs = ((shared, plain), (shared.smoothed, plain.smoothed))
    of_filter, of_smoother = ((a.covariances - b.covariances)[:, :2, :2] for a, b in pairs)
    assert np.linalg.eigvalsh(of_smoother).min() > -1e-5
    kept = np.trace(of_smoother, axis1=1, axis2=2) / np.trace(of_filter, axis1=1, axis2=2)
    assert np.all(kept[5:] > 0.8)


def test_a_target_that_was_looked_for_again_is_not_smoothed_across(monkeypatch):
    plain = tracks("contour", lag=None)
    detect_again = contour_recovery.detect_again

    def likelier(*arguments):
        found = detect_again(*arguments)
        return [dataclasses.replace(one, log_likelihood=one.log_likelihood + 50.0) for one in found]

    monkeypatch.setattr(contour_filter, "is_inconsistent", lambda scans: len(scans) == 10)
    monkeypatch.setattr(contour_filter, "detect_again", likelier)
    again = tracks.__wrapped__("contour", lag=None)
    before = tracks.__wrapped__("contour", lag=None, count=9)
    np.testing.assert_allclose(again.smoothed.means[:9], before.smoothed.means, atol=1e-9)
    assert not np.allclose(plain.smoothed.means[:9], before.smoothed.means, atol=1e-6)


def test_a_ruled_out_class_leaves_a_smoothed_track():
    """Every class ends at another scan; the smoothed one is of the class that is reported later."""
    scans = scans_seen(class_shape("car").outline, POSES, noise=0.03)
    prior = dataclasses.replace(KNOWN, road_user="unknown")
    track = contour.track(scans, start_at(POSES), prior, CONTOUR)
    size = zip(("length_std", "width_std"), class_size("car").stds, strict=True)
    known = contour.track(scans, start_at(POSES), dataclasses.replace(KNOWN, **dict(size)), CONTOUR)
    assert track.class_probabilities["car"][-1] > 0.99
    np.testing.assert_allclose(track.smoothed.means[6:], known.smoothed.means[6:], atol=1e-6)


GENERATOR = np.random.default_rng(1000)


def spread(rows, columns):
    return 0.5 * GENERATOR.standard_normal((rows, columns))


def test_the_covariance_is_that_of_the_errors_of_many_runs():
    """Two states, two considered errors, gains that are not the optimal ones."""
    runs, start = 200_000, np.diag([1.0, 0.5])
    transition, noise = np.array([[1.0, 0.1], [0.0, 1.0]]), 0.02
    joint = JointCovariance(start, 2)
    errors = GENERATOR.standard_normal((runs, 2)) @ np.sqrt(start)
    considered = GENERATOR.standard_normal((runs, 2))
    for _ in range(4):
        joint.predict(transition, noise**2 * np.eye(2))
        errors = errors @ transition.T + noise * GENERATOR.standard_normal((runs, 2))
        gain, rows, variances = spread(2, 3), spread(3, 4), np.array([0.1, 0.2, 0.3])
        joint.correct(gain, rows, gain * variances)
        residuals = np.hstack([errors, considered]) @ rows.T
        residuals += np.sqrt(variances) * GENERATOR.standard_normal((runs, 3))
        errors = errors - residuals @ gain.T
    found = np.cov(np.hstack([errors, considered]).T)
    np.testing.assert_allclose(joint.matrix, found, rtol=0.05, atol=0.02)


def test_with_the_optimal_gain_and_nothing_considered_it_is_a_kalman_update():
    covariance, rows, noise = spread(3, 3), spread(4, 3), np.array([0.1, 0.2, 0.3, 0.4])
    covariance = covariance @ covariance.T
    innovation = rows @ covariance @ rows.T + np.diag(noise)
    gain = np.linalg.solve(innovation, rows @ covariance).T
    joint = JointCovariance(covariance, 0)
    joint.correct(gain, rows, gain * noise)
    np.testing.assert_allclose(joint.matrix, (np.eye(3) - gain @ rows) @ covariance, atol=1e-12)
