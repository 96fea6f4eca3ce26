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
from stixel_cli.geometry.pose import rotation, world_from_target
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.baselines.rectangle_contour import LEAST_SIZE, rectangle_states, shape_of
from stixel_cli.tracking.kalman import PLACE
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.motion import MOVING, process_noise, transition
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import InitialState, Track, contour_directions

STAR_CONVEX = ("full_scgp", "decorrelated_scgp", "ekf_spline")
ELLIPSES = ("mem_qkf", "mem_ekf_star", "vbrm", "ggiw", "factorised_giw")
Name = Literal[(*STAR_CONVEX, *ELLIPSES)]


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


LEAST_DEGREES = 6.0
"""An inverse Wishart density of matrices (2, 2) has a mean with more degrees of freedom."""

EXTENT_WEIGHT = 10.0
"""Points, or degrees of freedom above the least, as which the class's size counts: the default of
PyRecEst's `vbrm`."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan.

    The std of the contour is the class's, and there is no NIS: the trackers give neither alike.

    Raises:
        UserError: if PyRecEst is not installed.
        ValueError: if it fails, such as after a gap of days.
    """
    kind = _Ellipse if tracker.name in ELLIPSES else _StarConvex
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
            mean, covariance = adapted.estimate()
            turn, noises = rotation(mean[2]), scan.covariances + added
            spread = covariance[:2, :2] + turn @ size @ turn.T + noises
            near = associate(scan.points, mean[:2], spread)
            near = near if len(near) >= least else near[:0]
            if len(near):
                adapted.update(scan.points[near], noises[near])
                mean, covariance = adapted.estimate()
            filtered.add(mean[:6], covariance[:6, :6], near, degrees=0)
            contours.append(adapted.contour())
    except np.linalg.LinAlgError as error:
        raise ValueError(f"{tracker.name} of PyRecEst failed at scan {scan.k}: {error}") from error
    means, covariances = filtered.states
    means[:, 2], contours = np.unwrap(means[:, 2]), np.array(contours)
    std = np.full(contours.shape[:2], np.hypot(prior.sigma_f, prior.sigma_r))
    return filtered.track((contours, std), (means, covariances))


def _filters() -> ModuleType:
    """The module of PyRecEst that has the filters."""
    needs = "tracker=pyrecest needs PyRecEst: pip install 'stixel[peers]'"
    with located(needs, caught=ImportError):
        import pyrecest.filters
    return pyrecest.filters


class _StarConvex:
    """A shape in the target's frame; the state: x, y, heading, speed, turn rate, and the shape.

    Like `_Ellipse`, it predicts by an interval in s, and updates by points (n, 2) m with
    covariances (n, 2, 2) m². Its estimate is a mean and a covariance whose first six states are
    those of a track, its contour (M, 2) m in the world.
    """

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

    def contour(self) -> np.ndarray:
        return np.asarray(self._filter.get_contour_points(120))


def _along(heading: float) -> np.ndarray:
    """(6, 5): six states as a function of x, y, heading, speed along it, and turn rate."""
    matrix = np.eye(6)[:, [0, 1, 2, 3, 5]]
    matrix[3:5, 3] = np.cos(heading), np.sin(heading)
    return matrix


class _Ellipse:
    """An ellipse; the state is x, y and their rates, and the ellipse.

    It is uniformly filled, so its covariance is a quarter of the squared semi-axes.
    """

    def __init__(self, initial: InitialState, prior: PriorShape, tracker: PyRecEstParameters):
        filters, self._tracker = _filters(), tracker
        self._heading, heading_variance = float(initial.mean[2]), float(initial.covariance[2, 2])
        axes = 0.5 * np.array([prior.length, prior.width])
        variance = prior.sigma_f**2 + prior.sigma_r**2
        oriented = np.array([self._heading, *axes])
        spread = np.diag([heading_variance, variance, variance])
        turn = rotation(self._heading)
        extent = turn @ np.diag(axes**2 / 4.0) @ turn.T
        weight = LEAST_DEGREES + EXTENT_WEIGHT
        kind, *shape = {
            "mem_qkf": (filters.MEMQKFTracker, oriented, spread),
            "mem_ekf_star": (filters.MEMEKFStarTracker, oriented, spread),
            "vbrm": (filters.VBRMTracker, oriented, heading_variance, EXTENT_WEIGHT, None),
            "ggiw": (filters.GGIWTracker, extent, weight, 10.0, 1.0),
            "factorised_giw": (filters.FactorizedGIWRMTracker, weight, EXTENT_WEIGHT * extent),
        }[tracker.name]
        start = initial.mean[MOVING].copy(), initial.covariance[np.ix_(MOVING, MOVING)]
        self._filter = kind(*start, *shape, PLACE)

    def predict(self, interval: float) -> None:
        chosen, tracker = np.ix_(MOVING, MOVING), self._tracker
        matrix, self._interval = transition(interval)[chosen], interval
        noise = process_noise(interval, tracker.sigma_q, 0.0)[chosen] + 1e-12 * np.eye(4)
        turned = tracker.sigma_q_psi**2 * interval
        if tracker.name == "factorised_giw":
            self._filter.predict(interval, noise, system_matrix=matrix)
            return
        of_shape = {
            "ggiw": {"extent_forgetting_factor": 0.98},
            "vbrm": {"orientation_sys_noise": turned},
        }.get(tracker.name, {"shape_sys_noise": np.diag([turned, 0.0, 0.0])})
        self._filter.predict_linear(matrix, noise, **of_shape)

    def update(self, points: np.ndarray, noises: np.ndarray) -> None:
        # Two points are read as columns.
        self._filter.update(points.T, PLACE, noises.mean(axis=0))
        if self._tracker.name == "mem_ekf_star":
            # Its update can make a semi-axis negative, which its prediction refuses.
            semi_axes = np.abs(self._filter.shape_state[1:])
            self._filter.shape_state[1:] = np.maximum(semi_axes, 0.5 * LEAST_SIZE)

    def _shape(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (3,) and covariance (3, 3) of the first axis's angle, rad, and the semi-axes, m."""
        estimate, name = self._filter, self._tracker.name
        if name in ("ggiw", "factorised_giw"):
            degrees = "extent_degrees_of_freedom" if name == "ggiw" else "extent_dof"
            return shape_of(4.0 * estimate.extent, getattr(estimate, degrees) - LEAST_DEGREES)
        mean = estimate.get_point_estimate_shape()
        if name == "vbrm":
            return mean, np.diag([estimate.orientation_variance, 0.0, 0.0])
        return mean, estimate.shape_covariance

    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        moving = self._filter.kinematic_state, self._filter.covariance
        motion = self._heading, self._interval, self._tracker.sigma_q
        states = rectangle_states(moving, self._shape(), *motion)
        self._heading = states[0][2]
        return states

    def contour(self) -> np.ndarray:
        # Counter-clockwise; the first axis is along the heading.
        mean, _ = self.estimate()
        _, (circle,) = contour_directions(np.zeros(1))
        return world_from_target(0.5 * mean[6:] * circle, mean[:3])
