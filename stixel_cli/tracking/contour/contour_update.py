"""The update of the tracker `contour`: rays on the class's shape; see `contour_filter.py`."""

from typing import NamedTuple

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.association import uncut
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.contour.contour_rays import Rays, Sight, range_errors, sampling_inset
from stixel_cli.tracking.contour.ray_table import expected
from stixel_cli.tracking.kalman import condition

SEEN = np.array([0, 1, 2, 5, 6])
"""Indices of the states that a ray sees: the pose and the two sizes."""

CAP = 0.5
"""Of half the length or the width: a change of the size moves what is nearer to an end by as much
as the end. From 0.5 to 0.8 gains as much at home; 1, a scaled shape, shrinks real cars whose front
is rounder than the class's.
"""

LEAST_STEP = np.array([0.02, 0.02, 0.01])
GREATEST_STEP = np.array([0.3, 0.3, 0.2])
"""Bounds of the steps of the central differences, in the units of the states seen."""

MISS_STD, MISS_FACTOR = 0.05, 4.0
"""A ray with a point of the target should meet its shape: standard deviation, m, and a factor on it
that stands for neighbours, which share the error."""

SIZE_STEP = 0.3
"""Greatest change of a factor of the size in one iteration, relative: slopes are local."""

CONVERGED = 2e-3
"""The iteration ends when no state moves by more than this."""

Posterior = tuple[np.ndarray, np.ndarray, np.ndarray, float, int, float]
"""Mean, covariance, `of_errors`, NIS, its degrees of freedom, log likelihood."""


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    of_errors: np.ndarray,
    rays: Rays,
    sight: Sight,
    tracker: ContourParameters,
    first_iterate: np.ndarray | None = None,
) -> Posterior:
    """Posterior mean (d,) and covariance (d, d), of n > 0 rays; NIS and its degrees of freedom.

    `of_errors` (d, 2), and the third result, is the state's covariance with the two errors that
    scans share over their standard deviations, see `range_errors`. Last the log likelihood: of the
    innovation, with the weighted noise, at the last iterate. The iteration begins at
    `first_iterate` (d,), by default at the prior's `mean`.
    """
    count = len(rays.ranges)
    first, last = int(np.argmin(rays.bearings)), int(np.argmax(rays.bearings))
    inset, inset_variance = sampling_inset(rays, sight)
    edges = (np.radians(tracker.silhouette_std) * rays.ranges[[first, last]]) ** 2
    silhouettes = uncut(
        rays.bearings[[first, last]], rays.ranges[[first, last]], rays.field_of_view
    )
    # A single ray does not show where an outline begins or ends.
    silhouettes &= ~np.array(rays.hidden) & (count > 1 or not sight.outline)
    rows = np.concatenate([np.ones(count, bool), silhouettes])
    biases, possible = np.pad(range_errors(rays, sight, tracker), ((0, 0), (0, 2)))
    # With the considered error, of variance 1, after the state.
    size = len(mean)
    joint = np.eye(size + 1)
    joint[:size, :size] = covariance
    joint[:size, size] = joint[size, :size] = of_errors[:, 0]
    posterior = joint
    iterate = mean if first_iterate is None else first_iterate
    for _ in range(tracker.iterations):
        linear = linearise(iterate, posterior, rays, first, last, sight)
        predicted, slopes, stds = linear.predicted, linear.slopes, linear.stds
        matrix = np.zeros((count + 2, size + 1))
        matrix[:, SEEN], matrix[:, size] = slopes.T, biases
        if sight.residual:
            matrix[:, 7:size] = sight.residual.slopes(
                iterate, rays.sensor[:2], rays.directions, predicted[:count], (first, last)
            )
            if sight.far:
                # The slopes are those of sides that face the sensor.
                matrix[:count, 7:size] = 0.0
            predicted = predicted + matrix[:, 7:size] @ iterate[7:]
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
        if sight.residual:
            variances += linear.curvature_variances
        freedom = tracker.degrees_of_freedom
        weights = (freedom + 1.0) / (freedom + errors**2 / (variances + biases**2))

        noise = (variances / np.minimum(weights, 1.0))[rows]
        matrix, errors, sensitivity = matrix[rows], errors[rows], possible[rows]
        if sight.residual:
            passing = linear.misses > 0.0
            misses, miss_matrix = linear.misses[passing], np.zeros((passing.sum(), size + 1))
            miss_matrix[:, SEEN] = linear.miss_slopes[:, passing].T
            miss_noise = _miss_noise(misses, rays.across_variances[passing], tracker)
            matrix, errors = np.vstack([matrix, miss_matrix]), np.concatenate([errors, -misses])
            noise = np.concatenate([noise, miss_noise])
            sensitivity = np.concatenate([sensitivity, np.zeros(len(misses))])
        innovation = errors + matrix[:, :size] @ (iterate - mean)
        correction, posterior, nis, likelihood = condition(joint, matrix, noise, innovation)
        if sight.residual:
            # A miss is a penalty: it makes nothing more likely.
            likelihood += 0.5 * np.log(2.0 * np.pi * miss_noise).sum()
        moved = mean + correction[:size]
        moved[5:7] = np.clip(moved[5:7], iterate[5:7] - SIZE_STEP, iterate[5:7] + SIZE_STEP)
        change = np.abs(moved - iterate).max()
        iterate = moved
        if change < CONVERGED:
            break
    # The considered error is not estimated: its variance stays 1.
    # The possible error moves the measurements by its sensitivity; the gain, which leaves it out,
    # moves the state by the part of it that the prediction does not have yet.
    innovations = sensitivity - matrix[:, :size] @ of_errors[:, 1]
    of_possible = of_errors[:, 1] + posterior[:size] @ (matrix.T @ (innovations / noise))
    of_errors = np.stack([posterior[:size, size], of_possible], axis=-1)
    return iterate, posterior[:size, :size], of_errors, nis, int(rows.sum()), likelihood


def _miss_noise(
    misses: np.ndarray, across_variances: np.ndarray, tracker: ContourParameters
) -> np.ndarray:
    """Variances (n,) m² of how far rays with a point of the target pass by its shape, m.

    Weighted as those of a Student distribution, see `contour_filter.py`.
    """
    variances = MISS_FACTOR**2 * (MISS_STD**2 + tracker.offset_std**2 + across_variances)
    freedom = tracker.degrees_of_freedom
    return variances * np.maximum((freedom + misses**2 / variances) / (freedom + 1.0), 1.0)


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
    ranges, insets, misses, range_stds, inset_stds = expected(
        moved, rays.sensor[:2], rays.directions, first, last, *sight.table.arrays()
    )
    if sight.far:
        far = expected(moved, rays.sensor[:2], rays.directions, -1, -1, *sight.far.arrays())[0]
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
