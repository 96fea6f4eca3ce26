"""The update of the tracker `contour`: rays on the class's shape; see `contour_filter.py`."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stixel_cli.tracking.association import uncut
from stixel_cli.tracking.consider import NODES, JointCovariance, field_weights
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import Rays, Sight, gate_widths, sampling_inset
from stixel_cli.tracking.contour.ray_kernels import Linear, fill_rows, linearise
from stixel_cli.tracking.kalman import condition, correct
from stixel_cli.tracking.smoothing import Step

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

SIZE_STEP = 0.3
"""Greatest change of a factor of the size in one iteration, relative: slopes are local."""

CONVERGED = 2e-3
"""The iteration ends when no state moves by more than this."""

Posterior = tuple[np.ndarray, np.ndarray, JointCovariance, float, int, float, float]
"""Mean, covariance of the gain, joint covariance, NIS, its degrees of freedom, log odds against the
rays that pass by the shape, log likelihood of all others."""


State = tuple[np.ndarray, np.ndarray, JointCovariance]
"""Mean (d,), the covariance (d, d) that makes the gain, and the joint covariance: of the error that
the mean has with these gains, and of the errors that are considered."""


def update(
    predicted: State,
    rays: Rays,
    sight: Sight,
    tracker: ContourParameters,
    first_iterate: np.ndarray | None = None,
) -> Posterior:
    """Posterior of the `predicted` state, which is not changed, with n > 0 rays.

    NIS and log likelihood are those of the innovation as the joint covariance has it, at the last
    iterate. The iteration begins at `first_iterate` (d,), by default at the prediction.
    """
    mean, covariance, joint = predicted
    count = len(rays.ranges)
    ends = np.array([np.argmin(rays.bearings), np.argmax(rays.bearings)])
    inset, inset_variance = sampling_inset(rays, sight)
    inset_variance = inset_variance + (np.radians(tracker.silhouette_std) * rays.ranges[ends]) ** 2
    silhouettes = uncut(rays.bearings[ends], rays.ranges[ends], rays.field_of_view)
    # A single ray does not show where an outline begins or ends.
    silhouettes &= ~np.array(rays.hidden) & (count > 1 or not sight.outline)
    rows = np.concatenate([np.ones(count, bool), silhouettes])
    ranges = (sight.std_factor * rays.stds) ** 2
    miss_variances = MISS_STD**2 + tracker.offset_std**2 + rays.across_variances
    # What is not measured has no precision.
    of_ends = np.where(silhouettes, tracker.silhouette_factor**2 * inset_variance, np.inf)
    of_misses = (
        tracker.shape_factor**2 * miss_variances if sight.residual else np.full(count, np.inf)
    )
    factors = np.full(count + 2, tracker.shape_factor**2)
    factors[count:] = tracker.silhouette_factor**2
    measured = np.zeros(2 * count + 2)
    measured[:count] = rays.ranges - sight.bias_per_std * rays.stds
    measured[count : count + 2] = -inset
    variances = np.concatenate([tracker.noise_factor**2 * ranges, of_ends, of_misses])
    beside = rays.across_variances + tracker.offset_std**2
    seen_from = rays.sensor, rays.directions, rays.ranges, ends, sight.half
    tables = sight.table.arrays, (sight.far or sight.table).arrays
    linear, matrix = Linear.of_rays(count), np.empty((2 * count + 2, len(mean)))
    iterate = mean if first_iterate is None else first_iterate
    posterior = np.ascontiguousarray(covariance)
    for _ in range(tracker.iterations):
        linearise(linear, iterate, posterior, *seen_from, *tables)
        errors, noise = measured.copy(), variances.copy()
        rows_of = linear, iterate, rays.directions, ends, factors, beside
        fill_rows(matrix, errors, noise, *rows_of, sight.far is not None)
        noise /= _weights(errors, noise, tracker)
        innovation = errors + matrix @ (iterate - mean)
        correction, posterior, _ = correct(covariance, matrix, noise, innovation)
        moved = mean + correction
        moved[5:7] = np.clip(moved[5:7], iterate[5:7] - SIZE_STEP, iterate[5:7] + SIZE_STEP)
        change = np.abs(moved - iterate).max()
        iterate = moved
        if change < CONVERGED:
            break
    values, _, stds, _, angles = linear
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


@dataclass(frozen=True)
class Hypothesis:
    """Where the target may be after a scan."""

    state: State
    """After the scan."""
    predicted: State
    """Before the scan's update."""
    log_likelihood: float
    """Of all scans."""
    log_likelihood_before: float
    """Of all scans before this one."""
    indices: np.ndarray
    """Of the scan's points that were used."""
    nis: float = np.nan
    degrees: int = 0
    """`nis`, `degrees`: of the scan; NaN and 0 without points."""
    missed: float = 0.0
    """Log odds against the scan's rays that pass by the shape. They count between places of one
    class, and not between classes, whose sizes may be wrong."""
    before: "Hypothesis | None" = None
    """The hypothesis that was predicted; None before the first scan."""
    transition: np.ndarray | None = None
    """(d, d) Jacobian of that prediction; None where the filter began anew."""

    @classmethod
    def unseen(cls, state: State, log_likelihood: float = 0.0) -> "Hypothesis":
        """The hypothesis of a `state` at a scan without points."""
        return cls(state, state, log_likelihood, log_likelihood, np.zeros(0, np.int64))

    @cached_property
    def step(self) -> Step:
        """What smoothing needs of this scan.

        What errors that all scans share move goes through the filter as the mean does: no scan
        shows it.
        """
        states = []
        for mean, covariance, joint in (self.state, self.predicted):
            states += [np.column_stack([mean, constant_errors(joint)]), covariance]
        return Step(*states, self.before and self.before.step, self.transition)

    @classmethod
    def updated(
        cls, predicted: State, before: float, indices: np.ndarray, posterior: Posterior
    ) -> "Hypothesis":
        """The hypothesis with the `posterior` of the points at `indices`."""
        *state, nis, degrees, missed, stated = posterior
        after = before + stated
        return cls(tuple(state), predicted, after, before, indices, nis, degrees, missed)
