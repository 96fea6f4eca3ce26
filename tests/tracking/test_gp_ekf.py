"""The GP filter, and the points that it takes."""

import dataclasses
import functools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.stats import chi2
from tracking_cases import CAR, START, TRACKER, jacobian, poses_of_turn, scans_of, seen_car

from stixel_cli.geometry.pose import world_from_target
from stixel_cli.tracking.association import associate, contour_moments
from stixel_cli.tracking.gp_ekf import contours_of, track
from stixel_cli.tracking.gp_ekf_update import linearise, update
from stixel_cli.tracking.kernel import ContourProcess
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import InitialState

SEEDS = st.integers(0, 2**31)
PROCESS = ContourProcess(16, 0.5, 1.0, 0.5, 1e-6)


def some_state(random, process=PROCESS):
    """A state with a contour that is smooth and positive, and points near it."""
    radii = prior_radii(CAR, process.basis_angles)
    radii = radii + 0.3 * random.uniform(-1, 1) * np.cos(process.basis_angles)
    mean = np.concatenate([10.0 * random.standard_normal(2), random.uniform(-4, 4, 4), radii])
    angles = random.uniform(-np.pi, np.pi, 7)
    distances = random.uniform(0.5, 4.0, 7)
    offsets = distances[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return mean, mean[:2] + offsets


def dense_model(points, mean, process):
    """z_hat (2n,), H (2n, D) and R^f as blocks (n, 2, 2), of the linearisation."""
    model = linearise(points, mean, process)
    p = model.directions
    t = np.stack([-p[:, 1], p[:, 0]], axis=-1)
    matrix = np.zeros((len(points), 2, len(mean)))
    rows, variances = model.rows
    matrix += p[:, :, None] * rows[:, None, :]
    slopes = model.residuals / model.distances
    matrix[:, :, :2] += (slopes[:, None] * t)[:, :, None] * t[:, None, :]
    predicted = points - model.residuals[:, None] * p
    blocks = variances[:, None, None] * p[:, :, None] * p[:, None, :]
    return predicted.ravel(), matrix.reshape(-1, len(mean)), blocks


def measurement(points, mean, process):
    """h(x; z) of thesis (65)-(67), written out with angles: (2n,)."""
    offset = points - mean[:2]
    bearing = np.arctan2(offset[:, 1], offset[:, 0])
    radius = process.at(bearing - mean[2])[0] @ mean[6:]
    direction = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    return (mean[:2] + radius[:, None] * direction).ravel()


@given(seed=SEEDS)
def test_jacobian_matches_finite_differences(seed):
    mean, points = some_state(np.random.default_rng(seed))
    predicted, matrix, _ = dense_model(points, mean, PROCESS)
    np.testing.assert_allclose(predicted, measurement(points, mean, PROCESS), atol=1e-9)
    expected = jacobian(lambda state: measurement(points, state, PROCESS), mean, 1e-5)
    np.testing.assert_allclose(matrix, expected, rtol=1e-4, atol=1e-4)


@given(seed=SEEDS, tangential=st.booleans(), rank=st.integers(3, 22))
def test_update_matches_the_textbook(seed, tangential, rank):
    """Also with a covariance that is singular: it is never inverted."""
    random = np.random.default_rng(seed)
    mean, points = some_state(random)
    root = 0.3 * random.standard_normal((len(mean), rank))
    covariance = root @ root.T
    variance = random.uniform(0.01, 0.1, size=7)
    predicted, matrix, blocks = dense_model(points, mean, PROCESS)
    model = linearise(points, mean, PROCESS)
    noise = np.zeros((14, 14))
    for i in range(7):
        noise[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = blocks[i] + variance[i] * np.eye(2)
    innovation = points.ravel() - predicted
    if not tangential:
        # The component of each point along its direction from the centre.
        radial = np.zeros((7, 14))
        radial[np.arange(7)[:, None], np.arange(14).reshape(7, 2)] = model.directions
        matrix, innovation, noise = radial @ matrix, radial @ innovation, radial @ noise @ radial.T
    spread = matrix @ covariance @ matrix.T + noise
    gain = np.linalg.solve(spread, matrix @ covariance).T

    found = update(mean, covariance, model, variance, tangential)
    np.testing.assert_allclose(found[0], mean + gain @ innovation, atol=1e-7)
    np.testing.assert_allclose(found[1], covariance - gain @ spread @ gain.T, atol=1e-7)
    np.testing.assert_array_equal(found[1], found[1].T)
    assert found[3] == pytest.approx(innovation @ np.linalg.solve(spread, innovation), rel=1e-6)
    # The tangential components are zero, so the radial residuals with their gain are all of it.
    np.testing.assert_allclose(found[2] @ model.residuals, found[0] - mean, atol=1e-7)


@given(seed=SEEDS)
def test_the_gradients_are_how_residuals_change_as_points_move(seed):
    mean, points = some_state(np.random.default_rng(seed))
    expected = jacobian(lambda by: linearise(points + by, mean, PROCESS).residuals, np.zeros(2))
    found = linearise(points, mean, PROCESS).gradients
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-8)


def test_filter_stays_finite_and_semi_definite_over_a_thousand_scans():
    points = [p if k % 7 else np.zeros((0, 2)) for k, p in enumerate(seen_car(1000, 8))]
    points[500:700] = [np.zeros((0, 2))] * 200
    found = track(scans_of(points), START, CAR, TRACKER)
    for array in (found.means, found.covariances, found.contours_world, found.contour_std):
        assert np.isfinite(array).all()
    for covariance in found.covariances[::50]:
        assert np.linalg.eigvalsh(covariance).min() > -1e-9 * np.trace(covariance)


@pytest.mark.parametrize("distance", [0.0, 1e-12, 1e-5, 2e-3, 1e-2])
def test_point_on_the_predicted_centre_is_handled(distance):
    points = seen_car(3, 20)
    centre = START.mean[:2] + 0.1 * START.mean[3:5]
    points[0] = np.concatenate([points[0], centre[None] + [distance, 0.0]])
    found = track(scans_of(points), START, CAR, TRACKER)
    assert np.isfinite(found.means).all()
    assert np.isfinite(found.covariances).all()
    assert (20 in found.used_points) == (distance >= 1e-3)


def test_nis_has_one_degree_of_freedom_per_point():
    """A circle, all of it seen and known: radial innovations of 0.1 m are what the model says."""
    random = np.random.default_rng(4)
    parameters = dataclasses.replace(TRACKER, sigma_q=0.01, sigma_q_psi=0.01, gate_probability=None)
    circle = PriorShape(3.0, 3.0, "ellipse", 0.0, 1.0, 0.4, 0.1, 0.3, "car", 0.06, 0.06, None)
    still = InitialState(np.zeros(6), 1e-4 * np.eye(6))
    points = []
    for _ in range(60):
        angles = random.uniform(0.0, 2.0 * np.pi, 100)
        outline = 1.5 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        points.append(outline + 0.1 * random.standard_normal((100, 2)))
    found = track(scans_of(points), still, circle, parameters)
    assert np.mean(found.nis / found.nis_degrees_of_freedom) == pytest.approx(1.0, abs=0.06)


def test_contour_and_std_match_the_regression():
    """The band is that of the point where a fixed ray meets the contour, to first order."""
    found = track(scans_of(seen_car(4, 30)), START, CAR, TRACKER)
    count = found.contours_world.shape[1]
    angles = 2.0 * np.pi * np.arange(count) / count
    size = TRACKER.basis_points, TRACKER.length_scale
    process = ContourProcess(*size, 1.0, 0.4)
    matrix, variances = process.at(angles)
    mean, covariance = found.means[-1], found.covariances[-1]
    offsets = found.contours_world[-1] - mean[:2]
    np.testing.assert_allclose(np.linalg.norm(offsets, axis=1), matrix @ mean[6:])
    bearings = mean[2] + angles
    np.testing.assert_allclose(found.contour_directions[-1, :, 0], np.cos(bearings), atol=1e-12)

    def met(direction, state):
        """Range from the estimated centre at which a ray meets the contour of another state."""

        def outside(along):
            offset = mean[:2] + along * direction - state[:2]
            angle = np.arctan2(offset[1], offset[0]) - state[2]
            return np.hypot(*offset) - (process.at(np.array([angle]))[0] @ state[6:])[0]

        return brentq(outside, 0.05, 20.0, xtol=1e-13)

    for i in (0, 7, 21, 50):
        direction = found.contour_directions[-1, i]
        slopes = jacobian(functools.partial(met, direction), mean, 1e-5)
        expected = np.sqrt(slopes @ covariance @ slopes + variances[i])
        assert found.contour_std[-1, i] == pytest.approx(expected, rel=1e-5)


def test_unseen_radii_return_to_zero():
    forgetting = dataclasses.replace(TRACKER, forgetting_rate=100.0)
    found = track(scans_of([np.zeros((0, 2))] * 5), START, CAR, forgetting)
    np.testing.assert_allclose(found.means[-1, 6:], 0.0, atol=1e-9)
    reach = np.linalg.norm(found.contours_world[-1] - found.means[-1, :2], axis=1)
    np.testing.assert_allclose(reach, 0.0, atol=1e-9)


def test_negative_radius_is_reported_as_zero():
    mean = np.concatenate([[1.0, 2.0, 0.3, 0, 0, 0], -np.ones(16)])
    contours, _ = contours_of(mean[None], np.eye(22)[None], PROCESS, 12)
    np.testing.assert_allclose(contours[0], np.tile([1.0, 2.0], (12, 1)))


def test_without_a_shape_the_radii_start_at_zero():
    """Thesis (71b): mean 0, covariance K."""
    bare = dataclasses.replace(CAR, shape="none")
    bare.check(TRACKER)
    scans = scans_of([np.zeros((0, 2))])
    found, shaped = track(scans, START, bare, TRACKER), track(scans, START, CAR, TRACKER)
    radii = 6
    np.testing.assert_array_equal(found.means[0, radii:], 0.0)
    assert np.all(shaped.means[0, radii:] > 0.5)
    np.testing.assert_array_equal(found.covariances, shaped.covariances)


ANGLES = 2.0 * np.pi * np.arange(2000) / 2000
DIRECTIONS = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=-1)


