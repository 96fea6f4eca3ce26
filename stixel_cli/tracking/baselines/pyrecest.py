"""The extended trackers of PyRecEst (https://github.com/FlorianPfaff/PyRecEst) on the same scans.

This module gives them the class's prior, the initial state and the scans' noise, and turns their
estimates into a `Track`. What they do is documented there. Three things differ from their defaults:
the first shape is that of the class; a scan's points are always passed in the layout that the
tracker cannot mistake, also if there are two; and an ellipse's contour is drawn by its semi-axes.
An ellipse is uniformly filled, so its covariance is a quarter of the squared semi-axes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.baselines.pyrecest_parameters import PyRecEstParameters
from stixel_cli.tracking.motion import intervals, process_noise, transition
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import InitialState, Track, contour_directions

PLANE = np.array([0, 1, 3, 4])
"""Indices of x, y and their rates in the six states."""

CENTRE = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
"""From x, y and their rates to x, y."""

EXTENT_WEIGHT = 10.0
"""Degrees of freedom above the least with which the class's size counts."""

LEAST_AXIS = 0.05
"""Least semi-axis of an ellipse, m."""

UNKNOWN_HEADING_STD = 0.3
"""Of a tracker that does not estimate it, rad."""


@dataclass(frozen=True)
class _Estimate:
    """Mean (6,) and covariance (6, 6) of the six states, and the contour (M, 2) m in the world."""

    mean: np.ndarray
    covariance: np.ndarray
    contour: np.ndarray


