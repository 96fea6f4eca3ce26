"""The extended trackers of PyRecEst (https://github.com/FlorianPfaff/PyRecEst) on the same scans.

This module gives them the class's prior, the initial state and the scans' noise, and turns their
estimates into a `Track`. What they do is documented there. Three things differ from their defaults:
the first shape is that of the class; a scan's points are always passed in the layout that the
tracker cannot mistake, also if there are two; and an ellipse's contour is drawn by its semi-axes.
"""

from types import ModuleType
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from stixel_cli.errors import located
from stixel_cli.geometry.pose import rotation, world_from_target, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.kalman import PLACE
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.motion import MOVING, process_noise, transition
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import InitialState, Track, contour_directions, directions_of

STAR_CONVEX = ("full_scgp", "decorrelated_scgp", "ekf_spline")
ELLIPSES = ("mem_qkf", "mem_ekf_star", "vbrm", "ggiw", "factorised_giw")
Name = Literal[(*STAR_CONVEX, "fourier_rhm", *ELLIPSES)]


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
    """

    kind: Literal["pyrecest"]
    name: Name
    sigma_q: Annotated[float, Ge(0), Le(100)]
    sigma_q_psi: Annotated[float, Ge(0), Le(100)]
    measurement_std: Annotated[float, Ge(0), Le(10)]
    basis_points: Annotated[int, Ge(4), Le(200)]


HARMONICS = 4
"""Of the Fourier series of `fourier_rhm`: more bend between the points of one visible side."""

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
    kinds = dict.fromkeys(STAR_CONVEX, _StarConvex) | dict.fromkeys(ELLIPSES, _Ellipse)
    adapted = kinds.get(tracker.name, _FourierSeries)(initial, prior, tracker)
    size = np.diag([prior.length**2, prior.width**2]) / 12.0
    added, least = tracker.measurement_std**2 * np.eye(2), 1
    if tracker.name == "factorised_giw":
        # It takes the noise off the points' scatter, which errors that they share do not widen.
        added, least = np.zeros((2, 2)), 3
    contours, filtered = [], Filtered(scans, 6)
    try:
        for scan in filtered:
            adapted.predict(float(scan.interval))
            mean, covariance = adapted.estimate()
            turn, noises = rotation(mean[2]), scan.covariances + added
            spread = covariance[:2, :2] + turn @ size @ turn.T + noises
            near = associate(scan.points, mean[:2], spread)
            near = near if len(near) >= least else near[:0]
            if len(near):
                adapted.update(scan.points[near], noises[near])
                mean, covariance = adapted.estimate()
            filtered.add(mean, covariance, near, degrees=0)
            contours.append(adapted.contour())
    except np.linalg.LinAlgError as error:
        raise ValueError(f"{tracker.name} of PyRecEst failed at scan {scan.k}: {error}") from error
    means, covariances = filtered.states
    means[:, 2], contours = np.unwrap(means[:, 2]), np.array(contours)
    std = np.full(contours.shape[:2], np.hypot(prior.sigma_f, prior.sigma_r))
    return filtered.track((contours, directions_of(contours, means), std), (means, covariances))


def _filters() -> ModuleType:
    """The module of PyRecEst that has the filters."""
    needs = "tracker=pyrecest needs PyRecEst: pip install 'stixel[peers]'"
    with located(needs, caught=ImportError):
        # Without the first, the module of the Fourier series cannot be imported.
        import pyrecest.distributions
        import pyrecest.filters
    return pyrecest.filters


class _Adapted:
    """A tracker: it predicts by an interval in s, and updates by points with covariances.

    They are (n, 2) m and (n, 2, 2) m². Its estimate is the mean (6,) and covariance (6, 6) of the
    six states, its contour (M, 2) m in the world.
    """

    def contour(self) -> np.ndarray:
        return np.asarray(self._filter.get_contour_points(120))


class _StarConvex(_Adapted):
    """A shape in the target's frame; the state: x, y, heading, speed, turn rate, and the shape."""

    def __init__(self, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters):
        filters, self._tracker = _filters(), tracker
        self._is_spline = tracker.name == "ekf_spline"
        along = _along(initial.mean[2])
        state, covariance = along.T @ initial.mean, along.T @ initial.covariance @ along
        angles = 2.0 * np.pi * np.arange(tracker.basis_points) / tracker.basis_points
        radii = prior_radii(prior, angles)
        if self._is_spline:
            share = np.hypot(prior.sigma_f, prior.sigma_r) / radii.mean()
            outline = radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            with_scale = share**2 * np.eye(7)
            with_scale[:5, :5] = covariance
            self._filter = filters.EKFSplineTracker(outline, state, np.ones(2), with_scale)
            return
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
        variances = np.zeros(7 if self._is_spline else 5)
        variances[3:5] = self._tracker.sigma_q**2, self._tracker.sigma_q_psi**2
        self._filter.predict(interval, np.diag(variances * interval))

    def update(self, points: np.ndarray, noises: np.ndarray) -> None:
        # Two points are read as rows. Only the Gaussian processes take one covariance a point.
        self._filter.update(points, R=noises.mean(axis=0) if self._is_spline else noises)

    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        values, spread = self._filter.state[:5], self._filter.covariance[:5, :5]
        matrix = _along(values[2])
        mean = matrix @ values
        matrix[3:5, 2] = -mean[4], mean[3]
        return mean, matrix @ spread @ matrix.T


