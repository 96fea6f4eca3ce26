import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from seen_targets import scans_seen, start_at, turning
from tracking_cases import CAR, START, scans_of

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import rectangle, rotation
from stixel_cli.tracking.baselines.gm_mem_ekf import (
    MIDDLES,
    VARIANCES,
    Estimate,
    side_weights,
    track,
    update,
)

TRACKER = compose(["tracker=gm_mem_ekf"]).configuration.tracker
EMPTY = np.zeros((0, 2))
SEEDS = st.integers(0, 2**31)


def estimate_at(random, spread, shape_spread):
    """An estimate with small covariances round a car that is 10 m ahead."""
    means, parts = (np.array([0.5, 10.0, 3.0, 1.0]), np.array([0.4, 2.2, 0.9])), []
    for mean, size in zip(means, (spread, shape_spread), strict=True):
        root = size * random.standard_normal((len(mean), len(mean)))
        parts += [mean, root @ root.T + 1e-6 * np.eye(len(mean))]
    return Estimate(*parts)


@pytest.mark.parametrize(
    ("bearing", "weights"),
    [(0.0, [1, 0, 0, 0]), (20.0, [1, 0, 0, 0]), (30.0, [0.8, 0.8, 0, 0]), (90.0, [0, 1, 0, 0]),
     (-135.0, [0, 0, 0.8, 0.8]), (-80.0, [0, 0, 0, 1])],
)  # fmt: skip
def test_sides_that_face_the_sensor_count(bearing, weights):
    """`bearing` in degrees from the front, as seen in units of the half sizes."""
    estimate = Estimate(np.array([3.0, 4.0, 0, 0]), np.eye(4), np.array([0.7, 2.0, 1.0]), np.eye(3))
    way = 9.0 * np.array([np.cos(np.radians(bearing)), np.sin(np.radians(bearing))])
    sensor = rotation(0.7) @ (way * [2.0, 1.0]) + [3.0, 4.0]
    if bearing == 20.0:
        weights = [1, 0.8 if np.degrees(3 * np.pi / 8) >= 70.0 else 0, 0, 0]
    np.testing.assert_allclose(side_weights(estimate, sensor), np.divide(weights, np.sum(weights)))


@settings(max_examples=8)
@given(seed=SEEDS)
def test_moments_are_those_of_random_shapes_and_points(seed):
    """With one side, the gains are the linear regressions of the model's samples."""
    random = np.random.default_rng(seed)
    estimate, noise = estimate_at(random, 0.3, 0.02), 0.02 * np.eye(2)
    side, count = int(random.integers(4)), 400_000
    states = random.multivariate_normal(estimate.state, estimate.covariance, count)
    shapes = random.multivariate_normal(estimate.shape, estimate.shape_covariance, count)
    along = MIDDLES[side] + np.sqrt(VARIANCES[side]) * random.standard_normal((count, 2))
    body = shapes[:, 1:] * along
    turned = (body @ [1.0, 1.0j]) * np.exp(1j * shapes[:, 0])
    points = states[:, :2] + random.multivariate_normal([0, 0], noise, count)
    points += np.stack([turned.real, turned.imag], axis=1)
    middle = estimate.state[:2] + rotation(0.4) @ (estimate.shape[1:] * MIDDLES[side])
    weights = np.eye(4)[side]
    spread = np.cov((points - middle).T)
    for offset in (np.zeros(2), [0.3, -0.2]):
        _, distance = update(estimate, middle + offset, noise, weights)
        assert distance == pytest.approx(offset @ np.linalg.solve(spread, offset), rel=0.03)
    posterior, _ = update(estimate, middle + np.array([0.3, -0.2]), noise, weights)
    gain = np.cov(states[:, :2].T, points.T)[:2, 2:] @ np.linalg.inv(spread)
    moved = posterior.state[:2] - estimate.state[:2]
    np.testing.assert_allclose(moved, gain @ [0.3, -0.2], rtol=0.05, atol=2e-3)


def test_points_farther_along_the_side_lengthen_it_and_nearer_ones_shorten_it():
    covariance = np.diag([0.01, 0.01, 0.1, 0.1])
    shape_covariance = np.diag([0.01, 0.1, 0.1])
    estimate = Estimate(np.zeros(4), covariance, np.array([0.0, 2.0, 1.0]), shape_covariance)
    right = np.eye(4)[3]
    outer, _ = update(estimate, np.array([1.95, -0.99]), 0.01 * np.eye(2), right)
    inner, _ = update(estimate, np.array([0.1, -0.99]), 0.01 * np.eye(2), right)
    assert outer.shape[1] > 2.0 > inner.shape[1]
    # A point in front of the right side's right half turns the rectangle to it.
    turned, _ = update(estimate, np.array([1.5, -0.8]), 0.01 * np.eye(2), right)
    assert turned.shape[0] > 0.0
    # A point outside of the side moves the centre outwards.
    moved_out, _ = update(estimate, np.array([0.0, -1.3]), 0.01 * np.eye(2), right)
    assert moved_out.state[1] < 0.0


def test_the_more_probable_side_decides():
    estimate = Estimate(np.zeros(4), 0.01 * np.eye(4), np.array([0.0, 2.0, 1.0]), 0.01 * np.eye(3))
    both = np.array([0.5, 0.0, 0.0, 0.5])
    on_front = np.array([2.1, 0.3])
    mixed, _ = update(estimate, on_front, 0.01 * np.eye(2), both)
    alone, _ = update(estimate, on_front, 0.01 * np.eye(2), np.eye(4)[0])
    np.testing.assert_allclose(mixed.state, alone.state, atol=1e-3)
    np.testing.assert_allclose(mixed.shape, alone.shape, atol=1e-3)


@given(seed=SEEDS)
def test_posterior_is_positive(seed):
    """That it turns with the world: `test_every_tracker.py`."""
    random = np.random.default_rng(seed)
    estimate, noise = estimate_at(random, 0.3, 0.3), np.diag([0.05, 0.01])
    point = estimate.state[:2] + random.normal(0.0, 2.0, 2)
    plain, _ = update(estimate, point, noise, side_weights(estimate, np.zeros(2)))
    for covariance in (plain.covariance, plain.shape_covariance):
        np.testing.assert_allclose(covariance, covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_track_of_a_car_seen_from_one_side():
    poses = turning(40, 4.0, 0.2)
    scans, initial = scans_seen(rectangle(4.5, 1.8), poses, noise=0.05), start_at(poses)
    result = track(scans, initial, CAR, TRACKER)
    # The centre is behind the points, and most of the true rectangle is in the estimated one.
    seen = [np.hypot(*scans.points_world[scans.rows(k)].T).mean() for k in range(40)]
    assert (np.hypot(*result.means[:, :2].T) - seen).min() > 0.2
    assert np.hypot(*(result.means[:10, :2] - poses[:10, :2]).T).max() < 1.0
    np.testing.assert_array_equal(result.nis_degrees_of_freedom, 2 * np.diff(result.used_offsets))


def test_the_heading_is_the_axis_nearest_to_the_motion():
    """A start that is turned by a quarter swaps length and width in the report."""
    start = dataclasses.replace(START, mean=START.mean + np.array([0, 0, np.pi / 2, 0, 0, 0]))
    plain = track(scans_of([EMPTY]), START, CAR, TRACKER)
    turned = track(scans_of([EMPTY]), start, CAR, TRACKER)
    np.testing.assert_allclose(np.sin(turned.means[0, 2]), np.sin(plain.means[0, 2]), atol=1e-12)
    np.testing.assert_allclose(turned.means[0, 6:], plain.means[0, [7, 6]])
