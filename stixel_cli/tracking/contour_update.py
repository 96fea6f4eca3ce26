"""The update of the tracker `contour`: rays on the class's shape; see `contour.py`."""

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.association import uncut
from stixel_cli.tracking.contour_parameters import ContourParameters
from stixel_cli.tracking.contour_rays import (
    Rays,
    Sight,
    range_biases,
    sampling_inset,
    shared_covariance,
)
from stixel_cli.tracking.ray_table import expected

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
    correlated = shared_covariance(rays, sight, tracker)
    biases = np.concatenate([range_biases(rays, tracker), [0.0, 0.0]])
    spread = covariance
    iterate = mean if first_iterate is None else first_iterate
    for _ in range(tracker.iterations):
        predicted, slopes, stds = _linearise(iterate, spread, rays, first, last, sight)
        matrix = np.zeros((count + 2, 7))
        matrix[:, SEEN] = slopes.T
        errors = -predicted
        errors[:count] += rays.ranges - sight.bias_per_std * rays.stds
        errors[count:] -= inset
        variances = np.empty(count + 2)
        variances[:count] = tracker.noise_factor**2 * (
            (sight.std_factor * rays.stds) ** 2 + stds[:count] ** 2
        )
        # Where the ray grazes the shape, a small error across it is a large one of the range.
        across = (
            slopes[1, :count] * rays.directions[:, 0] - slopes[0, :count] * rays.directions[:, 1]
        )
        variances[:count] += across**2 * (rays.across_variances + tracker.offset_std**2)
        variances[count:] = tracker.silhouette_factor**2 * (
            stds[count:] ** 2 + inset_variance + edges
        )
        total = variances.copy()
        total[:count] += np.diag(correlated) + biases[:count] ** 2
        freedom = tracker.degrees_of_freedom
        weights = np.minimum((freedom + 1.0) / (freedom + errors**2 / total), 1.0)
        noise = np.diag(variances / weights)
        noise[:count, :count] += correlated

        matrix, errors, noise = matrix[rows], errors[rows], noise[np.ix_(rows, rows)]
        innovation = errors + matrix @ (iterate - mean)
        crossed = matrix @ covariance + np.outer(biases[rows], of_bias)
        shared = matrix @ of_bias + biases[rows]
        innovation_covariance = crossed @ matrix.T + np.outer(shared, biases[rows]) + noise
        gain = np.linalg.solve(innovation_covariance, crossed).T
        moved = mean + gain @ innovation
        spread = covariance - gain @ crossed
        spread = 0.5 * (spread + spread.T)
        change = np.abs(moved - iterate).max()
        iterate = moved
        if change < CONVERGED:
            break
    nis = innovation @ np.linalg.solve(innovation_covariance, innovation)
    determinant = np.linalg.slogdet(innovation_covariance)[1]
    likelihood = -0.5 * (nis + determinant + len(innovation) * np.log(2.0 * np.pi))
    of_bias = of_bias - gain @ shared
    return iterate, spread, of_bias, float(nis), len(innovation), float(likelihood)


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
