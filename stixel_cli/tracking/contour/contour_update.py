"""The update of the tracker `contour`: rays on the class's shape; see `contour_filter.py`."""

import numpy as np

from stixel_cli.tracking.association import uncut
from stixel_cli.tracking.consider import NODES, JointCovariance, field_weights
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import (
    Rays,
    Sight,
    gate_widths,
    sampling_inset,
)
from stixel_cli.tracking.contour.ray_kernels import iterated
from stixel_cli.tracking.kalman import condition

SEEN = np.array([0, 1, 2, 5, 6])
"""Indices of the states that a ray sees: the pose and the two sizes."""

SHAPE_ERRORS = NODES + 2
"""Number of considered errors of the visible shape: of the field over the outline, and of the two
ends. Those of the sensor and of the size follow."""

SHARED = {"stixels": 1.0, "fabricated": 0.3, "lidar": 0.3, "file": 0.3, "own": 0.3}
FINE = 0.2
"""Shares of the visible shape's variance: what neighbouring rays and scans of each kind of sensor
have in common, and what each point has of its own."""

MISS_STD = 0.05
"""A ray with a point of the target should meet its shape: standard deviation, m."""

CLUTTER = 3.0
"""Log odds against a ray that passes by the shape, at most: then its point is clutter."""

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
    count = len(rays.ranges)
    ends = np.array([np.argmin(rays.bearings), np.argmax(rays.bearings)])
    inset, inset_variance = sampling_inset(rays, sight)
    inset_variance = inset_variance + (np.radians(tracker.silhouette_std) * rays.ranges[ends]) ** 2
    silhouettes = uncut(rays.bearings[ends], rays.ranges[ends], rays.field_of_view)
    # A single ray does not show where an outline begins or ends.
    silhouettes &= ~np.array(rays.hidden) & (count > 1 or not sight.outline)
    rows = np.concatenate([np.ones(count, bool), silhouettes])
    ranges, no_miss = (sight.std_factor * rays.stds) ** 2, np.zeros(count)
    miss_variances = MISS_STD**2 + tracker.offset_std**2 + rays.across_variances
    # What is not measured has no precision.
    of_ends = np.where(silhouettes, tracker.silhouette_factor**2 * inset_variance, np.inf)
    of_misses = tracker.shape_factor**2 * miss_variances if sight.residual else no_miss + np.inf
    factors = np.full(count + 2, tracker.shape_factor**2)
    factors[count:] = tracker.silhouette_factor**2
    measured = rays.ranges - sight.bias_per_std * rays.stds, [-inset, -inset], no_miss
    first = mean if first_iterate is None else first_iterate
    iterate, posterior, matrix, innovation, errors, noise, values, stds, angles = iterated(
        *(mean, np.ascontiguousarray(covariance), first),
        *(tracker.iterations, float(tracker.degrees_of_freedom), np.concatenate(measured)),
        np.concatenate([tracker.noise_factor**2 * ranges, of_ends, of_misses]),
        *(factors, rays.across_variances + tracker.offset_std**2, sight.residual is not None),
        *(rays.sensor, rays.directions, rays.ranges, ends, sight.half, sight.table.arrays),
        *((sight.far or sight.table).arrays, sight.far is not None),
    )
    across = (matrix[:count, :2] * rays.normals).sum(axis=1)
    grazing = across**2 * rays.across_variances
    shape = stds**2 + np.append((across * tracker.offset_std) ** 2, [0.0, 0.0])
    # What the errors really are, as far as the model knows them; a miss is a penalty of the gain.
    own = np.concatenate([ranges + grazing, inset_variance + rays.across_variances[ends]])
    own += FINE * shape
    whole = np.zeros((len(matrix), len(joint.matrix)))
    whole[:, : len(mean)] = matrix
    shared = whole[: count + 2, len(mean) :]
    shared[:count, :NODES] = field_weights(angles)
    shared[[count, count + 1], [NODES, NODES + 1]] = 1.0
    shared *= np.sqrt(SHARED[tracker.seen_by] * shape)[:, None]
    # To move a point changes the innovation as to move the target does, on oblique faces, too.
    moves = np.concatenate([rays.shared, rays.shared[ends]])
    of_sensor = slice(SHAPE_ERRORS, SHAPE_ERRORS + moves.shape[2])
    shared[:, of_sensor] = np.einsum("ni,nim->nm", matrix[: count + 2, :2], moves)
    own /= _weights(errors[: count + 2], own + (shared**2).sum(axis=1), tracker)
    rows = np.flatnonzero(rows)
    _, _, nis, likelihood = condition(joint.matrix, whole[rows], own[rows], innovation[rows])
    likelihood += np.log(gate_widths(rays, tracker)).sum()
    missed = np.maximum(values[count + 2 :], 0.0) ** 2
    missed = np.minimum(0.5 * missed / (MISS_STD**2 + rays.across_variances), CLUTTER).sum()
    joint = joint.copy()
    joint.correct(posterior @ (matrix.T / noise), whole, np.concatenate([own, miss_variances]))
    return iterate, posterior, joint, nis, len(rows), float(missed), likelihood


def constant_errors(joint: JointCovariance) -> np.ndarray:
    """How far m errors that stay, of the sensor and of the class's size, move a state: (d, m)."""
    return joint.matrix[: joint.size, joint.size + SHAPE_ERRORS :]


def _weights(errors: np.ndarray, variances: np.ndarray, tracker: ContourParameters) -> np.ndarray:
    """Weights (n,) ≤ 1 of errors with a Student distribution, see `contour_filter.py`."""
    freedom = tracker.degrees_of_freedom
    return np.minimum((freedom + 1.0) / (freedom + errors**2 / variances), 1.0)