def _along(heading: float) -> np.ndarray:
    """(6, 5): six states as a function of x, y, heading, speed along it, and turn rate."""
    matrix = np.eye(6)[:, [0, 1, 2, 3, 5]]
    matrix[3:5, 3] = np.cos(heading), np.sin(heading)
    return matrix


class _FourierSeries(_Adapted):
    """A shape in the world's frame, and x, y: it has no velocity, which this class adds.

    The position moves by the smoothed differences of the last positions. The heading is that of
    the initial state.
    """

    def __init__(self, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters):
        angles = 2.0 * np.pi * np.arange(256) / 256
        series = np.fft.rfft(prior_radii(prior, angles - initial.mean[2]))[: HARMONICS + 1] / 128
        waves = np.stack([series.real, -series.imag], axis=1)[1:]
        self._filter = _filters().FourierRHMTracker(
            HARMONICS,
            fourier_coefficients=np.array([series[0].real, *waves.ravel()]),
            kinematic_state=initial.mean[:2],
            coefficient_covariance=prior.sigma_f**2 + prior.sigma_r**2,
            kinematic_covariance=initial.covariance[:2, :2],
            # Measured points are on the contour, not inside.
            scale_mean=1.0,
            scale_variance=1e-3,
        )
        self._initial, self._tracker = initial, tracker
        self._velocity = initial.mean[3:5]

    def predict(self, interval: float) -> None:
        self._before, self._elapsed = self._filter.kinematic_state.copy(), interval
        count = len(self._filter.covariance)
        noise, moved = np.zeros((count, count)), np.zeros(count)
        drift = self._initial.covariance[3:5, 3:5] * interval**2
        noise[-2:, -2:] = drift + self._tracker.sigma_q**2 * interval**3 * np.eye(2)
        moved[-2:] = interval * self._velocity
        self._filter.predict_linear(np.eye(count), sys_noise=noise, inputs=moved)

    def update(self, points: np.ndarray, noises: np.ndarray) -> None:
        self._filter.update(points.T, noises.mean(axis=0))
        if self._elapsed > 0.0:
            moved = (self._filter.kinematic_state - self._before) / self._elapsed
            self._velocity = 0.7 * self._velocity + 0.3 * moved

    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        heading, covariance = self._initial.mean[2], self._initial.covariance.copy()
        covariance[:2, 2:], covariance[2:, :2] = 0.0, 0.0
        covariance[:2, :2] = self._filter.covariance[-2:, -2:]
        covariance[2, 2] = max(covariance[2, 2], UNKNOWN_HEADING_STD**2)
        mean = np.array([*self._filter.kinematic_state, heading, *self._velocity, 0.0])
        return mean, covariance


class _Ellipse(_Adapted):
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
            return
        of_shape = {
            "ggiw": {"extent_forgetting_factor": 0.98},
            "vbrm": {"orientation_sys_noise": turned},
        }.get(self._name, {"shape_sys_noise": np.diag([turned, 0.0, 0.0])})
        self._filter.predict_linear(matrix, noise, **of_shape)

    def update(self, points: np.ndarray, noises: np.ndarray) -> None:
        # Two points are read as columns.
        self._filter.update(points.T, PLACE, noises.mean(axis=0))
        if self._name == "mem_ekf_star":
            # Its update can make a semi-axis negative, which its prediction refuses.
            semi_axes = self._filter.shape_state[1:]
            self._filter.shape_state[1:] = np.maximum(np.abs(semi_axes), LEAST_AXIS)

    def _oriented(self) -> tuple[float, float, np.ndarray]:
        """Direction of the first axis, rad, its variance, rad², and the semi-axes (2,) m."""
        filter_ = self._filter
        if self._name in ("ggiw", "factorised_giw"):
            roots, vectors = np.linalg.eigh(filter_.extent)
            semi_axes = 2.0 * np.sqrt(np.maximum(roots[::-1], 0.0))
            return np.arctan2(*vectors[::-1, 1]), UNKNOWN_HEADING_STD**2, semi_axes
        of_vbrm, (angle, *semi) = self._name == "vbrm", filter_.get_point_estimate_shape()
        variance = filter_.orientation_variance if of_vbrm else filter_.shape_covariance[0, 0]
        return float(angle), variance, np.abs(semi)

    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        angle, variance, _ = self._oriented()
        mean, velocity = np.zeros(6), self._filter.kinematic_state[2:]
        # An ellipse does not know which end of its axis is the front.
        moving = np.hypot(*velocity) > 0.3
        towards = np.arctan2(velocity[1], velocity[0]) if moving else self._heading
        back = abs(float(wrap_angle(angle - towards))) > 0.5 * np.pi
        mean[MOVING], mean[2] = self._filter.kinematic_state, angle + (np.pi if back else 0.0)
        covariance = np.diag([0.0, 0.0, variance, 0.0, 0.0, self._tracker.sigma_q_psi**2])
        covariance[np.ix_(MOVING, MOVING)] = self._filter.covariance
        return mean, covariance

    def contour(self) -> np.ndarray:
        # Counter-clockwise; the first axis is along the heading.
        angles, _ = contour_directions(np.zeros(1))
        points = np.stack([np.cos(angles), np.sin(angles)], axis=1) * self._oriented()[2]
        return world_from_target(points, self.estimate()[0])
