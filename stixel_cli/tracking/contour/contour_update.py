"""The update of the tracker `contour`: rays on the class's shape; see `contour_filter.py`."""

from typing import NamedTuple

import numpy as np

from stixel_cli.tracking.association import uncut
from stixel_cli.tracking.consider import NODES, JointCovariance, field_weights, node_weights
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import (
    Rays,
    Sight,
    gate_widths,
    sampling_inset,
)
from stixel_cli.tracking.contour.ray_table import linearised
from stixel_cli.tracking.kalman import condition, correct

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

GREATEST_LONGER = 4.0
"""Where a ray grazes the shape, a residual changes the range by at most so many times as much."""

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
    ranges = (sight.std_factor * rays.stds) ** 2
    miss_variances = MISS_STD**2 + tracker.offset_std**2 + rays.across_variances
    posterior, iterate = covariance, mean if first_iterate is None else first_iterate
    for _ in range(tracker.iterations):
        linear = linearise(iterate, posterior, rays, ends, sight)
        across = (linear.slopes[:count, :2] * rays.normals).sum(axis=1)
        matrix = linear.matrix(size, across, ends, sight)
        errors = -linear.values - matrix[:, 7:] @ iterate[7:]
        errors[:count] += rays.ranges - sight.bias_per_std * rays.stds
        errors[count : count + 2] -= inset
        # Where the ray grazes the shape, a small error across it is a large one of the range.
        grazing = across**2 * rays.across_variances
        offsets = np.append((across * tracker.offset_std) ** 2, [0.0, 0.0])
        shape = linear.stds**2 + offsets
        variances = offsets.copy()
        variances[:count] += tracker.noise_factor**2 * ranges + grazing
        variances[:count] += tracker.shape_factor**2 * linear.stds[:count] ** 2
        variances[count:] = tracker.silhouette_factor**2 * (shape[count:] + inset_variance)
        missing = linear.values[count + 2 :] <= 0.0
        if sight.residual:
            variances += linear.curvature_variances
        else:
            missing[:] = True
        # What is not measured is measured with no precision.
        variances[~rows] = np.inf
        of_misses = np.where(missing, np.inf, tracker.shape_factor**2 * miss_variances)
        noise = np.concatenate([variances, of_misses])
        noise /= _weights(errors, noise, tracker)
        innovation = errors + matrix @ (iterate - mean)
        correction, posterior, _ = correct(covariance, matrix, noise, innovation)
        moved = mean + correction
        moved[5:7] = np.clip(moved[5:7], iterate[5:7] - SIZE_STEP, iterate[5:7] + SIZE_STEP)
        change = np.abs(moved - iterate).max()
        iterate = moved
        if change < CONVERGED:
            break
    # What the errors really are, as far as the model knows them; a miss is a penalty of the gain.
    own = np.concatenate([ranges + grazing, inset_variance + rays.across_variances[ends]])
    own += FINE * shape
    whole = np.zeros((len(matrix), len(joint.matrix)))
    whole[:, :size] = matrix
    shared = whole[: count + 2, size:]
    shared[:count, :NODES] = field_weights(linear.angles)
    shared[[count, count + 1], [NODES, NODES + 1]] = 1.0
    shared *= np.sqrt(SHARED[tracker.seen_by] * shape)[:, None]
    # To move a point changes the innovation as to move the target does, on oblique faces, too.
    moves = np.concatenate([rays.shared, rays.shared[ends]])
    of_sensor = slice(SHAPE_ERRORS, SHAPE_ERRORS + moves.shape[2])
    shared[:, of_sensor] = np.einsum("ni,nim->nm", matrix[: count + 2, :2], moves)
    own /= _weights(errors[: count + 2], own + (shared**2).sum(axis=1), tracker)
    measured = np.flatnonzero(rows)
    _, _, nis, likelihood = condition(
        joint.matrix, whole[measured], own[measured], innovation[measured]
    )
    likelihood += np.log(gate_widths(rays, tracker)).sum()
    missed = np.maximum(linear.values[count + 2 :], 0.0) ** 2
    missed = np.minimum(0.5 * missed / (MISS_STD**2 + rays.across_variances), CLUTTER).sum()
    joint = joint.copy()
    joint.correct(posterior @ (matrix.T / noise), whole, np.concatenate([own, miss_variances]))
    return iterate, posterior, joint, nis, len(measured), float(missed), likelihood


def constant_errors(joint: JointCovariance) -> np.ndarray:
    """How far m errors that stay, of the sensor and of the class's size, move a state: (d, m)."""
    return joint.matrix[: joint.size, joint.size + SHAPE_ERRORS :]


def _weights(errors: np.ndarray, variances: np.ndarray, tracker: ContourParameters) -> np.ndarray:
    """Weights (n,) ≤ 1 of errors with a Student distribution, see `contour_filter.py`."""
    freedom = tracker.degrees_of_freedom
    return np.minimum((freedom + 1.0) / (freedom + errors**2 / variances), 1.0)


class Linear(NamedTuple):
    """Predictions of n ranges, of minus the two insets and of n misses, and their dependence.

    Attributes:
        values: (2 n + 2,) m; a miss is how far a ray passes by the shape, negative inside.
        slopes: (2 n + 2, 5), by the states seen.
        stds: (n + 2,) m, of the ranges and insets.
        curvature_variances: (n + 2,) m², of what the slopes leave out: that of a parabola over one
            standard deviation of each state (Nørgaard, Poulsen & Ravn 2000, *New developments in
            state estimation for nonlinear systems*).
        angles: (n,) rad, where the rays meet the shape, in units of half its size.
    """

    values: np.ndarray
    slopes: np.ndarray
    stds: np.ndarray
    curvature_variances: np.ndarray
    angles: np.ndarray

    def matrix(self, size: int, across: np.ndarray, ends: np.ndarray, sight: Sight) -> np.ndarray:
        """Slopes (2 n + 2, d) by a state of `size` d, with the nodes of a residual.

        `across` (n,) are the slopes of the ranges by a move of the target across the rays, the
        tangent of the angle between a ray and the normal: a residual moves the range by the inverse
        of its cosine, and an end by as much as it is.
        """
        matrix, count = np.zeros((len(self.values), size)), len(self.angles)
        matrix[:, SEEN] = self.slopes
        if sight.residual:
            weights = node_weights(self.angles)
            matrix[count : count + 2, 7:] = -weights[ends]
            if not sight.far:
                # The slopes are those of sides that face the sensor.
                longer = np.minimum(np.sqrt(1.0 + across**2), GREATEST_LONGER)
                matrix[:count, 7:] = -weights * longer[:, None]
        return matrix


def linearise(
    state: np.ndarray, covariance: np.ndarray, rays: Rays, ends: np.ndarray, sight: Sight
) -> Linear:
    """The measurements at a `state` (d,) with a `covariance` (d, d), see `linearised`."""
    half = sight.half * np.exp(state[5:7])
    table, far = sight.table.arrays, (sight.far or sight.table).arrays
    covariance = np.ascontiguousarray(covariance)
    seen = state[SEEN], covariance, rays.sensor, rays.directions, rays.ranges
    return Linear(*linearised(*seen, ends, half, table, far))
