"""A scan of `gp_ekf` beside the textbook's dense update and the plain information form.

600 points, 50 basis points, one BLAS thread. And whole tracks with about 60 points in a scan:
`pytest bench/bench_tracking.py`.
"""

import numpy as np
import pytest
from scipy.linalg import block_diag, cho_factor, cho_solve
from small import sized
from threadpoolctl import threadpool_limits

from stixel_cli.config.compose import compose
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.measurements.fabricated import fabricate_scans
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.tracking import gp_ekf
from stixel_cli.tracking.contour import contour
from stixel_cli.tracking.gp_ekf import GpEkfParameters, track
from stixel_cli.tracking.gp_ekf_update import linearise, update
from stixel_cli.tracking.kernel import ContourProcess, kernel
from stixel_cli.tracking.motion import predict, process_noise, transition
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.start import noisy_start
from stixel_cli.tracking.track import InitialState

POINTS, SCANS, INTERVAL, STD = *sized((600, 30), (60, 12)), 0.1, 0.1
CAR = PriorShape(4.2, 1.7, "rectangle", 0.3, 2.0, 0.8, 0.1, 0.3, "car", 0.06, 0.06, None)
TRACKER = GpEkfParameters(
    kind="gp_ekf",
    basis_points=50,
    length_scale=np.pi / 8,
    sigma_f=2.0,
    sigma_r=0.8,
    forgetting_rate=1e-4,
    sigma_q=1.0,
    sigma_q_psi=0.2,
    slip=None,
    seen_by=None,
    measurement_std=STD,
    gate_probability=0.99,
    lag=0,
)
START = InitialState(
    np.array([7.5, 12.0, 0.1, 5.0, 0.5, 0.2]), np.diag([0.1, 0.1, 0.01, 0.25, 0.25, 0.01])
)
PROCESS = ContourProcess(50, np.pi / 8, 2.0, 0.8, 1e-6)


@pytest.fixture(autouse=True)
def _one_thread():
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="module")
def scans():
    """An ellipse of a car's size, all of it seen, that moves along."""
    random = np.random.default_rng(0)
    times = INTERVAL * np.arange(SCANS)
    points = []
    for t in times + INTERVAL:
        angles = random.uniform(0.0, 2.0 * np.pi, POINTS)
        outline = np.stack([2.25 * np.cos(angles), 0.9 * np.sin(angles)], axis=-1)
        heading = 0.1 + 0.2 * t
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        noise = STD * random.standard_normal((POINTS, 2))
        points.append(outline @ turn.T + [7.5 + 5.0 * t, 12.0 + 0.5 * t] + noise)
    return Scans(
        times=times,
        sensor_poses_world=np.tile([0.0, 0.0, np.pi / 2], (SCANS, 1)),
        offsets=POINTS * np.arange(SCANS + 1),
        points_world=np.concatenate(points),
        covariances_world=np.tile(STD**2 * np.eye(2), (SCANS * POINTS, 1, 1)),
    )


@pytest.fixture(scope="module")
def tracked(scans):
    with threadpool_limits(1):
        return track(scans, START, CAR, TRACKER)


@pytest.fixture(scope="module")
def state(tracked):
    """Posterior of the scan before the one that is timed."""
    return tracked.means[9], tracked.covariances[9]


def kernel_derivative(angles, other_angles, length_scale, sigma_f):
    """∂k(u, u') / ∂u, shape (n, m), m²/rad."""
    exponential = kernel(angles, other_angles, length_scale, sigma_f, 0.0)
    difference = angles[:, None] - other_angles[None, :]
    return -np.sin(difference) / length_scale**2 * exponential


def jacobian_rows(points, mean):
    """z_hat (n, 2), H (n, 2, D) and R_l (n, 2, 2), written down as in thesis (65)-(77)."""
    offsets = points - mean[:2]
    ranges = np.linalg.norm(offsets, axis=1)
    p = offsets / ranges[:, None]
    u = np.arctan2(offsets[:, 1], offsets[:, 0]) - mean[2]
    basis = PROCESS.basis_angles
    cross = kernel(u, basis, np.pi / 8, 2.0, 0.8)
    rows = cross @ PROCESS.inverse
    slope = kernel_derivative(u, basis, np.pi / 8, 2.0) @ PROCESS.inverse @ mean[6:]
    radius = rows @ mean[6:]
    variance = 4.0 + 0.64 - np.sum(rows * cross, axis=1)
    outer = p[:, :, None] * p[:, None, :]
    turn = np.stack([offsets[:, 1], -offsets[:, 0]], axis=1) / ranges[:, None] ** 2
    matrix = np.zeros((len(points), 2, len(mean)))
    matrix[:, :, :2] = np.eye(2) + (outer - np.eye(2)) * (radius / ranges)[:, None, None]
    matrix[:, :, :2] += slope[:, None, None] * p[:, :, None] * turn[:, None, :]
    matrix[:, :, 2] = -p * slope[:, None]
    matrix[:, :, 6:] = p[:, :, None] * rows[:, None, :]
    noise = variance[:, None, None] * outer + STD**2 * np.eye(2)
    return mean[:2] + p * radius[:, None], matrix, noise


