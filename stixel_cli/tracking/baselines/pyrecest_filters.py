"""The filters of PyRecEst, with the class's prior and an initial state, behind one interface."""

from typing import Any

import numpy as np
from scipy.linalg import block_diag

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.tracking.baselines.pyrecest import PyRecEstParameters
from stixel_cli.tracking.kalman import PLACE
from stixel_cli.tracking.motion import MOVING, process_noise, transition
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import InitialState, contour_directions

EXTENT_WEIGHT = 10.0
"""Degrees of freedom above the least with which the class's size counts."""

LEAST_AXIS = 0.05
"""Least semi-axis of an ellipse, m."""

UNKNOWN_HEADING_STD = 0.3
"""Of a tracker that does not estimate it, rad."""

Estimate = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Mean (6,) and covariance (6, 6) of the six states, and the contour (M, 2) m in the world."""


class StarConvex:
    """A shape in the target's frame; the state: x, y, heading, speed, turn rate, and the shape."""

    def __init__(self, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters):
        self._tracker = tracker
        self._is_spline = tracker.name == "ekf_spline"
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
        if self._is_spline:
            from pyrecest.filters.ekf_spline_tracker import EKFSplineTracker

            directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
            share = np.hypot(prior.sigma_f, prior.sigma_r) / radii.mean()
            self._filter: Any = EKFSplineTracker(
                control_points=radii[:, None] * directions,
                kinematic_state=state,
                scale_state=np.ones(2),
                covariance=block_diag(covariance, share**2 * np.eye(2)),
            )
        else:
            from pyrecest.filters.gprhm_tracker import DecorrelatedSCGPTracker, FullSCGPTracker

            kinds = {"full_scgp": FullSCGPTracker, "decorrelated_scgp": DecorrelatedSCGPTracker}
            self._filter = kinds[tracker.name](
                tracker.basis_points,
                kinematic_state=state,
                kinematic_covariance=covariance,
                shape_state=radii,
                reference_extent=radii,
                kernel_params=(prior.sigma_f**2 + prior.sigma_r**2, np.pi / 4),
            )

    def predict(self, interval: float) -> None:
        """Move the state by `interval` s."""
        variances = self._tracker.sigma_q**2, self._tracker.sigma_q_psi**2
        noise = np.diag([0.0, 0.0, 0.0, *variances]) * interval
        if self._is_spline:
            noise = block_diag(noise, np.zeros((2, 2)))
        self._filter.predict(interval, noise)

    def update(self, points: np.ndarray, noises: np.ndarray) -> None:
        """Correct the state by points (n, 2) m with covariances (n, 2, 2) m²."""
        # Two points are read as rows. Only the Gaussian processes take one covariance a point.
        self._filter.update(points, R=noises.mean(axis=0) if self._is_spline else noises)

    def estimate(self) -> Estimate:
        """The current estimate."""
        values = np.asarray(self._filter.state)[:5]
        spread = np.asarray(self._filter.covariance)[:5, :5]
        cosine, sine = np.cos(values[2]), np.sin(values[2])
        mean = np.array([*values[:3], values[3] * cosine, values[3] * sine, values[4]])
        matrix = np.zeros((6, 5))
        matrix[[0, 1, 2, 5], [0, 1, 2, 4]] = 1.0
        matrix[3, 2:4] = -values[3] * sine, cosine
        matrix[4, 2:4] = values[3] * cosine, sine
        contour = np.asarray(self._filter.get_contour_points(self._tracker.contour_points))
        return mean, matrix @ spread @ matrix.T, contour


