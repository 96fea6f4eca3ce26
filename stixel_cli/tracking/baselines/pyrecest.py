"""The extended trackers of PyRecEst (https://github.com/FlorianPfaff/PyRecEst) on the same scans.

This module gives them the class's prior, the initial state and the scans' noise, and turns their
estimates into a `Track`. What they do is documented there. Three things differ from their defaults:
the first shape is that of the class; a scan's points are always passed in the layout that the
tracker cannot mistake, also if there are two; and an ellipse's contour is drawn by its semi-axes.
"""

from types import ModuleType
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.kalman import PLACE
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.motion import MOVING, process_noise, transition
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import InitialState, Track, contour_directions, directions_of

Name = Literal[
    "full_scgp",
    "decorrelated_scgp",
    "ekf_spline",
    "fourier_rhm",
    "mem_qkf",
    "mem_ekf_star",
    "vbrm",
    "ggiw",
    "factorised_giw",
]


@parameters
class PyRecEstParameters:
    """An extended tracker of PyRecEst, an extra of `stixel`: `pip install 'stixel[peers]'`.

    Attributes:
        name: of the tracker. Those from `mem_qkf` on estimate an ellipse.
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        sigma_q_psi: the same of the heading, rad/s^1.5.
        measurement_std: m, along each axis, added to the covariance of each point of the scan:
            errors that neighbouring points share.
        basis_points: of the Gaussian process, and control points of the spline.
        gate_probability: chi-square probability of the association's gate; null takes every point.
    """

    kind: Literal["pyrecest"]
    name: Name
    sigma_q: Annotated[float, Ge(0), Le(100)]
    sigma_q_psi: Annotated[float, Ge(0), Le(100)]
    measurement_std: Annotated[float, Ge(0), Le(10)]
    basis_points: Annotated[int, Ge(4), Le(200)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None
    harmonics: ClassVar[int] = 4
    """Of the Fourier series of `fourier_rhm`: more bend between the points of one visible side."""
    contour_points: ClassVar[int] = 72
    """Number M of points of the contour that is reported: no estimate depends on it."""


EXTENT_WEIGHT = 10.0
"""Degrees of freedom above the least with which the class's size counts."""

LEAST_AXIS = 0.05
"""Least semi-axis of an ellipse, m."""

UNKNOWN_HEADING_STD = 0.3
"""Of a tracker that does not estimate it, rad."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan.

    The std of the contour is the class's, and there is no NIS: the trackers give neither alike.

    Raises:
        UserError: if PyRecEst is not installed.
        ValueError: if it fails, such as after a gap of days.
    """
    kinds = dict.fromkeys(("full_scgp", "decorrelated_scgp", "ekf_spline"), _StarConvex)
    kind = (kinds | {"fourier_rhm": _FourierSeries}).get(tracker.name, _Ellipse)
    adapted = kind(initial, prior, tracker)
    size = np.diag([prior.length**2, prior.width**2]) / 12.0
    added, least = tracker.measurement_std**2 * np.eye(2), 1
    if tracker.name == "factorised_giw":
        # It takes the noise off the points' scatter, which errors that they share do not widen.
        added, least = np.zeros((2, 2)), 3
    contours, filtered = [], Filtered(scans, 6)
    try:
        for scan in filtered:
            adapted.predict(float(scan.interval))
            mean, covariance, contour = adapted.estimate()
            turn, noises = rotation(mean[2]), scan.covariances + added
            spread = covariance[:2, :2] + turn @ size @ turn.T + noises
            near = associate(scan.points, mean[:2], spread, tracker.gate_probability)
            near = near if len(near) >= least else near[:0]
            if len(near):
                adapted.update(scan.points[near], noises[near])
                mean, covariance, contour = adapted.estimate()
            filtered.add(mean, covariance, near, degrees=0)
            contours.append(contour)
    except np.linalg.LinAlgError as error:
        raise ValueError(f"{tracker.name} of PyRecEst failed at scan {scan.k}: {error}") from error
    means, covariances = filtered.states
    means[:, 2], contours = np.unwrap(means[:, 2]), np.array(contours)
    std = np.full(contours.shape[:2], np.hypot(prior.sigma_f, prior.sigma_r))
    return filtered.track((contours, directions_of(contours, means), std), (means, covariances))


def _filters() -> ModuleType:
    """The module of PyRecEst that has the filters."""
    try:
        # Without the first, the module of the Fourier series cannot be imported.
        import pyrecest.distributions
        import pyrecest.filters
    except ImportError as error:
        raise UserError(
            f"tracker=pyrecest: PyRecEst is not installed ({error}): pip install 'stixel[peers]'"
        ) from None
    return pyrecest.filters


# Each of the following predicts by an interval in s, updates by points (n, 2) m with covariances
# (n, 2, 2) m², and has an estimate: mean (6,) and covariance (6, 6) of the six states, and the
# contour (M, 2) m in the world.


class _StarConvex:
    """A shape in the target's frame; the state: x, y, heading, speed, turn rate, and the shape."""

    def __init__(self, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters):
        filters = _filters()
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
            share = np.hypot(prior.sigma_f, prior.sigma_r) / radii.mean()
            with_scale = share**2 * np.eye(7)
            with_scale[:5, :5] = covariance
            self._filter = filters.EKFSplineTracker(
                control_points=radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1),
                kinematic_state=state,
                scale_state=np.ones(2),
                covariance=with_scale,
            )
        else:
            full = tracker.name == "full_scgp"
            kind = filters.FullSCGPTracker if full else filters.DecorrelatedSCGPTracker
            self._filter = kind(
                tracker.basis_points,
                kinematic_state=state,
                kinematic_covariance=covariance,
                shape_state=radii,
                reference_extent=radii,
                kernel_params=(prior.sigma_f**2 + prior.sigma_r**2, np.pi / 4),
            )

    def predict(self, interval: float) -> None:
        variances = self._tracker.sigma_q**2, self._tracker.sigma_q_psi**2
        noise = np.zeros((7, 7)) if self._is_spline else np.zeros((5, 5))
        noise[[3, 4], [3, 4]] = np.array(variances) * interval
        self._filter.predict(interval, noise)

    def update(self, points: np.ndarray, noises: np.ndarray) -> None:
        # Two points are read as rows. Only the Gaussian processes take one covariance a point.
        self._filter.update(points, R=noises.mean(axis=0) if self._is_spline else noises)

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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


