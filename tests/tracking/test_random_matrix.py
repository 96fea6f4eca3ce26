import dataclasses

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import sqrtm
from seen_targets import scans_seen, start_at, turning
from tracking_cases import CAR, START, scans_of, seen_car

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.baselines.extension import update_extension
from stixel_cli.tracking.baselines.random_matrix import contours_of, track
from stixel_cli.tracking.centre import MOVING, predict
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.track import InitialState

TRACKER = compose(["tracker=random_matrix"]).configuration.tracker
SEEDS = st.integers(0, 2**31)
EMPTY = np.zeros((0, 2))


def paper(scans, initial, prior, tracker):
    """x, P, X and alpha after each scan by the paper's equations, as they are printed."""
    x, p = initial.mean[MOVING], initial.covariance[np.ix_(MOVING, MOVING)]
    h = np.eye(2, 4)
    turn = rotation(initial.mean[2])
    big_x = turn @ np.diag([prior.length**2 / 4.0, prior.width**2 / 4.0]) @ turn.T
    alpha = tracker.prior_weight
    for k, interval in enumerate(intervals(scans.times)):
        x, p = predict(x, p, interval, tracker.sigma_q)
        alpha = 2.0 + np.exp(-interval / tracker.forgetting_time) * (alpha - 2.0)
        y = scans.points_world[scans.rows(k)]
        n = len(y)
        if n:
            r = scans.covariances_world[scans.rows(k)].mean(axis=0)
            r = r + tracker.measurement_std**2 * np.eye(2)
            mean = y.mean(axis=0)
            scatter = sum(np.outer(one - mean, one - mean) for one in y)
            big_y = tracker.scatter * big_x + r
            s = h @ p @ h.T + big_y / n
            gain = p @ h.T @ np.linalg.inv(s)
            v = mean - h @ x
            root = np.real(sqrtm(big_x))
            n_root = root @ np.linalg.inv(np.real(sqrtm(s)))
            y_root = root @ np.linalg.inv(np.real(sqrtm(big_y)))
            n_hat = n_root @ np.outer(v, v) @ n_root.T
            y_hat = y_root @ scatter @ y_root.T
            x, p = x + gain @ v, p - gain @ s @ gain.T
            big_x = (alpha * big_x + n_hat + y_hat) / (alpha + n)
            alpha = alpha + n
        yield x, p, big_x, alpha


def extensions_of(result):
    """X (K, 2, 2) m² of the ellipses that a track reports."""
    found = []
    for contour, mean in zip(result.contours_world, result.means, strict=True):
        # Points p of an ellipse about the centre fulfil pᵀ X⁻¹ p = 1.
        x, y = (contour - mean[:2]).T
        xx, xy, yy = np.linalg.lstsq(np.stack([x * x, 2 * x * y, y * y], axis=1), np.ones(len(x)))[
            0
        ]
        found.append(np.linalg.inv([[xx, xy], [xy, yy]]))
    return np.array(found)


