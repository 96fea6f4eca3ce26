"""The update of the tracker `contour`: rays on the class's shape; see `contour_filter.py`."""

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.association import uncut
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import (
    Rays,
    Sight,
    range_biases,
    sampling_inset,
)
from stixel_cli.tracking.contour.ray_table import expected

SEEN = np.array([0, 1, 2, 5, 6])
"""Indices of the states that a ray sees: the pose and the two sizes."""

LEAST_STEP = np.array([0.02, 0.02, 0.01, 0.01, 0.01])
GREATEST_STEP = np.array([0.3, 0.3, 0.2, 0.1, 0.1])
"""Bounds of the steps of the central differences, in the units of the states seen."""

CONVERGED = 2e-3
"""The iteration ends when no state moves by more than this."""

Posterior = tuple[np.ndarray, np.ndarray, np.ndarray, float, int, float]
"""Mean, covariance, `of_bias`, NIS, its degrees of freedom, log likelihood."""


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    of_bias: np.ndarray,
    rays: Rays,
    sight: Sight,
    tracker: ContourParameters,
    first_iterate: np.ndarray | None = None,
) -> Posterior:
    """Posterior mean (7,) and covariance (7, 7), of n > 0 rays; NIS and its degrees of freedom.

    `of_bias` (7,), and the third result, is the state's covariance with the considered error over
    the error's standard deviation. Last the log likelihood: of the innovation, with the weighted
    noise, at the last iterate. The iteration begins at `first_iterate` (7,), by default at the
    prior's `mean`.
    """
    count = len(rays.ranges)
    first, last = int(np.argmin(rays.bearings)), int(np.argmax(rays.bearings))
    inset, inset_variance = sampling_inset(rays, sight)
    edges = (np.radians(tracker.silhouette_std) * rays.ranges[[first, last]]) ** 2
    silhouettes = uncut(
        rays.bearings[[first, last]], rays.ranges[[first, last]], rays.field_of_view
    )
    rows = np.concatenate([np.ones(count, bool), silhouettes])
    biases = np.concatenate([range_biases(rays, tracker), [0.0, 0.0]])
    # With the considered error, of variance 1, after the state.
    joint = np.eye(8)
    joint[:7, :7], joint[:7, 7], joint[7, :7] = covariance, of_bias, of_bias
    posterior = joint
    iterate = mean if first_iterate is None else first_iterate
    for _ in range(tracker.iterations):
        predicted, slopes, stds = _linearise(iterate, posterior, rays, first, last, sight)
        matrix = np.zeros((count + 2, 8))
        matrix[:, SEEN], matrix[:, 7] = slopes.T, biases
        errors = -predicted
        errors[:count] += rays.ranges - sight.bias_per_std * rays.stds
        errors[count:] -= inset
        variances = np.empty(count + 2)
        variances[:count] = (tracker.noise_factor * sight.std_factor * rays.stds) ** 2
        variances[:count] += (tracker.shape_factor * stds[:count]) ** 2
        # Where the ray grazes the shape, a small error across it is a large one of the range.
        across = (
            slopes[1, :count] * rays.directions[:, 0] - slopes[0, :count] * rays.directions[:, 1]
        )
        variances[:count] += across**2 * (rays.across_variances + tracker.offset_std**2)
        variances[count:] = tracker.silhouette_factor**2 * (
            stds[count:] ** 2 + inset_variance + edges
        )
        freedom = tracker.degrees_of_freedom
        weights = (freedom + 1.0) / (freedom + errors**2 / (variances + biases**2))

        noise = (variances / np.minimum(weights, 1.0))[rows]
        matrix, errors = matrix[rows], errors[rows]
        innovation = errors + matrix[:, :7] @ (iterate - mean)
        correction, posterior, nis, likelihood = condition(joint, matrix, noise, innovation)
        moved = mean + correction[:7]
        change = np.abs(moved - iterate).max()
        iterate = moved
        if change < CONVERGED:
            break
    # The considered error is not estimated: its variance stays 1.
    return iterate, posterior[:7, :7], posterior[:7, 7], nis, len(innovation), likelihood


def condition(
    covariance: np.ndarray, matrix: np.ndarray, noise: np.ndarray, innovation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float, float]:
    """A Kalman update with independent errors: correction (d,), covariance (d, d), NIS, density.

    `covariance` (d, d) is the prior's, `matrix` (n, d) the measurement's, `noise` (n,) variances,
    which must be far above rounding. The density is the logarithm of that of the `innovation` (n,).
    In the information form the cost grows with n and not with n³.
    """
    scale = np.eye(len(covariance)) + covariance @ (matrix.T @ (matrix / noise[:, None]))
    posterior = np.linalg.solve(scale, covariance)
    posterior = 0.5 * (posterior + posterior.T)
    pull = matrix.T @ (innovation / noise)
    nis = innovation @ (innovation / noise) - pull @ posterior @ pull
    determinant = np.linalg.slogdet(scale)[1] + np.log(noise).sum()
    density = -0.5 * (nis + determinant + len(innovation) * np.log(2.0 * np.pi))
    return posterior @ pull, posterior, float(nis), float(density)


def _linearise(
    state: np.ndarray, covariance: np.ndarray, rays: Rays, first: int, last: int, sight: Sight
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Predictions (n + 2,) m, their slopes (5, n + 2) by the states seen, and stds (n + 2,) m.

    The last two are minus the insets of the silhouette. The slopes are central differences along
    the target's axes, over about a standard deviation: so no frame of the world matters.
    """
    axes = np.eye(5)
    axes[:2, :2] = rotation(state[2])
    variances = np.diag(axes.T @ covariance[np.ix_(SEEN, SEEN)] @ axes)
    steps = np.clip(np.sqrt(np.maximum(variances, 0.0)), LEAST_STEP, GREATEST_STEP)
    moved = np.repeat(state[None, SEEN], 11, axis=0)
    moved[1:6] += (axes * steps).T
    moved[6:] -= (axes * steps).T
    ranges, insets, _, range_stds, inset_stds = expected(
        moved, rays.sensor[:2], rays.directions, first, last, *sight.table.arrays()
    )
    predicted = np.hstack([ranges, -insets])
    slopes = axes @ ((predicted[1:6] - predicted[6:]) / (2.0 * steps[:, None]))
    return predicted[0], slopes, np.concatenate([range_stds, inset_stds])