class _FourierSeries:
    """A shape in the world's frame, and x, y: it has no velocity, which this class adds.

    The position moves by the smoothed differences of the last positions. The heading is that of
    the initial state.
    """

    def __init__(self, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters):
        angles = 2.0 * np.pi * np.arange(256) / 256
        radii = prior_radii(prior, angles - initial.mean[2])
        series = 2.0 * np.fft.rfft(radii)[: tracker.harmonics + 1] / len(radii)
        waves = np.stack([series.real, -series.imag], axis=1)[1:]
        self._filter = _filters().FourierRHMTracker(
            tracker.harmonics,
            fourier_coefficients=np.array([series[0].real, *waves.ravel()]),
            kinematic_state=initial.mean[:2],
            coefficient_covariance=prior.sigma_f**2 + prior.sigma_r**2,
            kinematic_covariance=initial.covariance[:2, :2],
            # Measured points are on the contour, not inside.
            scale_mean=1.0,
            scale_variance=1e-3,
        )
        self._initial, self._tracker = initial, tracker
        self._velocity, self._before = initial.mean[3:5].copy(), initial.mean[:2].copy()
        self._elapsed = 1.0

    def predict(self, interval: float) -> None:
        self._before = np.asarray(self._filter.kinematic_state).copy()
        self._elapsed = interval
        count = len(self._filter.covariance)
        noise, moved = np.zeros((count, count)), np.zeros(count)
        drift = self._initial.covariance[3:5, 3:5] * interval**2
        noise[-2:, -2:] = drift + self._tracker.sigma_q**2 * interval**3 * np.eye(2)
        moved[-2:] = interval * self._velocity
        self._filter.predict_linear(np.eye(count), sys_noise=noise, inputs=moved)

    def update(self, points: np.ndarray, noises: np.ndarray) -> None:
        self._filter.update(points.T, noises.mean(axis=0))
        if self._elapsed > 0.0:
            moved = (np.asarray(self._filter.kinematic_state) - self._before) / self._elapsed
            self._velocity = 0.7 * self._velocity + 0.3 * moved

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        mean = self._initial.mean.copy()
        mean[:2], mean[3:5], mean[5] = self._filter.kinematic_state, self._velocity, 0.0
        covariance = self._initial.covariance.copy()
        covariance[:2], covariance[:, :2] = 0.0, 0.0
        covariance[:2, :2] = np.asarray(self._filter.covariance)[-2:, -2:]
        covariance[2, 2] = max(covariance[2, 2], UNKNOWN_HEADING_STD**2)
        contour = np.asarray(self._filter.get_contour_points(self._tracker.contour_points))
        return mean, covariance, contour