def plain_prediction(mean, covariance):
    decay = np.exp(-1e-4 * INTERVAL)
    dense = block_diag(transition(INTERVAL), decay * np.eye(50))
    noise = block_diag(process_noise(INTERVAL, 1.0, 0.2), (1 - decay**2) * PROCESS.covariance)
    return dense @ mean, dense @ covariance @ dense.T + noise


def dense_scan(mean, covariance, points):
    """S is 2n x 2n and is solved for the gain."""
    mean, covariance = plain_prediction(mean, covariance)
    predicted, matrix, noise = jacobian_rows(points, mean)
    matrix = matrix.reshape(-1, len(mean))
    spread = matrix @ covariance @ matrix.T + block_diag(*noise)
    gain = np.linalg.solve(spread, matrix @ covariance).T
    return mean + gain @ (points - predicted).ravel(), covariance - gain @ spread @ gain.T


def information_scan(mean, covariance, points):
    """A = Hᵀ R⁻¹ H over all two rows a point, by the blocks of R; then as the issue says."""
    mean, covariance = plain_prediction(mean, covariance)
    predicted, matrix, noise = jacobian_rows(points, mean)
    weighted = np.linalg.inv(noise) @ matrix
    flat, weighted = matrix.reshape(-1, len(mean)), weighted.reshape(-1, len(mean))
    total = weighted.T @ flat
    vector = weighted.T @ (points - predicted).ravel()
    lower = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(mean)))
    inner = cho_factor(np.eye(len(mean)) + lower.T @ total @ lower)
    posterior = lower @ cho_solve(inner, lower.T)
    return mean + posterior @ vector, posterior


def fast_scan(mean, covariance, points):
    noise = process_noise(INTERVAL, 1.0, 0.2)
    mean, covariance = predict(mean, covariance, INTERVAL, noise, 1e-4, PROCESS.covariance)
    model = linearise(points, mean, PROCESS)
    return update(mean, covariance, model, STD**2, tangential=True)[:2]


# The dense one first: the arrays of megabytes that it frees teach malloc to keep its pages, as any
# process that has had an image in hand has been taught. A bare process pays 0.3 ms of page faults.
@pytest.mark.parametrize("scan", [dense_scan, information_scan, fast_scan])
def test_scan(benchmark, scan, scans, state, tracked):
    """Prediction and update with 600 points."""
    benchmark.group = "A scan of 600 points in the tracker"
    points = scans.points_world[scans.rows(10)]
    mean, covariance = benchmark(scan, *state, points)
    error = np.abs(mean - tracked.means[10]).max()
    benchmark.extra_info["accuracy"] = f"mean within {error:.0e} of the track"
    np.testing.assert_allclose(mean, tracked.means[10], atol=1e-5)
    np.testing.assert_allclose(covariance, tracked.covariances[10], atol=1e-5)


def test_whole_track(benchmark, scans):
    """Thirty scans with all that a track is: association, NIS, contours. Divide by 30."""
    benchmark(track, scans, START, CAR, TRACKER)


@pytest.mark.parametrize("module", [gp_ekf, contour], ids=["gp_ekf", "contour"])
def test_track_of_100_scans(benchmark, module):
    """A fabricated car on the default path, seen by fewer rays than columns."""
    benchmark.group = "A track of 100 scans with about 60 points each"
    name = module.__name__.rpartition(".")[2]
    overrides = (f"tracker={name}", "measurement=fabricated", "measurement.rays=280")
    overrides += sized((), ("path.duration=1",))
    p = compose(overrides).configuration
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(ego, p.road_user, p.path)
    scans = fabricate_scans(scenario, p.rig, p.measurement, 0)
    initial = noisy_start(scenario, p.start, 0)
    found = benchmark(module.track, scans, initial, p.prior, p.tracker)
    metrics = evaluate(found, scenario, scans).metrics
    benchmark.extra_info["accuracy"] = (
        f"{len(scans)} scans, {len(scans.points_world) / len(scans):.0f} points, "
        f"IoU {metrics['iou_mean']:.2f}"
    )
