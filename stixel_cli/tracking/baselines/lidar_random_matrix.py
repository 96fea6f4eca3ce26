"""Random matrices for a rectangle whose visible sides alone are measured.

S. Steuernagel, K. Thormann, M. Baum 2024, *Random matrix-based tracking of rectangular extended
objects with contour measurements*, FUSION; and, for `centre=midpoints`, P. Li, C. Chen, C. You,
J. Qiu 2023, *Modified extended object tracker for 2D lidar data using random matrix model*,
Scientific Reports 13, with the former's other equations ("LiImproved" there).

The state is x, y and their rates (m and m/s, world frame), and the extension X (2, 2) m² of the
rectangle: its eigenvectors are along the sides, its eigenvalues the squared half sizes. X has an
inverse Wishart density with the weight alpha, a number of points. With V its scale matrix, its mean
is V / alpha, which the update takes; the estimate X that is reported and predicted is
V / (alpha + 3), as the authors have it. Equations: `docs/theory.md`, "Random matrices".
"""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.baselines.rectangle_contour import contours_of, rectangle_states, shape_of
from stixel_cli.tracking.kalman import PLACE, correct
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.motion import MOVING, predict_place
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
        prior_weight: alpha of the class's size at the start, a number of points.
        forgetting_time: tau, s: how fast alpha falls.
        gate_probability: chi-square probability of the association's gate; null takes every point.
    """

    kind: Literal["lidar_random_matrix"]
    centre: Literal["ends", "midpoints"]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    prior_weight: Annotated[float, Ge(1), Le(1e6)]
    forgetting_time: Annotated[float, Gt(0), Le(1e6)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None


SCATTER = 2.0 / 3.0
"""z, the scatter about the centre of points even on two sides, over the squared half sizes."""

FEWEST_PAIRS = 4
"""With fewer pairs of points it is their mean: with 2, scores are not those that are published."""


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

    filtered, nis = Filtered(scans, 8), np.nan
    for scan in filtered:
        mean, covariance = predict_place(mean, covariance, scan.interval, tracker.sigma_q)
        # As at the start, X counts as one point or more.
        weight = max(weight * np.exp(-scan.interval / tracker.forgetting_time), 1.0)
        # A rectangle's area has a third of its squared half sizes as second moments.
        spread = covariance[:2, :2] + extension / 3.0 + scan.covariances
        indices = associate(scan.points, mean[:2], spread, tracker.gate_probability)
        if len(indices):
            points, noise = scan.points[indices], scan.covariances[indices].mean(axis=0)
            centre = measured_centre(points, scan.sensor[:2], tracker.centre)
            wide = (weight + 3.0) / weight * extension
            scattered = SCATTER * wide + noise
            innovation, noise = centre - mean[:2], scattered / len(points)
            moved = innovation, covariance[:2, :2] + noise
            wide = update_extension(wide, weight, moved, (points - centre, scattered))
            correction, covariance, nis = correct(covariance, PLACE, noise, innovation)
            mean = mean + correction
            weight += len(points)
            extension = weight / (weight + 3.0) * wide
        moving, motion = (mean, covariance), (heading, scan.interval, tracker.sigma_q)
        states = rectangle_states(moving, shape_of(extension, weight), *motion)
        heading = states[0][2]
        filtered.add(*states, indices, nis, degrees=2)
    return filtered.track(contours_of(*filtered.states, prior))


def update_extension(
    extension: np.ndarray,
    weight: float,
    innovation: tuple[np.ndarray, np.ndarray],
    offsets: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """X⁺ (2, 2) m² from n points, Feldmann, Fränken, Koch 2011; it counts as alpha + n of them.

    `extension` X and its `weight` alpha are the predicted ones. `innovation` is the measured centre
    minus the predicted one (2,) m, and its covariance S (2, 2) m². `offsets` are the points minus
    the measured centre (n, 2) m, and the expected covariance Y (2, 2) m² of each.
    """
    moved = _whitening(extension, innovation[1]) @ innovation[0]
    spread = offsets[0] @ _whitening(extension, offsets[1]).T
    total = weight + len(spread)
    return (weight * extension + np.outer(moved, moved) + spread.T @ spread) / total


def _whitening(extension: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """X^½ C^-½ (2, 2) with symmetric roots of the `extension` X and the `covariance` C."""
    roots, axes = np.linalg.eigh(np.stack([extension, covariance]))
    powers = np.sqrt(roots) ** np.array([[1.0], [-1.0]])
    first, second = (axes * powers[:, None, :]) @ np.swapaxes(axes, 1, 2)
    return first @ second


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
