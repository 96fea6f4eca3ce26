"""The update of the tracker `contour`: rays on the class's shape; see `contour_filter.py`."""

from copy import deepcopy
from typing import NamedTuple

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.association import uncut
from stixel_cli.tracking.consider import FIELD_NODES, JointCovariance, field_weights
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import (
    Rays,
    Sight,
    gate_widths,
    sampling_inset,
)
from stixel_cli.tracking.contour.ray_table import expected
from stixel_cli.tracking.kalman import condition, correct

SEEN = np.array([0, 1, 2, 5, 6])
"""Indices of the states that a ray sees: the pose and the two sizes."""

SHAPE_ERRORS = FIELD_NODES + 2
"""Number of considered errors of the visible shape: of the field over the outline, and of the two
ends. Those of the sensor and of the size follow."""

SHARED = {"stixels": 1.0, "fabricated": 0.3, "lidar": 0.3, "file": 0.3, "own": 0.3}
FINE = 0.2
"""Shares of the visible shape's variance: what neighbouring rays and scans of each kind of sensor
have in common, and what each point has of its own."""

CAP = 0.5
"""Of half the length or the width: a change of the size moves what is nearer to an end by as much
as the end. From 0.5 to 0.8 gains as much at home; 1, a scaled shape, shrinks real cars whose front
is rounder than the class's."""

LEAST_STEP = np.array([0.02, 0.02, 0.01])
GREATEST_STEP = np.array([0.3, 0.3, 0.2])
"""Bounds of the steps of the central differences, in the units of the states seen."""

MISS_STD = 0.05
"""A ray with a point of the target should meet its shape: standard deviation, m."""

CLUTTER = 3.0
"""Log odds against a ray that passes by the shape, at most: then its point is clutter."""

SIZE_STEP = 0.3
"""Greatest change of a factor of the size in one iteration, relative: slopes are local."""

CONVERGED = 2e-3
"""The iteration ends when no state moves by more than this."""