def test_moments_of_an_ellipse_a_rectangle_an_asymmetric_contour_and_of_none():
    radii = 2.0 * 0.5 / np.hypot(0.5 * np.cos(ANGLES), 2.0 * np.sin(ANGLES))
    centroid, moments = contour_moments(DIRECTIONS, radii)
    np.testing.assert_allclose(centroid, 0.0, atol=1e-12)
    np.testing.assert_allclose(moments, np.diag([2.0**2 / 4, 0.5**2 / 4]), atol=1e-6)
    sharp = PriorShape(4.5, 1.8, "rectangle", 0.0, 1.0, 1.0, 0.1, 0.3, "car", 0.06, 0.06, None)
    _, moments = contour_moments(DIRECTIONS, prior_radii(sharp, ANGLES))
    np.testing.assert_allclose(moments, np.diag([4.5**2 / 12, 1.8**2 / 12]), rtol=1e-3, atol=1e-9)
    # A circle of radius 2 seen from a point 1 m from its centre.
    radii = np.cos(ANGLES) + np.sqrt(4.0 - np.sin(ANGLES) ** 2)
    centroid, moments = contour_moments(DIRECTIONS, radii)
    np.testing.assert_allclose(centroid, [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(moments, np.eye(2), atol=1e-9)
    centroid, moments = contour_moments(DIRECTIONS, -np.ones(2000))
    assert not centroid.any() and not moments.any()


@given(seed=SEEDS, probability=st.none() | st.floats(0.01, 0.999), each=st.booleans())
def test_gate_matches_the_normal_density(seed, probability, each):
    random = np.random.default_rng(seed)
    points = 3.0 * random.standard_normal((30, 2))
    roots = random.standard_normal((30 if each else 1, 2, 2))
    spread = roots @ np.swapaxes(roots, 1, 2) + 0.1 * np.eye(2)
    away = points - 1.0
    squared = (away * np.linalg.solve(spread, away[..., None])[..., 0]).sum(axis=1)
    found = associate(points, np.ones(2), spread if each else spread[0], probability)
    greatest = np.inf if probability is None else chi2.ppf(probability, 2)
    assert found.tolist() == np.flatnonzero(squared <= greatest).tolist()


@pytest.mark.parametrize("size", [(4.5, 1.8), (1.8, 0.6), (0.6, 0.35), (12.0, 2.5)])
@pytest.mark.parametrize("shape", ["rectangle", "ellipse"])
def test_contour_is_inside_its_own_gate(size, shape):
    prior = PriorShape(*size, shape, 0.0, 1.0, 1.0, 0.1, 0.3, "car", 0.06, 0.06, None)
    radii = prior_radii(prior, ANGLES)
    centroid, moments = contour_moments(DIRECTIONS, radii)
    assert len(associate(radii[:, None] * DIRECTIONS, centroid, moments, 0.99)) == len(radii)


def test_gate_accepts_target_points_and_rejects_a_wall_behind():
    scans = seen_car(40, 60)
    behind = np.stack([np.linspace(-4.5, 4.5, 30), np.full(30, 0.9 + 3.0)], axis=-1)
    walls = [world_from_target(behind, pose) for pose in poses_of_turn(40)]
    mixed = [np.concatenate(pair) for pair in zip(scans, walls, strict=True)]
    found = track(scans_of(mixed), START, CAR, TRACKER)
    for k in range(10, 40):
        used = found.used_points[found.used_offsets[k] : found.used_offsets[k + 1]] - 90 * k
        assert set(range(60)) <= set(used.tolist())
        assert used.max() < 60