class _Ellipse:
    """An ellipse; the state is x, y and their rates, and the ellipse.

    It is uniformly filled, so its covariance is a quarter of the squared semi-axes.
    """

    def __init__(self, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters):
        filters = _filters()
        self._tracker, self._name = tracker, tracker.name
        self._heading, heading_variance = float(initial.mean[2]), float(initial.covariance[2, 2])
        axes = 0.5 * np.array([prior.length, prior.width])
        variance = prior.sigma_f**2 + prior.sigma_r**2
        oriented = np.array([self._heading, *axes])
        spread = np.diag([heading_variance, variance, variance])
        turn = rotation(self._heading)
        extent = turn @ np.diag(axes**2 / 4.0) @ turn.T
        weight = 6.0 + EXTENT_WEIGHT
        kind, *shape = {
            "mem_qkf": (filters.MEMQKFTracker, oriented, spread),
            "mem_ekf_star": (filters.MEMEKFStarTracker, oriented, spread),
            "vbrm": (filters.VBRMTracker, oriented, heading_variance, 10.0, None),
            "ggiw": (filters.GGIWTracker, extent, weight, 10.0, 1.0),
            "factorised_giw": (filters.FactorizedGIWRMTracker, weight, EXTENT_WEIGHT * extent),
        }[self._name]
        start = initial.mean[MOVING].copy(), initial.covariance[np.ix_(MOVING, MOVING)]
        self._filter = kind(*start, *shape, PLACE)

    def predict(self, interval: float) -> None:
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
        # Two points are read as columns.
        self._filter.update(points.T, PLACE, noises.mean(axis=0))
        if self._name == "mem_ekf_star":
            # Its update can make a semi-axis negative, which its prediction refuses.
            semi_axes = self._filter.shape_state[1:]
            self._filter.shape_state[1:] = np.maximum(np.abs(semi_axes), LEAST_AXIS)

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        filter_ = self._filter
        values, spread = np.asarray(filter_.kinematic_state), np.asarray(filter_.covariance)
        if self._name in ("ggiw", "factorised_giw"):
            roots, vectors = np.linalg.eigh(np.asarray(filter_.extent))
            semi = 2.0 * np.sqrt(np.maximum(roots[::-1], 0.0))
            angle, angle_variance = np.arctan2(*vectors[::-1, 1]), UNKNOWN_HEADING_STD**2
        else:
            angle, *semi = np.asarray(filter_.get_point_estimate_shape())
            of_vbrm = self._name == "vbrm"
            angle_variance = (
                filter_.orientation_variance if of_vbrm else filter_.shape_covariance[0, 0]
            )
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