Posterior = tuple[np.ndarray, np.ndarray, JointCovariance, float, int, float, float]
"""Mean, covariance of the gain, joint covariance, NIS, its degrees of freedom, log odds against the
rays that pass by the shape, log likelihood of all others."""


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    joint: JointCovariance,
    rays: Rays,
    sight: Sight,
    tracker: ContourParameters,
    first_iterate: np.ndarray | None = None,
) -> Posterior:
    """Posterior of a state (d,) with n > 0 rays.

    `covariance` (d, d) makes the gain. `joint` is that of the error which the state has with these
    gains, and of the errors that are considered; it is not changed. NIS and log
    likelihood are those of the innovation as the joint covariance has it, at the last iterate. The
    iteration begins at `first_iterate` (d,), by default at the prior's `mean`.
    """
    count, size = len(rays.ranges), len(mean)
    ends = np.array([np.argmin(rays.bearings), np.argmax(rays.bearings)])
    inset, inset_variance = sampling_inset(rays, sight)
    inset_variance = inset_variance + (np.radians(tracker.silhouette_std) * rays.ranges[ends]) ** 2
    silhouettes = uncut(rays.bearings[ends], rays.ranges[ends], rays.field_of_view)
    # A single ray does not show where an outline begins or ends.
    silhouettes &= ~np.array(rays.hidden) & (count > 1 or not sight.outline)
    rows = np.concatenate([np.ones(count, bool), silhouettes])
    posterior, iterate = covariance, mean if first_iterate is None else first_iterate
    for _ in range(tracker.iterations):
        linear = linearise(iterate, posterior, rays, *ends, sight)
        matrix, errors = _measured(iterate, linear, rays, ends, sight)
        errors[count:] -= inset
        # Where the ray grazes the shape, a small error across it is a large one of the range.
        across = (linear.slopes[:2, :count].T * rays.normals).sum(axis=1)
        grazing = across**2 * rays.across_variances
        offsets = (across * tracker.offset_std) ** 2
        shape = linear.stds**2 + np.append(offsets, [0.0, 0.0])
        ranges = (sight.std_factor * rays.stds) ** 2
        of_ranges = tracker.noise_factor**2 * ranges + grazing + offsets
        of_ranges += tracker.shape_factor**2 * linear.stds[:count] ** 2
        of_ends = tracker.silhouette_factor**2 * (shape[count:] + inset_variance)
        variances = np.concatenate([of_ranges, of_ends])
        if sight.residual:
            variances += linear.curvature_variances
        passing = linear.misses > 0.0 if sight.residual else np.zeros(count, bool)
        miss_matrix = np.zeros((passing.sum(), size))
        miss_matrix[:, SEEN] = linear.miss_slopes[:, passing].T
        miss_variances = MISS_STD**2 + tracker.offset_std**2 + rays.across_variances[passing]
        pulls = np.vstack([matrix[rows], miss_matrix])
        pull_errors = np.concatenate([errors[rows], -linear.misses[passing]])
        noise = np.concatenate([variances[rows], tracker.shape_factor**2 * miss_variances])
        noise /= _weights(pull_errors, noise, tracker)
        correction, posterior, _ = correct(
            covariance, pulls, noise, pull_errors + pulls @ (iterate - mean)
        )
        innovation = (errors + matrix @ (iterate - mean))[rows]
        moved = mean + correction
        moved[5:7] = np.clip(moved[5:7], iterate[5:7] - SIZE_STEP, iterate[5:7] + SIZE_STEP)
        change = np.abs(moved - iterate).max()
        iterate = moved
        if change < CONVERGED:
            break
    # What the errors really are, as far as the model knows them; a miss is a penalty of the gain.
    own = np.concatenate([ranges + grazing, inset_variance + rays.across_variances[ends]])
    own = (own + FINE * shape)[rows]
    shared = np.zeros((count + 2, len(joint.matrix) - size))
    angles = sight.angles(iterate, rays, linear.predicted[:count])
    shared[:count, :FIELD_NODES] = field_weights(
        np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    )
    shared[[count, count + 1], [FIELD_NODES, FIELD_NODES + 1]] = 1.0
    shared *= np.sqrt(SHARED[tracker.seen_by] * shape)[:, None]
    # To move a point changes the innovation as to move the target does, on oblique faces, too.
    moved = np.concatenate([rays.shared, rays.shared[ends]])
    of_sensor = slice(SHAPE_ERRORS, SHAPE_ERRORS + moved.shape[2])
    shared[:, of_sensor] = np.einsum("ni,nim->nm", matrix[:, :2], moved)
    shared = shared[rows]
    own /= _weights(errors[rows], own + (shared**2).sum(axis=1), tracker)
    whole = np.hstack([matrix[rows], shared])
    _, _, nis, likelihood = condition(joint.matrix, whole, own, innovation)
    likelihood += np.log(gate_widths(rays, tracker)).sum()
    missed = np.maximum(linear.misses, 0.0) ** 2 / (MISS_STD**2 + rays.across_variances)
    missed = np.minimum(0.5 * missed, CLUTTER).sum()
    misses = np.hstack([miss_matrix, np.zeros((len(miss_matrix), shared.shape[1]))])
    whole, gain = np.vstack([whole, misses]), posterior @ (pulls.T / noise)
    joint = deepcopy(joint)
    joint.correct(gain, whole, np.concatenate([own, miss_variances]))
    return iterate, posterior, joint, nis, len(own), float(missed), likelihood


def constant_errors(joint: JointCovariance) -> np.ndarray:
    """How far m errors that stay, of the sensor and of the class's size, move a state: (d, m)."""
    return joint.matrix[: joint.size, joint.size + SHAPE_ERRORS :]


def _weights(errors: np.ndarray, variances: np.ndarray, tracker: ContourParameters) -> np.ndarray:
    """Weights (n,) ≤ 1 of errors with a Student distribution, see `contour_filter.py`."""
    freedom = tracker.degrees_of_freedom
    return np.minimum((freedom + 1.0) / (freedom + errors**2 / variances), 1.0)