@dataclass(frozen=True)
class _Adapter:
    """One tracker: what to call at each scan.

    Attributes:
        predict: with the interval, s.
        update: with points (n, 2) m and their covariances (n, 2, 2) m².
        estimate: the current one.
        least_points: with fewer points it is not updated.
    """

    predict: Callable[[float], None]
    update: Callable[[np.ndarray, np.ndarray], None]
    estimate: Callable[[], _Estimate]
    least_points: int = 1


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan.

    The std of the contour is the class's, and there is no NIS: the trackers give neither alike.

    Raises:
        UserError: if PyRecEst is not installed.
        ValueError: if it fails, such as after a gap of days.
    """
    adapter = _adapter(initial, prior, tracker)
    size = np.diag([prior.length**2, prior.width**2]) / 12.0
    added = tracker.measurement_std**2 * np.eye(2)
    estimates, used = [], []
    try:
        for k, interval in enumerate(intervals(scans.times)):
            adapter.predict(float(interval))
            now, rows = adapter.estimate(), scans.rows(k)
            noises = scans.covariances_world[rows] + added
            turn = rotation(now.mean[2])
            spread = now.covariance[:2, :2] + turn @ size @ turn.T + noises
            points = scans.points_world[rows]
            near = associate(points, now.mean[:2], spread, tracker.gate_probability)
            near = near if len(near) >= adapter.least_points else near[:0]
            used.append(near + rows.start)
            if len(near):
                adapter.update(points[near], noises[near])
                now = adapter.estimate()
            estimates.append(now)
    except np.linalg.LinAlgError as error:
        raise ValueError(f"{tracker.name} of PyRecEst failed at scan {k}: {error}") from error
    means = np.array([one.mean for one in estimates])
    means[:, 2] = np.unwrap(means[:, 2])
    contours = np.array([one.contour for one in estimates])
    arms = contours - means[:, None, :2]
    lengths = np.linalg.norm(arms, axis=2, keepdims=True)
    directions = np.divide(arms, lengths, out=np.zeros_like(arms), where=lengths > 0.0)
    std = np.full(contours.shape[:2], np.hypot(prior.sigma_f, prior.sigma_r))
    return Track.of_scans(
        scans.times,
        (means, np.array([one.covariance for one in estimates])),
        (contours, directions, std),
        used,
        nis=np.full(len(scans), np.nan),
        nis_degrees_of_freedom=np.zeros(len(scans), dtype=np.int64),
    )


def _adapter(initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters) -> _Adapter:
    try:
        # Without it, the module of the Fourier series cannot be imported.
        import pyrecest.distributions  # noqa: F401
    except ImportError as error:
        raise UserError(
            f"tracker=pyrecest: PyRecEst is not installed ({error}): pip install 'stixel[peers]'"
        ) from None
    if tracker.name in ("full_scgp", "decorrelated_scgp", "ekf_spline"):
        return _star_convex(initial, prior, tracker)
    if tracker.name == "fourier_rhm":
        return _fourier(initial, prior, tracker)
    return _ellipse(initial, prior, tracker)


def _star_convex(initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters) -> _Adapter:
    """A shape in the target's frame; the state: x, y, heading, speed, turn rate, and the shape."""
    x, y, heading, x_rate, y_rate, heading_rate = initial.mean
    ahead = np.array([np.cos(heading), np.sin(heading)])
    state = np.array([x, y, heading, np.array([x_rate, y_rate]) @ ahead, heading_rate])
    # Speed is the velocity along the heading.
    rows = np.zeros((5, 6))
    rows[[0, 1, 2, 4], [0, 1, 2, 5]] = 1.0
    rows[3, 3:5] = ahead
    covariance = rows @ initial.covariance @ rows.T
    angles = 2.0 * np.pi * np.arange(tracker.basis_points) / tracker.basis_points
    radii = prior_radii(prior, angles)
    if tracker.name == "ekf_spline":
        from pyrecest.filters.ekf_spline_tracker import EKFSplineTracker

        directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        share = np.hypot(prior.sigma_f, prior.sigma_r) / radii.mean()
        filter_: Any = EKFSplineTracker(
            control_points=radii[:, None] * directions,
            kinematic_state=state,
            scale_state=np.ones(2),
            covariance=_joined(covariance, share**2 * np.eye(2)),
        )
    else:
        from pyrecest.filters.gprhm_tracker import DecorrelatedSCGPTracker, FullSCGPTracker

        kinds = {"full_scgp": FullSCGPTracker, "decorrelated_scgp": DecorrelatedSCGPTracker}
        filter_ = kinds[tracker.name](
            tracker.basis_points,
            kinematic_state=state,
            kinematic_covariance=covariance,
            shape_state=radii,
            reference_extent=radii,
            kernel_params=(prior.sigma_f**2 + prior.sigma_r**2, np.pi / 4),
        )

    def predict(interval: float) -> None:
        noise = np.diag([0.0, 0.0, 0.0, tracker.sigma_q**2, tracker.sigma_q_psi**2]) * interval
        if tracker.name == "ekf_spline":
            filter_.predict(interval, _joined(noise, np.zeros((2, 2))))
        else:
            filter_.predict(interval, noise)

    def update(points: np.ndarray, noises: np.ndarray) -> None:
        # Two points are read as rows. Only the Gaussian processes take one covariance a point.
        one = tracker.name == "ekf_spline"
        filter_.update(points, R=noises.mean(axis=0) if one else noises)

    def estimate() -> _Estimate:
        values, spread = np.asarray(filter_.state)[:5], np.asarray(filter_.covariance)[:5, :5]
        cosine, sine = np.cos(values[2]), np.sin(values[2])
        mean = np.array([*values[:3], values[3] * cosine, values[3] * sine, values[4]])
        matrix = np.zeros((6, 5))
        matrix[[0, 1, 2, 5], [0, 1, 2, 4]] = 1.0
        matrix[3, 2:4] = -values[3] * sine, cosine
        matrix[4, 2:4] = values[3] * cosine, sine
        contour = np.asarray(filter_.get_contour_points(tracker.contour_points))
        return _Estimate(mean, matrix @ spread @ matrix.T, contour)

    return _Adapter(predict, update, estimate)


