"""Random matrices for a rectangle whose visible sides alone are measured.

S. Steuernagel, K. Thormann, M. Baum 2024, *Random matrix-based tracking of rectangular extended
objects with contour measurements*, FUSION; and, for `centre=midpoints`, P. Li, C. Chen, C. You,
J. Qiu 2023, *Modified extended object tracker for 2D lidar data using random matrix model*,
Scientific Reports 13, with the former's other equations ("LiImproved" there).

State and update are those of `random_matrix`, with X (2, 2) m² of the half length and the half
width: its eigenvectors are along the sides, its eigenvalues their squares. Two things differ.

- The measured centre is not the mean of the points. `ends`: the middle between the first and the
  last point from right to left: if two sides are seen, these are opposite corners. `midpoints`: the
  i-th point from the right and the i-th from the left have a midpoint. The line through all of
  these is cut where it is as far away, along the rays, as the first and as the last point; the
  centre is the middle of both cuts.
- The scatter about this centre of points that are even on two sides is z X with z = 2/3.

With V the scale matrix of the inverse Wishart density, its mean is V / alpha, which the update
takes; the estimate X that is reported and predicted is V / (alpha + 3), as the authors have it.
Over an interval T, X stays and alpha becomes alpha e^(-T / tau).
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.baselines.extension import update_extension
from stixel_cli.tracking.baselines.rectangle_contour import (
    LEAST_SPEED,
    QUARTER,
    contours_of,
    forward_axis,
)
from stixel_cli.tracking.centre import MOVING, predict, six_states, update
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, Track


@parameters
class LidarRandomMatrixParameters:
    """Random matrices for a rectangle of which one or two sides are seen.

    Attributes:
        centre: how it is measured: `ends`, the middle between the first and the last point from
            right to left (Steuernagel, Thormann, Baum 2024); `midpoints`, from a line through the
            midpoints of pairs of points (Li, Chen, You, Qiu 2023).
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        scatter: z, the points' scatter about the centre over the squared half sizes: 2/3 for
            points even on two sides.
        prior_weight: alpha of the class's size at the start, a number of points.
        forgetting_time: tau, s: how fast alpha falls.
        gate_probability: chi-square probability of the association's gate; null takes every point.
    """

    kind: Literal["lidar_random_matrix"]
    centre: Literal["ends", "midpoints"]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    scatter: Annotated[float, Gt(0), Le(1)]
    prior_weight: Annotated[float, Ge(1), Le(1e6)]
    forgetting_time: Annotated[float, Gt(0), Le(1e6)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None
    contour_points: ClassVar[int] = 240
    """Number M of points of the contour that is reported: no estimate depends on it."""


FEWEST_PAIRS = 4
"""With fewer pairs of points there is no line through their midpoints: the mean of the points."""

LEAST_WEIGHT = 1e-3
"""alpha falls no lower: without points the update's X would grow beyond all bounds."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: LidarRandomMatrixParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan, the first too.

    The rectangle starts with the length and the width of the class along and across the heading.
    The reported states are x, y, heading, their rates, length and width. The heading is the
    direction along the sides that is nearest to the velocity's. The NIS is that of the measured
    centre, with two degrees of freedom.
    """
    mean, covariance = initial.mean[MOVING], initial.covariance[np.ix_(MOVING, MOVING)]
    heading = float(initial.mean[2])
    turn = rotation(heading)
    extension = turn @ np.diag([prior.length**2, prior.width**2]) @ turn.T / 4.0
    weight = tracker.prior_weight

    count = len(scans)
    means, covariances = np.empty((count, 8)), np.empty((count, 8, 8))
    used: list[np.ndarray] = []
    nis = np.full(count, np.nan)
    for k, interval in enumerate(intervals(scans.times)):
        mean, covariance = predict(mean, covariance, interval, tracker.sigma_q)
        weight = max(weight * np.exp(-interval / tracker.forgetting_time), LEAST_WEIGHT)
        rows = scans.rows(k)
        points, noises = scans.points_world[rows], scans.covariances_world[rows]
        # A rectangle's area has a third of its squared half sizes as second moments.
        spread = covariance[:2, :2] + extension / 3.0 + noises
        indices = associate(points, mean[:2], spread, tracker.gate_probability)
        used.append(indices + rows.start)
        if len(indices):
            points, noise = points[indices], noises[indices].mean(axis=0)
            centre = measured_centre(points, scans.sensor_poses_world[k, :2], tracker.centre)
            wide = (weight + 3.0) / weight * extension
            scattered = tracker.scatter * wide + noise
            innovation, noise = centre - mean[:2], scattered / len(points)
            wide = update_extension(
                wide, weight, (innovation, covariance[:2, :2] + noise), (points - centre, scattered)
            )
            mean, covariance, nis[k] = update(mean, covariance, innovation, noise)
            weight += len(points)
            extension = weight / (weight + 3.0) * wide
        states = six_states(
            mean, covariance, (heading, 0.0), interval, tracker.sigma_q, LEAST_SPEED
        )
        means[k], covariances[k] = _eight_states(*states, extension, weight, heading)
        heading = means[k, 2]

    contours = contours_of(means, covariances, prior, tracker.contour_points)
    degrees = np.array([2 if len(rows) else 0 for rows in used], dtype=np.int64)
    return Track.of_scans(scans.times, (means, covariances), contours, used, nis, degrees)


def measured_centre(
    points: np.ndarray, sensor: np.ndarray, how: Literal["ends", "midpoints"]
) -> np.ndarray:
    """The centre (2,) m that `points` (n, 2) m tell, as a `sensor` at (2,) m sees them, n > 0."""
    offsets = points - sensor
    middle = offsets.mean(axis=0)
    bearings = np.arctan2(offsets[:, 1], offsets[:, 0]) - np.arctan2(middle[1], middle[0])
    points = points[np.argsort(wrap_angle(bearings), kind="stable")]
    ends, pairs = points[[0, -1]], len(points) // 2
    if how == "ends":
        return ends.mean(axis=0)
    if pairs < FEWEST_PAIRS:
        return points.mean(axis=0)
    midpoints = 0.5 * (points[:pairs] + points[::-1][:pairs])
    middle = midpoints.mean(axis=0)
    # Its direction is the axis of the greatest scatter: no axis of the world is special.
    direction = np.linalg.svd(midpoints - middle)[2][0]
    rays = ends - sensor
    away = np.einsum("ei,ei->e", rays, ends - middle) / (rays @ direction)
    return middle + away.mean() * direction


def _eight_states(
    states: np.ndarray, spread: np.ndarray, extension: np.ndarray, weight: float, heading: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (8,) and covariance (8, 8) of the track, from its six `states` with their `spread`.

    The heading is along the sides, and independent of the velocity; `heading` is the one before.
    To first order an inverse Wishart density gives a half size a, b the variance
    a² / (2 (alpha + 3)), and the direction a² b² / ((alpha + 3) (a² - b²)²), which is at most that
    of a direction that is quite unknown within a quarter turn.
    """
    squares, axes = np.linalg.eigh(extension)
    angle = float(np.arctan2(axes[1, 1], axes[0, 1]))
    forwards, swapped = forward_axis(angle, states[3:5], heading)
    size = 2.0 * np.sqrt(squares if swapped else squares[::-1])
    mean, covariance = np.concatenate([states, size]), np.zeros((8, 8))
    mean[2] = forwards
    covariance[:6, :6] = spread
    covariance[2], covariance[:, 2] = 0.0, 0.0
    apart = (weight + 3.0) * (squares[1] - squares[0]) ** 2
    unknown = QUARTER**2 / 12.0
    covariance[2, 2] = squares.prod() / max(apart, squares.prod() / unknown)
    covariance[6, 6], covariance[7, 7] = size**2 / (2.0 * (weight + 3.0))
    return mean, covariance