def _measured(
    state: np.ndarray, linear: "Linear", rays: Rays, ends: np.ndarray, sight: Sight
) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (n + 2, d) of ranges and insets by the state (d,); measured minus predicted (n + 2,).

    The insets' measured values are zero.
    """
    count = len(rays.ranges)
    matrix = np.zeros((count + 2, len(state)))
    matrix[:, SEEN] = linear.slopes.T
    errors = -linear.predicted
    if sight.residual:
        matrix[:, 7:] = sight.residual.slopes(
            state, rays.sensor[:2], rays.directions, linear.predicted[:count], ends
        )
        if sight.far:
            # The slopes are those of sides that face the sensor.
            matrix[:count, 7:] = 0.0
        errors -= matrix[:, 7:] @ state[7:]
    errors[:count] += rays.ranges - sight.bias_per_std * rays.stds
    return matrix, errors


class Linear(NamedTuple):
    """Predictions of n rays and of minus the two insets, and how they depend on the states seen.

    Attributes:
        predicted, stds: (n + 2,) m.
        slopes: (5, n + 2).
        curvature_variances: (n + 2,) m², of what the slopes leave out: that of a parabola over one
            standard deviation of each state (Nørgaard, Poulsen & Ravn 2000, *New developments in
            state estimation for nonlinear systems*).
        misses: (n,) m, how far the rays pass by the shape, negative inside; `miss_slopes` (5, n).
    """

    predicted: np.ndarray
    slopes: np.ndarray
    stds: np.ndarray
    curvature_variances: np.ndarray
    misses: np.ndarray
    miss_slopes: np.ndarray


def linearise(
    state: np.ndarray, covariance: np.ndarray, rays: Rays, first: int, last: int, sight: Sight
) -> Linear:
    """The measurements at a `state` (d,) with a `covariance` (d, d).

    The slopes are central differences along the target's axes, over about a standard deviation: so
    no frame of the world matters.
    """
    axes = np.eye(3)
    axes[:2, :2] = rotation(state[2])
    variances = np.diag(axes.T @ covariance[:3, :3] @ axes)
    steps = np.clip(np.sqrt(np.maximum(variances, 0.0)), LEAST_STEP, GREATEST_STEP)
    moved = np.repeat(state[None, SEEN], 7, axis=0)
    moved[1:4, :3] += (axes * steps).T
    moved[4:, :3] -= (axes * steps).T
    seen_from = moved, rays.sensor[:2], rays.directions
    ranges, insets, misses, range_stds, inset_stds = expected(
        *seen_from, first, last, *sight.table.arrays()
    )
    if sight.far:
        far = expected(*seen_from, -1, -1, *sight.far.arrays())[0]
        nearer = np.abs(rays.ranges - far[0]) < np.abs(rays.ranges - ranges[0])
        ranges = np.where(nearer, far, ranges)
    predicted = np.hstack([ranges, -insets])
    values = np.hstack([predicted, misses])
    slopes = np.zeros((5, values.shape[1]))
    slopes[:3] = (values[1:4] - values[4:]) / (2.0 * steps[:, None])
    # How far a change of the size moves the surface that each ray meets, along both axes.
    hits = rays.sensor[:2] + ranges[0][:, None] * rays.directions - state[:2]
    hits = hits @ axes[:2, :2]
    half = sight.half * np.exp(state[5:7])
    shifts = half * np.clip(hits / (CAP * half), -1.0, 1.0)
    order = np.concatenate([np.arange(len(hits)), [first, last], np.arange(len(hits))])
    slopes[3:] = slopes[:2] * shifts[order].T
    slopes[:3] = axes @ slopes[:3]
    second = predicted[1:4] + predicted[4:] - 2.0 * predicted[0]
    count = len(predicted[0])
    return Linear(
        predicted[0],
        slopes[:, :count],
        np.concatenate([range_stds, inset_stds]),
        0.5 * (second**2).sum(axis=0),
        misses[0],
        slopes[:, count:],
    )