def _fourier(initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters) -> _Adapter:
    """A shape in the world's frame, and x, y: it has no velocity, which this adapter adds.

    The position moves by the smoothed differences of the last positions. The heading is that of
    the initial state.
    """
    from pyrecest.filters.fourier_rhm_tracker import FourierRHMTracker

    angles = 2.0 * np.pi * np.arange(256) / 256
    radii = prior_radii(prior, angles - initial.mean[2])
    waves = [np.exp(-1j * n * angles) for n in range(tracker.harmonics + 1)]
    series = [2.0 * np.mean(radii * wave) for wave in waves]
    coefficients = [series[0].real]
    for term in series[1:]:
        coefficients += [term.real, -term.imag]
    variance = prior.sigma_f**2 + prior.sigma_r**2
    filter_ = FourierRHMTracker(
        tracker.harmonics,
        fourier_coefficients=np.array(coefficients),
        kinematic_state=initial.mean[:2],
        coefficient_covariance=variance,
        kinematic_covariance=initial.covariance[:2, :2],
        # Measured points are on the contour, not inside.
        scale_mean=1.0,
        scale_variance=1e-3,
    )
    velocity, before, elapsed = initial.mean[3:5].copy(), initial.mean[:2].copy(), 1.0
    count = len(coefficients)

    def predict(interval: float) -> None:
        nonlocal before, elapsed
        before, elapsed = np.asarray(filter_.kinematic_state).copy(), interval
        drift = initial.covariance[3:5, 3:5] * interval**2
        drift = drift + tracker.sigma_q**2 * interval**3 * np.eye(2)
        filter_.predict_linear(
            np.eye(count + 2),
            sys_noise=_joined(np.zeros((count, count)), drift),
            inputs=np.concatenate([np.zeros(count), interval * velocity]),
        )

    def update(points: np.ndarray, noises: np.ndarray) -> None:
        nonlocal velocity
        filter_.update(points.T, noises.mean(axis=0))
        if elapsed > 0.0:
            moved = (np.asarray(filter_.kinematic_state) - before) / elapsed
            velocity = 0.7 * velocity + 0.3 * moved

    def estimate() -> _Estimate:
        mean = initial.mean.copy()
        mean[:2], mean[3:5], mean[5] = filter_.kinematic_state, velocity, 0.0
        covariance = initial.covariance.copy()
        covariance[:2], covariance[:, :2] = 0.0, 0.0
        covariance[:2, :2] = np.asarray(filter_.covariance)[count:, count:]
        covariance[2, 2] = max(covariance[2, 2], UNKNOWN_HEADING_STD**2)
        contour = np.asarray(filter_.get_contour_points(tracker.contour_points))
        return _Estimate(mean, covariance, contour)

    return _Adapter(predict, update, estimate)