class FourierSeries:
    """A shape in the world's frame, and x, y: it has no velocity, which this class adds.

    The position moves by the smoothed differences of the last positions. The heading is that of
    the initial state.
    """

    def __init__(self, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters):
        from pyrecest.filters.fourier_rhm_tracker import FourierRHMTracker

        angles = 2.0 * np.pi * np.arange(256) / 256
        radii = prior_radii(prior, angles - initial.mean[2])
        waves = [np.exp(-1j * n * angles) for n in range(tracker.harmonics + 1)]
        series = [2.0 * np.mean(radii * wave) for wave in waves]
        coefficients = [series[0].real]
        for term in series[1:]:
            coefficients += [term.real, -term.imag]
        self._filter = FourierRHMTracker(
            tracker.harmonics,
            fourier_coefficients=np.array(coefficients),
            kinematic_state=initial.mean[:2],
            coefficient_covariance=prior.sigma_f**2 + prior.sigma_r**2,
            kinematic_covariance=initial.covariance[:2, :2],
            # Measured points are on the contour, not inside.
            scale_mean=1.0,
            scale_variance=1e-3,
        )
        self._initial, self._tracker, self._count = initial, tracker, len(coefficients)
        self._velocity, self._before = initial.mean[3:5].copy(), initial.mean[:2].copy()
        self._elapsed = 1.0

    def predict(self, interval: float) -> None:
        """Move the state by `interval` s."""
        self._before = np.asarray(self._filter.kinematic_state).copy()
        self._elapsed = interval
        drift = self._initial.covariance[3:5, 3:5] * interval**2
        drift = drift + self._tracker.sigma_q**2 * interval**3 * np.eye(2)
        self._filter.predict_linear(
            np.eye(self._count + 2),
            sys_noise=block_diag(np.zeros((self._count, self._count)), drift),
            inputs=np.concatenate([np.zeros(self._count), interval * self._velocity]),
        )

    def update(self, points: np.ndarray, noises: np.ndarray) -> None:
        """Correct the state by points (n, 2) m with covariances (n, 2, 2) m²."""
        self._filter.update(points.T, noises.mean(axis=0))
        if self._elapsed > 0.0:
            moved = (np.asarray(self._filter.kinematic_state) - self._before) / self._elapsed
            self._velocity = 0.7 * self._velocity + 0.3 * moved

    def estimate(self) -> Estimate:
        """The current estimate."""
        mean = self._initial.mean.copy()
        mean[:2], mean[3:5], mean[5] = self._filter.kinematic_state, self._velocity, 0.0
        covariance = self._initial.covariance.copy()
        covariance[:2], covariance[:, :2] = 0.0, 0.0
        covariance[:2, :2] = np.asarray(self._filter.covariance)[self._count :, self._count :]
        covariance[2, 2] = max(covariance[2, 2], UNKNOWN_HEADING_STD**2)
        contour = np.asarray(self._filter.get_contour_points(self._tracker.contour_points))
        return mean, covariance, contour


