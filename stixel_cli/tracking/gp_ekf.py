"""Extended Kalman filter on a Gaussian process contour: Wahlström & Özkan 2015; thesis (50)-(77).

State: x, y, heading, their rates, then the radii at the basis angles; world frame, m, rad, s.

`gp_ekf_update.py` has the update.
"""

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking import motion
from stixel_cli.tracking.association import associate, contour_moments
from stixel_cli.tracking.gp_ekf_update import linearise, pose_derivatives, update
from stixel_cli.tracking.kalman import Step, smooth
from stixel_cli.tracking.kernel import ContourProcess
from stixel_cli.tracking.loop import Filtered, Scan
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import InitialState, Track, contour_directions, with_sensor_errors

if TYPE_CHECKING:
    from stixel_cli.tracking.one_side import OneSide


@parameters
class GpEkfParameters:
    """The extended Kalman filter on a Gaussian process contour, [GP] Wahlström & Özkan 2015.

    Attributes:
        basis_points: number N_f of basis angles, even in [0, 2 pi).
        length_scale: kernel's length l, rad.
        sigma_f: kernel's standard deviation of the radius, m.
        sigma_r: standard deviation of the unknown mean radius, m.
        forgetting_rate: alpha, 1/s: how fast radii that are not seen return to the kernel's mean.
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        sigma_q_psi: process noise of the heading, rad/s^1.5.
        slip: standard deviation of the velocity across the heading, m/s, which is zero; null: any
            velocity, thesis (62).
        seen_by: kind of measurement, which sees one side of the target among neighbours: the radii
            start as the outline of the class, and points are moved onto it, see `one_side.py`.
            null: the points are on the contour, all round it, as in [GP].
        measurement_std: of a point along each axis, m: R is isotropic, whatever a scan states; with
            `seen_by` that of what neighbouring points share, beside their own noise.
        gate_probability: chi-square probability of the association's gate; null takes every point.
        lag: later scans that a second, smoothed track uses; 0: there is none; null: all of the run.
    """

    kind: Literal["gp_ekf"]
    basis_points: Annotated[int, Ge(4), Le(500)]
    length_scale: Annotated[float, Ge(0.001), Le(10)]
    sigma_f: Annotated[float, Gt(0), Le(20)]
    sigma_r: Annotated[float, Ge(0), Le(20)]
    forgetting_rate: Annotated[float, Ge(0), Le(100)]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    sigma_q_psi: Annotated[float, Ge(0), Le(100)]
    slip: Annotated[float, Gt(0), Le(10)] | None
    seen_by: Literal["stixels", "fabricated", "lidar", "file", "own"] | None
    measurement_std: Annotated[float, Ge(1e-6), Le(10)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None
    lag: Annotated[int, Ge(0)] | None


NO_DIRECTION = 1e-3
"""A point nearer than this to the predicted centre, m, has no direction from it: not used."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: GpEkfParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan, the first too.

    The state starts as `initial`, which is one sample before the first scan, with the radii of the
    class's `prior` and covariance K for them. Reads no truth. The innovation is one radial scalar a
    point (its tangential component is zero by construction), so the NIS of a scan with n points
    has n degrees of freedom.
    """
    from scipy.linalg import block_diag

    process = ContourProcess(
        tracker.basis_points, tracker.length_scale, tracker.sigma_f, tracker.sigma_r
    )
    side, radii = None, prior_radii(prior, process.basis_angles)
    if tracker.seen_by is not None:
        # Numba takes half a second to import, and every command imports this module.
        from stixel_cli.tracking.one_side import OneSide

        side = OneSide(prior, tracker, process, scans, initial.covariance)
        radii = side.radii
    mean = np.concatenate([initial.mean, radii])
    covariance = block_diag(initial.covariance, process.covariance)
    filtered = Filtered(scans, len(mean))
    steps: list[Step] = []

    @cache
    def moved(interval: float) -> tuple[np.ndarray, ...]:
        """The pose's process noise, the transition of all states, and their stated noise."""
        kept = np.exp(-tracker.forgetting_rate * interval)
        noise = motion.process_noise(interval, tracker.sigma_q, tracker.sigma_q_psi)
        transition = block_diag(motion.transition(interval), kept * np.eye(tracker.basis_points))
        forgotten = (1.0 - kept**2) * (side.radii_covariance if side else process.covariance)
        return noise, transition, block_diag(noise, forgotten)

    for scan in filtered:
        interval, (noise, transition, stated) = scan.interval, moved(scan.interval)
        mean, covariance = predicted = motion.predict(
            mean, covariance, interval, noise, tracker.forgetting_rate, process.covariance
        )
        if side:
            side.predict(transition, stated)
        if tracker.slip is not None:
            mean, covariance, *tie = motion.tied_to_velocity(mean, covariance, tracker.slip)
            if side:
                side.correct_by_one(*tie, tracker.slip**2)
        mean, covariance, indices, nis = _updated(mean, covariance, scan, process, side, tracker)
        filtered.add(mean, side.reported if side else covariance, indices, nis)
        if tracker.lag != 0:
            last = steps[-1] if steps else None
            steps.append(Step(mean, covariance, *predicted, last, transition))

    if side:
        filtered.widen_by_innovations()
    track = filtered.track(contours_of(*filtered.states, process))
    if tracker.lag != 0:
        means, covariances = smooth(steps, tracker.lag)
        # Of errors that scans share, later scans take little: those of the filter are stated.
        states = means, filtered.states[1] if side else covariances
        smoothed = filtered.track(contours_of(*states, process), states)
        track = replace(track, smoothed=replace(smoothed, lag=tracker.lag))
    return with_sensor_errors(track, scans)


def _updated(
    mean: np.ndarray,
    covariance: np.ndarray,
    scan: Scan,
    process: ContourProcess,
    side: "OneSide | None",
    tracker: GpEkfParameters,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Mean and covariance after a scan, the indices (m,) of its points that were used, the NIS."""
    points = scan.points
    if side:
        rays, moves = side.rays(scan, mean)
        points = rays.points_world
    indices = _associated(points, mean, covariance, process, tracker)
    if side:
        indices = side.target(rays, indices, mean)
    if not len(indices):
        return mean, covariance, indices, np.nan
    if side:
        taken = rays.subset(indices), moves[:, indices]
        mean, covariance, nis = side.correct_by_scan(mean, covariance, *taken)
    else:
        model, variance = linearise(points[indices], mean, process), tracker.measurement_std**2
        mean, covariance, _, nis = update(mean, covariance, model, variance, tangential=True)
    return mean, covariance, indices, nis


def contours_of(
    means: np.ndarray, covariances: np.ndarray, process: ContourProcess, points: int = 120
) -> tuple[np.ndarray, np.ndarray]:
    """Contours (K, M, 2) m and std (K, M) m of K states; see `Track`.

    At M = `points` even angles: r = H^f x^f. A radius below zero, which the model does not rule
    out, is drawn as zero, so every contour is star-convex. A change of pose or radii moves the
    point where a ray from the estimated centre meets the contour by the radial row J of the
    measurement model, so its variance is J P Jᵀ + R^f.
    """
    angles, directions = contour_directions(means[:, 2], points)
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    # The points are at the same angles of the target's frame in each scan.
    correlations = process.correlations(unit)
    matrix, variances = process.regression(correlations)
    radii, slopes = process.radius(unit, correlations, means[:, 6:])
    radii = np.maximum(radii, 0.0)
    contours = means[:, None, :2] + radii[..., None] * directions
    by_pose = pose_derivatives(directions, np.maximum(radii, NO_DIRECTION), slopes)
    rows, spread = np.zeros((points, means.shape[1])), np.empty(radii.shape)
    rows[:, 6:] = matrix
    for k, covariance in enumerate(covariances):
        rows[:, :3] = by_pose[k]
        spread[k] = np.einsum("ij,ij->i", rows @ covariance, rows)
    return contours, np.sqrt(np.maximum(spread, 0.0) + variances)


def _associated(
    points_world: np.ndarray,
    mean: np.ndarray,
    covariance: np.ndarray,
    process: ContourProcess,
    tracker: GpEkfParameters,
) -> np.ndarray:
    """Indices of the points in the gate round the predicted contour that have a direction."""
    turn = rotation(mean[2])
    centroid, extent = contour_moments(process.basis_directions, mean[6:])
    indices = associate(
        points_world,
        mean[:2] + turn @ centroid,
        covariance[:2, :2] + turn @ extent @ turn.T + tracker.measurement_std**2 * np.eye(2),
        tracker.gate_probability,
    )
    offsets = points_world[indices] - mean[:2]
    return indices[np.hypot(offsets[:, 0], offsets[:, 1]) >= NO_DIRECTION]