def _ellipse(initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters) -> _Adapter:
    """An ellipse; the state is x, y and their rates, and the ellipse."""
    from pyrecest.filters.factorized_giw_random_matrix_tracker import (
        FactorizedGIWRandomMatrixTracker,
    )
    from pyrecest.filters.ggiw_tracker import GGIWTracker
    from pyrecest.filters.mem_ekf_star_tracker import MEMEKFStarTracker
    from pyrecest.filters.mem_qkf_tracker import MEMQKFTracker
    from pyrecest.filters.vbrm_tracker import VBRMTracker

    start = (initial.mean[PLANE].copy(), initial.covariance[np.ix_(PLANE, PLANE)])
    heading, heading_variance = float(initial.mean[2]), float(initial.covariance[2, 2])
    axes = 0.5 * np.array([prior.length, prior.width])
    variance = prior.sigma_f**2 + prior.sigma_r**2
    oriented = np.array([heading, *axes])
    turn = rotation(heading)
    extent = turn @ np.diag(axes**2 / 4.0) @ turn.T
    name = tracker.name
    if name in ("mem_qkf", "mem_ekf_star"):
        kind = MEMQKFTracker if name == "mem_qkf" else MEMEKFStarTracker
        shape = np.diag([heading_variance, variance, variance])
        filter_: Any = kind(*start, oriented, shape, measurement_matrix=CENTRE)
    elif name == "vbrm":
        filter_ = VBRMTracker(*start, oriented, heading_variance, measurement_matrix=CENTRE)
    elif name == "ggiw":
        filter_ = GGIWTracker(*start, extent, 6.0 + EXTENT_WEIGHT, 10.0, 1.0, CENTRE)
    else:
        scale = EXTENT_WEIGHT * extent
        filter_ = FactorizedGIWRandomMatrixTracker(*start, 6.0 + EXTENT_WEIGHT, scale, CENTRE)

    def predict(interval: float) -> None:
        chosen = np.ix_(PLANE, PLANE)
        matrix = transition(interval)[chosen]
        noise = process_noise(interval, tracker.sigma_q, 0.0)[chosen] + 1e-12 * np.eye(4)
        turned = tracker.sigma_q_psi**2 * interval
        if name == "factorised_giw":
            filter_.predict(interval, noise, system_matrix=matrix)
        elif name == "ggiw":
            filter_.predict_linear(matrix, noise, extent_forgetting_factor=0.98)
        elif name == "vbrm":
            filter_.predict_linear(matrix, noise, orientation_sys_noise=turned)
        else:
            shape_noise = np.diag([turned, 0.0, 0.0])
            filter_.predict_linear(matrix, noise, shape_sys_noise=shape_noise)

    def update(points: np.ndarray, noises: np.ndarray) -> None:
        # Two points are read as columns.
        filter_.update(points.T, CENTRE, noises.mean(axis=0))
        if name == "mem_ekf_star":
            # Its update can make a semi-axis negative, which its prediction refuses.
            filter_.shape_state[1:] = np.maximum(np.abs(filter_.shape_state[1:]), LEAST_AXIS)

    def estimate() -> _Estimate:
        values, spread = np.asarray(filter_.kinematic_state), np.asarray(filter_.covariance)
        if name in ("mem_qkf", "mem_ekf_star"):
            angle, *semi = np.asarray(filter_.shape_state)
            angle_variance = float(filter_.shape_covariance[0, 0])
        elif name == "vbrm":
            angle, *semi = np.asarray(filter_.get_point_estimate_shape())
            angle_variance = float(filter_.orientation_variance)
        else:
            roots, vectors = np.linalg.eigh(np.asarray(filter_.extent))
            semi = 2.0 * np.sqrt(np.maximum(roots[::-1], 0.0))
            angle, angle_variance = np.arctan2(*vectors[::-1, 1]), UNKNOWN_HEADING_STD**2
        mean = np.zeros(6)
        mean[PLANE], mean[2] = values, _forwards(float(angle), values[2:], heading)
        covariance = np.diag([0.0, 0.0, angle_variance, 0.0, 0.0, tracker.sigma_q_psi**2])
        covariance[np.ix_(PLANE, PLANE)] = spread
        return _Estimate(mean, covariance, _ellipse_contour(mean, np.abs(semi), tracker))

    least = 3 if name == "factorised_giw" else 1
    return _Adapter(predict, update, estimate, least)


def _forwards(angle: float, velocity: np.ndarray, heading: float) -> float:
    """The direction of an axis that points forwards; an ellipse does not know which one does."""
    moving = np.hypot(*velocity) > 0.3
    towards = np.arctan2(velocity[1], velocity[0]) if moving else heading
    back = abs(float(wrap_angle(angle - towards))) > 0.5 * np.pi
    return angle + (np.pi if back else 0.0)


def _ellipse_contour(
    mean: np.ndarray, semi_axes: np.ndarray, tracker: PyRecEstParameters
) -> np.ndarray:
    """Contour (M, 2) m of an ellipse, counter-clockwise; its first axis is along the heading."""
    angles, _ = contour_directions(mean[2:3], tracker.contour_points)
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1) * semi_axes
    return mean[:2] + points @ rotation(mean[2]).T


def _joined(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Both matrices as one block-diagonal matrix."""
    n, m = len(first), len(second)
    joined = np.zeros((n + m, n + m))
    joined[:n, :n], joined[n:, n:] = first, second
    return joined