class Ellipse:
    """An ellipse; the state is x, y and their rates, and the ellipse.

    It is uniformly filled, so its covariance is a quarter of the squared semi-axes.
    """

    def __init__(self, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters):
        from pyrecest.filters.factorized_giw_random_matrix_tracker import (
            FactorizedGIWRandomMatrixTracker,
        )
        from pyrecest.filters.ggiw_tracker import GGIWTracker
        from pyrecest.filters.mem_ekf_star_tracker import MEMEKFStarTracker
        from pyrecest.filters.mem_qkf_tracker import MEMQKFTracker
        from pyrecest.filters.vbrm_tracker import VBRMTracker

        self._tracker, self._name = tracker, tracker.name
        start = (initial.mean[MOVING].copy(), initial.covariance[np.ix_(MOVING, MOVING)])
        heading, heading_variance = float(initial.mean[2]), float(initial.covariance[2, 2])
        axes = 0.5 * np.array([prior.length, prior.width])
        variance = prior.sigma_f**2 + prior.sigma_r**2
        oriented = np.array([heading, *axes])
        turn = rotation(heading)
        extent = turn @ np.diag(axes**2 / 4.0) @ turn.T
        weight = 6.0 + EXTENT_WEIGHT
        self._heading = heading
        if self._name in ("mem_qkf", "mem_ekf_star"):
            kind = MEMQKFTracker if self._name == "mem_qkf" else MEMEKFStarTracker
            shape = np.diag([heading_variance, variance, variance])
            self._filter: Any = kind(*start, oriented, shape, measurement_matrix=PLACE)
        elif self._name == "vbrm":
            self._filter = VBRMTracker(*start, oriented, heading_variance, measurement_matrix=PLACE)
        elif self._name == "ggiw":
            self._filter = GGIWTracker(*start, extent, weight, 10.0, 1.0, PLACE)
        else:
            scale = EXTENT_WEIGHT * extent
            self._filter = FactorizedGIWRandomMatrixTracker(*start, weight, scale, PLACE)

    def predict(self, interval: float) -> None:
        """Move the state by `interval` s."""
        chosen, tracker = np.ix_(MOVING, MOVING), self._tracker
        matrix = transition(interval)[chosen]
        noise = process_noise(interval, tracker.sigma_q, 0.0)[chosen] + 1e-12 * np.eye(4)
        turned = tracker.sigma_q_psi**2 * interval
        if self._name == "factorised_giw":
            self._filter.predict(interval, noise, system_matrix=matrix)
        elif self._name == "ggiw":
            self._filter.predict_linear(matrix, noise, extent_forgetting_factor=0.98)
        elif self._name == "vbrm":
            self._filter.predict_linear(matrix, noise, orientation_sys_noise=turned)
        else:
            shape_noise = np.diag([turned, 0.0, 0.0])
            self._filter.predict_linear(matrix, noise, shape_sys_noise=shape_noise)

    def update(self, points: np.ndarray, noises: np.ndarray) -> None:
        """Correct the state by points (n, 2) m with covariances (n, 2, 2) m²."""
        # Two points are read as columns.
        self._filter.update(points.T, PLACE, noises.mean(axis=0))
        if self._name == "mem_ekf_star":
            # Its update can make a semi-axis negative, which its prediction refuses.
            semi_axes = self._filter.shape_state[1:]
            self._filter.shape_state[1:] = np.maximum(np.abs(semi_axes), LEAST_AXIS)

    def estimate(self) -> Estimate:
        """The current estimate."""
        filter_ = self._filter
        values, spread = np.asarray(filter_.kinematic_state), np.asarray(filter_.covariance)
        if self._name in ("mem_qkf", "mem_ekf_star"):
            angle, *semi = np.asarray(filter_.shape_state)
            angle_variance = float(filter_.shape_covariance[0, 0])
        elif self._name == "vbrm":
            angle, *semi = np.asarray(filter_.get_point_estimate_shape())
            angle_variance = float(filter_.orientation_variance)
        else:
            roots, vectors = np.linalg.eigh(np.asarray(filter_.extent))
            semi = 2.0 * np.sqrt(np.maximum(roots[::-1], 0.0))
            angle, angle_variance = np.arctan2(*vectors[::-1, 1]), UNKNOWN_HEADING_STD**2
        mean = np.zeros(6)
        mean[MOVING], mean[2] = values, _forwards(float(angle), values[2:], self._heading)
        covariance = np.diag([0.0, 0.0, angle_variance, 0.0, 0.0, self._tracker.sigma_q_psi**2])
        covariance[np.ix_(MOVING, MOVING)] = spread
        # Counter-clockwise; the first axis is along the heading.
        angles, _ = contour_directions(mean[2:3], self._tracker.contour_points)
        points = np.stack([np.cos(angles), np.sin(angles)], axis=1) * np.abs(semi)
        return mean, covariance, mean[:2] + points @ rotation(mean[2]).T


def _forwards(angle: float, velocity: np.ndarray, heading: float) -> float:
    """The direction of an axis that points forwards; an ellipse does not know which one does."""
    moving = np.hypot(*velocity) > 0.3
    towards = np.arctan2(velocity[1], velocity[0]) if moving else heading
    back = abs(float(wrap_angle(angle - towards))) > 0.5 * np.pi
    return angle + (np.pi if back else 0.0)
