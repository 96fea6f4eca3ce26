"""The baseline on the centroid, and its motion."""

import dataclasses

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag, expm
from tracking_cases import CAR, START, jacobian, scans_of, seen_car

from stixel_cli.tracking.baselines.point import (
    CENTROID_OFFSET,
    PointParameters,
    class_circle,
    track,
)
from stixel_cli.tracking.kernel import ContourProcess
from stixel_cli.tracking.motion import (
    GREATEST_VARIANCE,
    MOVING,
    intervals,
    predict,
    process_noise,
    six_states,
    transition,
)
from stixel_cli.tracking.prior import prior_radii
from stixel_cli.tracking.track import InitialState

SEEDS = st.integers(0, 2**31)
TRACKER = PointParameters("point", sigma_q=2.0, measurement_std=0.1)


def textbook(scans, used, initial, radius, tracker):
    """x, P and NIS of a dense Kalman filter, with F and Q by van Loan's matrix exponential.

    It takes the `used` points of each scan.
    """
    mean, covariance = initial.mean[MOVING], initial.covariance[np.ix_(MOVING, MOVING)]
    drift = np.zeros((4, 4))
    drift[0, 2] = drift[1, 3] = 1.0
    diffusion = np.diag([0.0, 0.0, tracker.sigma_q**2, tracker.sigma_q**2])
    observation = np.eye(2, 4)
    times = np.concatenate([[2.0 * scans.times[0] - scans.times[1]], scans.times])
    for k, interval in enumerate(np.diff(times)):
        exponential = expm(np.block([[-drift, diffusion], [np.zeros((4, 4)), drift.T]]) * interval)
        matrix = exponential[4:, 4:].T
        mean = matrix @ mean
        covariance = matrix @ covariance @ matrix.T + matrix @ exponential[:4, 4:]
        points = scans.points_world[used[k]]
        nis = np.nan
        if len(points):
            shared = (CENTROID_OFFSET * radius) ** 2
            lone = radius**2 / 4.0 + tracker.measurement_std**2
            noise = (shared + lone / len(points)) * np.eye(2)
            innovation = points.mean(axis=0) - observation @ mean
            spread = observation @ covariance @ observation.T + noise
            gain = covariance @ observation.T @ np.linalg.inv(spread)
            nis = innovation @ np.linalg.inv(spread) @ innovation
            mean = mean + gain @ innovation
            covariance = covariance - gain @ spread @ gain.T
        yield mean, covariance, nis


