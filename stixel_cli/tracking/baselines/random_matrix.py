"""A Kalman filter on the centroid and an ellipse: a random matrix.

M. Feldmann, D. Fränken, W. Koch 2011, *Tracking of extended objects and group targets using random
matrices*, IEEE Transactions on Signal Processing 59(4).

The state is x, y and their rates (m and m/s, world frame), and the extension X (2, 2) m² of the
ellipse pᵀ X⁻¹ p ≤ 1. X has an inverse Wishart density with mean X and the weight alpha, a number of
points. A point is scattered round the centre with Y = z X + R: z is 1/4 if points are anywhere in
the ellipse, 1/2 if they are all round its outline; R is the sensor's noise. For n points with the
mean m and the scatter M = Σ (y - m)(y - m)ᵀ, and the innovation v = m - x^c,

    S = P + Y / n            K = P S⁻¹                     a Kalman filter on the centroid
    N = X^½ S^-½ v vᵀ S^-½ X^½        M' = X^½ Y^-½ M Y^-½ X^½
    X⁺ = (alpha X + N + M') / (alpha + n)                  alpha⁺ = alpha + n

Over an interval T, X stays and alpha becomes 2 + (alpha - 2) e^(-T / tau). The roots are symmetric
ones, so the track does not depend on the axes of the world.

The model expects points on all sides of the centre. A sensor sees one side: the estimated centre
is near that side, and the filter does not know it.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.baselines.extension import update_extension
from stixel_cli.tracking.centre import GREATEST_VARIANCE, MOVING, predict, six_states, update
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.prior import PriorShape, prior_radii
from stixel_cli.tracking.track import InitialState, Track, contour_directions


@parameters
class RandomMatrixParameters:
    """A Kalman filter on the centroid and an ellipse: Feldmann, Fränken, Koch 2011.

    Attributes:
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        measurement_std: m, along each axis, added to the covariance of the points: R is the sum.
        scatter: z, the points' covariance over the squared semi-axes of the ellipse: 0.25 for
            points in the ellipse, 0.5 for points all round its outline.
        prior_weight: alpha of the class's size at the start, a number of points.
        forgetting_time: tau, s: how fast alpha falls to 2.
        gate_probability: chi-square probability of the association's gate; null takes every point.
        least_speed: below this speed, m/s, the heading is kept as it was.
    """

    kind: Literal["random_matrix"]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    measurement_std: Annotated[float, Ge(1e-6), Le(10)]
    scatter: Annotated[float, Gt(0), Le(1)]
    prior_weight: Annotated[float, Gt(2), Le(1e6)]
    forgetting_time: Annotated[float, Gt(0), Le(1e6)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None
    least_speed: Annotated[float, Gt(0), Le(100)]
    contour_points: ClassVar[int] = 120
    """Number M of points of the contour that is reported: no estimate depends on it."""


AREA = 0.25
"""Second moments of an ellipse's area over its squared semi-axes."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: RandomMatrixParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan, the first too.

    The ellipse starts with the length and the width of the class along and across the heading. The
    heading is the velocity's direction, see `six_states`: an ellipse has no front. The NIS is that
    of the centroid, with two degrees of freedom.
    """
    mean, covariance = initial.mean[MOVING], initial.covariance[np.ix_(MOVING, MOVING)]
    heading = (float(initial.mean[2]), min(float(initial.covariance[2, 2]), GREATEST_VARIANCE))
    turn = rotation(heading[0])
    extension = turn @ np.diag([prior.length**2, prior.width**2]) @ turn.T / 4.0
    weight = tracker.prior_weight

    count = len(scans)
    means, covariances = np.empty((count, 6)), np.empty((count, 6, 6))
    extensions, weights = np.empty((count, 2, 2)), np.empty(count)
    used: list[np.ndarray] = []
    nis = np.full(count, np.nan)
    for k, interval in enumerate(intervals(scans.times)):
        mean, covariance = predict(mean, covariance, interval, tracker.sigma_q)
        weight = 2.0 + (weight - 2.0) * np.exp(-interval / tracker.forgetting_time)
        rows = scans.rows(k)
        points = scans.points_world[rows]
        noises = scans.covariances_world[rows] + tracker.measurement_std**2 * np.eye(2)
        spread = covariance[:2, :2] + AREA * extension + noises
        indices = associate(points, mean[:2], spread, tracker.gate_probability)
        used.append(indices + rows.start)
        if len(indices):
            points, noise = points[indices], noises[indices].mean(axis=0)
            centroid, scattered = points.mean(axis=0), tracker.scatter * extension + noise
            offsets, noise = points - mean[:2], scattered / len(points)
            innovation = offsets.mean(axis=0)
            extension = update_extension(
                extension,
                weight,
                (innovation, covariance[:2, :2] + noise),
                (offsets - innovation, scattered),
            )
            mean, covariance, nis[k] = update(mean, covariance, centroid - mean[:2], noise)
            weight += len(points)
        means[k], covariances[k] = six_states(
            mean, covariance, heading, interval, tracker.sigma_q, tracker.least_speed
        )
        heading = (means[k, 2], covariances[k, 2, 2])
        extensions[k], weights[k] = extension, weight

    contours = contours_of(means, covariances, extensions, weights, prior, tracker.contour_points)
    degrees = np.array([2 if len(rows) else 0 for rows in used], dtype=np.int64)
    return Track.of_scans(scans.times, (means, covariances), contours, used, nis, degrees)


def contours_of(
    means: np.ndarray,
    covariances: np.ndarray,
    extensions: np.ndarray,
    weights: np.ndarray,
    prior: PriorShape,
    points: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Contours (K, M, 2) m, directions (K, M, 2) and std (K, M) m of K ellipses; see `Track`.

    In a direction p the radius is r = (pᵀ X⁻¹ p)^-½. The std consists of three parts: that of r,
    which is r / √(2 (alpha + 3)) to first order, as pᵀ X⁻¹ p has a chi-square density with
    alpha + 3 degrees of freedom; that of the centre, which moves the ellipse by r² pᵀ X⁻¹ along p;
    and the distance of the class's shape from an ellipse of its size, with the class's `sigma_f`.
    """
    angles, directions = contour_directions(means[:, 2], points)
    inverse = directions @ np.linalg.inv(extensions)
    radii = 1.0 / np.sqrt(np.einsum("kmi,kmi->km", inverse, directions))
    rows = radii[..., None] ** 2 * inverse
    moved = np.einsum("kmi,kij,kmj->km", rows, covariances[:, :2, :2], rows)
    axes = 0.5 * np.array([prior.length, prior.width])
    ellipse = axes.prod() / np.hypot(axes[1] * np.cos(angles), axes[0] * np.sin(angles))
    misfit = prior.sigma_f**2 + (prior_radii(prior, angles) - ellipse) ** 2
    std = np.sqrt(radii**2 / (2.0 * (weights[:, None] + 3.0)) + moved + misfit)
    return means[:, None, :2] + radii[..., None] * directions, directions, std