def test_track_is_that_of_the_papers_equations():
    tracker = dataclasses.replace(TRACKER, gate_probability=None, prior_weight=20.0)
    points = seen_car(25, 12)
    points[4], points[9], points[15] = EMPTY, points[9][:1], points[15][:2]
    scans = scans_of(points, times=np.cumsum(np.linspace(0.05, 0.2, 25)))
    result = track(scans, START, CAR, tracker)
    extensions = extensions_of(result)
    for k, (x, p, extension, _) in enumerate(paper(scans, START, CAR, tracker)):
        np.testing.assert_allclose(result.means[k, MOVING], x, rtol=1e-9, atol=1e-9)
        spread = result.covariances[k][np.ix_(MOVING, MOVING)]
        np.testing.assert_allclose(spread, p, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(extensions[k], extension, rtol=1e-7)
    np.testing.assert_array_equal(
        result.nis_degrees_of_freedom, np.where(np.diff(result.used_offsets) > 0, 2, 0)
    )
    assert np.isnan(result.nis[4]) and np.isfinite(result.nis[[9, 15]]).all()


def test_track_is_that_of_pyrecest_where_the_axes_are_the_worlds():
    """Its roots are Cholesky factors, which are symmetric roots of diagonal matrices only."""
    module = pytest.importorskip("pyrecest.filters.random_matrix_tracker")
    tracker = dataclasses.replace(TRACKER, gate_probability=None, prior_weight=30.0, scatter=0.25)
    cross = np.array([[2.0, 0.0], [-2.1, 0.0], [0.0, 0.9], [0.0, -0.9]])
    points = [cross * (1.0 + 0.02 * k) + [5.2 + 0.5 * k, 10.0] for k in range(12)]
    start = InitialState(np.array([4.5, 10.0, 0.0, 5.0, 0.0, 0.0]), np.diag([0.1] * 6))
    scans = scans_of(points)
    result = track(scans, start, CAR, tracker)
    noise = (0.01 + tracker.measurement_std**2) * np.eye(2)
    # Its extent is the covariance of the points without noise, z X.
    extent = 0.25 * np.diag([CAR.length**2 / 4.0, CAR.width**2 / 4.0])
    other = module.RandomMatrixTracker(start.mean[MOVING], 0.1 * np.eye(4), extent)
    other.alpha = tracker.prior_weight
    matrix, motion = np.eye(4), np.zeros((4, 4))
    matrix[0, 2] = matrix[1, 3] = 0.1
    _, motion = predict(np.zeros(4), motion, 0.1, tracker.sigma_q)
    for k, scan in enumerate(points):
        other.predict(0.1, motion, tracker.forgetting_time, matrix)
        other.update(scan.T, np.eye(2, 4), noise)
        np.testing.assert_allclose(result.means[k, MOVING], other.kinematic_state, atol=1e-9)
        np.testing.assert_allclose(
            result.covariances[k][np.ix_(MOVING, MOVING)], other.covariance, atol=1e-12
        )
        np.testing.assert_allclose(
            extensions_of(result)[k], 4.0 * other.extent, rtol=1e-6, atol=1e-9
        )


def test_ellipse_converges_to_that_of_points_all_round():
    """Points in an ellipse that moves straight ahead, turned by 0.4 rad to the motion."""
    random, axes, turn = np.random.default_rng(2), np.array([2.4, 0.7]), rotation(0.5)
    tracker = dataclasses.replace(
        TRACKER, scatter=0.25, measurement_std=0.01, prior_weight=10.0, gate_probability=None
    )
    points = []
    for k in range(60):
        disc = np.sqrt(random.uniform(0, 1, (40, 1))) * (
            lambda a: np.stack([np.cos(a), np.sin(a)], axis=1)
        )(random.uniform(0, 2 * np.pi, 40))
        noise = 0.1 * random.standard_normal((40, 2))
        points.append((disc * axes) @ turn.T + [0.4 * k, 10.0] + noise)
    start = InitialState(np.array([-0.4, 10.0, 0.1, 4.0, 0.0, 0.0]), 0.1 * np.eye(6))
    result = track(scans_of(points), start, CAR, tracker)
    truth = turn @ np.diag(axes**2) @ turn.T
    np.testing.assert_allclose(extensions_of(result)[-1], truth, atol=0.12 * axes[0] ** 2)
    assert np.hypot(*(result.means[-1, :2] - [0.4 * 59, 10.0])) < 0.15
    # The centre is that of the points, and the filter knows how well.
    errors = result.means[20:, :2] - np.column_stack([0.4 * np.arange(20, 60), np.full(40, 10.0)])
    nees = np.einsum("ki,kij,kj->k", errors, np.linalg.inv(result.covariances[20:, :2, :2]), errors)
    assert 0.3 < nees.mean() / 2.0 < 2.0


@pytest.mark.parametrize("count", [1, 2])
def test_few_points_move_the_centre_and_hardly_the_ellipse(count):
    points = [scan[:count] for scan in seen_car(10, 20)]
    tracker = dataclasses.replace(TRACKER, gate_probability=None)
    result = track(scans_of(points), START, CAR, tracker)
    sizes = np.sqrt(np.linalg.eigvalsh(extensions_of(result)))
    np.testing.assert_allclose(sizes[0], [CAR.width / 2, CAR.length / 2], rtol=0.1)
    assert np.isfinite(result.covariances).all() and np.isfinite(result.contour_std).all()
    np.testing.assert_array_equal(np.diff(result.used_offsets), count)


def rectangle_outline():
    corner = np.array([2.1, 0.85])
    return corner * [[1, 1], [-1, 1], [-1, -1], [1, -1]]


def test_on_a_car_seen_from_one_side_the_centre_is_near_that_side():
    """The known weakness: the centroid of an L of points is off the centre."""
    poses = turning(40, 4.0, 0.1)
    result = track(
        scans_seen(rectangle_outline(), poses, noise=0.03), start_at(poses), CAR, TRACKER
    )
    ranges = np.hypot(*(result.means[20:, :2]).T) - np.hypot(*poses[20:, :2].T)
    assert -2.1 < ranges.mean() < -0.5
    assert np.hypot(*(result.means[-1, 3:5] - (poses[-1] - poses[-2])[:2] / 0.1)) < 1.0


@given(seed=SEEDS)
def test_update_of_the_extension_is_covariant_and_positive(seed):
    random = np.random.default_rng(seed)
    root = random.standard_normal((3, 2, 2))
    extension, covariance, noise = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(2)
    offsets, turn = random.standard_normal((5, 2)), rotation(random.uniform(-3, 3))
    innovation = random.standard_normal(2)
    plain = update_extension(extension, 7.0, (innovation, covariance), (offsets, noise))
    turned = update_extension(
        turn @ extension @ turn.T,
        7.0,
        (turn @ innovation, turn @ covariance @ turn.T),
        (offsets @ turn.T, turn @ noise @ turn.T),
    )
    np.testing.assert_allclose(turned, turn @ plain @ turn.T, atol=1e-9)
    assert np.linalg.eigvalsh(plain).min() > 0.0


@settings(max_examples=10)
@given(seed=SEEDS)
def test_stated_deviation_is_that_of_random_centres_and_extensions(seed):
    """Along rays from the estimated centre, with the inverse Wishart density of the paper."""
    random = np.random.default_rng(seed)
    weight, count = 60.0, 4000
    turn = rotation(random.uniform(-3, 3))
    extension = turn @ np.diag([4.4, 0.9]) @ turn.T
    mean = np.array([3.0, 9.0, 0.4, 0.0, 0.0, 0.0])
    covariance = np.zeros((6, 6))
    covariance[:2, :2] = [[0.004, 0.001], [0.001, 0.003]]
    certain = dataclasses.replace(
        CAR, shape="ellipse", corner_radius=0.0, sigma_f=1e-9, sigma_r=1e-9
    )
    _, directions, std = contours_of(
        mean[None], covariance[None], extension[None], np.array([weight]), certain, 16
    )
    # X⁻¹ has a Wishart density with alpha + 3 degrees of freedom and scale (alpha X)⁻¹.
    root = np.linalg.cholesky(np.linalg.inv(weight * extension))
    normal = root @ random.standard_normal((count, 2, int(weight) + 3))
    inverses = normal @ np.swapaxes(normal, 1, 2)
    shifts = random.multivariate_normal([0.0, 0.0], covariance[:2, :2], count)
    for direction, stated in zip(directions[0], std[0], strict=True):
        # (r p - d)ᵀ A (r p - d) = 1
        along = inverses @ direction
        a, b = along @ direction, np.einsum("ni,ni->n", along, shifts)
        c = np.einsum("ni,nij,nj->n", shifts, inverses, shifts) - 1.0
        radii = (b + np.sqrt(b * b - a * c)) / a
        assert np.std(radii) == pytest.approx(stated, rel=0.1)


def test_reported_ellipse_is_counter_clockwise_and_touches_the_classs_box():
    result = track(scans_of([EMPTY]), START, CAR, TRACKER)
    ring = shapely.linearrings(result.contours_world[0])
    assert ring.is_ccw
    body = (result.contours_world[0] - result.means[0, :2]) @ rotation(START.mean[2])
    np.testing.assert_allclose(np.ptp(body, axis=0), [CAR.length, CAR.width], rtol=1e-2)