def test_baseline_matches_the_textbook_kalman_filter_on_the_centroid():
    points = seen_car(30, 40)
    points[3] = points[17] = np.zeros((0, 2))
    scans = scans_of(points, times=np.cumsum(np.linspace(0.05, 0.2, 30)))
    result = track(scans, START, CAR, TRACKER)
    radius, _ = class_circle(CAR)
    used = np.split(result.used_points, result.used_offsets[1:-1])
    for k, (mean, covariance, nis) in enumerate(textbook(scans, used, START, radius, TRACKER)):
        np.testing.assert_allclose(result.means[k, MOVING], mean, rtol=1e-9, atol=1e-9)
        found = result.covariances[k][np.ix_(MOVING, MOVING)]
        np.testing.assert_allclose(found, covariance, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(result.nis[k], nis, rtol=1e-8)
    counts = np.diff(result.used_offsets)
    assert sum(counts) > 0.9 * len(scans.points_world)
    np.testing.assert_array_equal(result.nis_degrees_of_freedom, np.where(counts > 0, 2, 0))


@pytest.mark.parametrize("shape", ["rectangle", "ellipse"])
def test_baseline_contour_is_a_circle_with_the_area_of_the_prior(shape):
    prior = dataclasses.replace(CAR, shape=shape)
    result = track(scans_of(seen_car(4, 20)), START, prior, TRACKER)
    if shape == "ellipse":
        area = np.pi / 4.0 * prior.length * prior.width
    else:
        area = prior.length * prior.width - (4.0 - np.pi) * prior.corner_radius**2
    radius, std = class_circle(prior)
    np.testing.assert_allclose(np.pi * radius**2, area, rtol=1e-5)
    offsets = result.contours_world - result.means[:, None, :2]
    np.testing.assert_allclose(np.linalg.norm(offsets, axis=2), radius)
    np.testing.assert_allclose(offsets, radius * result.contour_directions)
    for contour in result.contours_world:
        ring = shapely.linearrings(contour)
        assert ring.is_ccw
        np.testing.assert_allclose(shapely.polygons(ring).area, area, rtol=1e-3)
    # The band holds the class: two std reach from its shortest to its longest radius.
    radii = prior_radii(prior, np.linspace(0.0, 2.0 * np.pi, 4001)[:-1])
    assert radius - 2.0 * std < radii.min()
    assert radii.max() < radius + 2.0 * std
    # The circle's error, and that of its centre along the direction.
    for k, directions in enumerate(result.contour_directions):
        moved = [p @ result.covariances[k, :2, :2] @ p for p in directions]
        expected = np.sqrt(std**2 + np.array(moved))
        np.testing.assert_allclose(result.contour_std[k], expected, rtol=1e-12)
    certain = class_circle(dataclasses.replace(prior, sigma_f=1e-9, sigma_r=0.0))[1]
    np.testing.assert_allclose(certain, np.sqrt(np.mean((radii - radius) ** 2)), rtol=1e-4)
    np.testing.assert_allclose(std**2 - certain**2, prior.sigma_f**2 + prior.sigma_r**2)


@given(seed=SEEDS)
def test_heading_variance_matches_its_linearisation(seed):
    random = np.random.default_rng(seed)
    root = 0.05 * random.standard_normal((4, 4))
    mean = np.concatenate([random.uniform(-9, 9, 2), random.uniform(1, 6, 2)])
    states, spread = six_states(mean, root @ root.T, (0.3, 0.1), 0.1, 2.0)
    slope = jacobian(lambda velocity: np.arctan2(velocity[1], velocity[0]), mean[2:])
    np.testing.assert_allclose(states[2], np.arctan2(mean[3], mean[2]))
    np.testing.assert_allclose(spread[2, 2], slope @ (root @ root.T)[2:, 2:] @ slope, rtol=1e-5)
    np.testing.assert_allclose(spread[2, :2], slope @ (root @ root.T)[2:, :2], rtol=1e-4, atol=1e-9)
    assert np.linalg.eigvalsh(spread).min() > -1e-12


def test_stopped_target_keeps_its_heading_with_bounded_variance():
    states, spread = six_states(np.array([1.0, 2.0, 0.1, 0.2]), np.eye(4), (4.0, 0.2), 0.1, 2.0)
    assert states.tolist() == [1.0, 2.0, 4.0, 0.1, 0.2, 0.0]
    assert spread[2].tolist() == [0.0, 0.0, 0.2, 0.0, 0.0, 0.0]
    unsure = six_states(np.array([0.0, 0.0, 1.0, 0.0]), 1e4 * np.eye(4), (0.0, 0.1), 0.1, 2.0)
    even = np.linspace(-np.pi, np.pi, 100_001)
    np.testing.assert_allclose(GREATEST_VARIANCE, np.mean(even**2), rtol=1e-4)
    np.testing.assert_allclose(unsure[1][2, 2], GREATEST_VARIANCE)
    assert np.linalg.eigvalsh(unsure[1]).min() > -1e-9
    assert spread[5, 5] == GREATEST_VARIANCE
    fast = six_states(np.array([0.0, 0.0, 20.0, 0.0]), np.eye(4), (0.0, 0.1), 0.1, 2.0)[1]
    np.testing.assert_allclose(fast[5, 5], 2.0**2 / (0.1 * 20.0**2))


def test_heading_covers_a_full_turn_and_a_single_scan_is_tracked():
    single = track(scans_of(seen_car(1, 20)), START, CAR, TRACKER)
    assert np.isfinite(single.means).all()
    assert np.isfinite(single.covariances).all()
    # Once round: the heading goes on past pi and is not wound back.
    angles = np.linspace(0.0, 2.0 * np.pi, 120)
    centres = 10.0 * np.stack([np.sin(angles), -np.cos(angles)], axis=-1)
    speed = 10.0 * 2.0 * np.pi / 119 / 0.1
    start = InitialState(np.array([0.0, -10.0, 0.0, speed, 0.0, 0.5]), 0.01 * np.eye(6))
    result = track(scans_of([centre[None] for centre in centres]), start, CAR, TRACKER)
    assert np.abs(np.diff(result.means[:, 2])).max() < 0.3
    assert result.means[-1, 2] > 5.0


def test_intervals_transition_and_noise():
    np.testing.assert_allclose(intervals(np.array([0.0, 0.1, 0.3])), [0.1, 0.1, 0.2])
    assert intervals(np.array([2.0])).tolist() == [0.0]
    assert intervals(np.array([])).tolist() == []
    shift = np.array([[1.0, 0.2], [0.0, 1.0]])
    np.testing.assert_allclose(transition(0.2), np.kron(shift, np.eye(3)))
    moments = np.array([[0.2**3 / 3, 0.2**2 / 2], [0.2**2 / 2, 0.2]])
    expected = np.kron(moments, np.diag([1.5**2, 1.5**2, 0.3**2]))
    np.testing.assert_allclose(process_noise(0.2, 1.5, 0.3), expected)


@given(seed=st.integers(0, 2**31), alpha=st.sampled_from([0.0, 1e-4, 2.0]))
def test_prediction_matches_the_dense_formula(seed, alpha):
    random = np.random.default_rng(seed)
    process = ContourProcess(8, 0.5, 1.0, 0.5, 1e-6)
    mean = random.standard_normal(14)
    root = random.standard_normal((14, 14))
    interval = random.uniform(0.01, 1.0)
    noise = process_noise(interval, 1.0, 0.2)
    dense = block_diag(transition(interval), np.exp(-alpha * interval) * np.eye(8))
    radii_noise = (1.0 - np.exp(-2.0 * alpha * interval)) * process.covariance
    expected = dense @ root @ root.T @ dense.T + block_diag(noise, radii_noise)
    predicted, covariance = predict(mean, root @ root.T, interval, noise, alpha, process.covariance)
    np.testing.assert_allclose(predicted, dense @ mean, atol=1e-12)
    np.testing.assert_allclose(covariance, expected, atol=1e-10)
