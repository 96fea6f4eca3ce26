"""A Kalman filter on a rectangle whose visible sides are a mixture of Gaussians: GM-MEM-EKF*.

K. Thormann, S. Yang, M. Baum 2021, *Kalman filter based extended object tracking with a Gaussian
mixture spatial distribution model*, IEEE Intelligent Vehicles Symposium Workshops; on the MEM-EKF*
of S. Yang, M. Baum 2019, *Tracking the orientation and axes lengths of an elliptical extended
object*, IEEE Transactions on Signal Processing 67(18).

The state is x, y and their rates, and the shape: the angle of the first axis and the half sizes
along both axes, m. A point of side j is at the side's middle h_j, with the covariance C_j along it,
both in half sizes. Equations: `docs/theory.md`, "A mixture of sides".
"""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.randomness import generator
from stixel_cli.tracking import kalman
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.baselines.rectangle_contour import (
    LEAST_SIZE,
    QUARTER,
    contours_of,
    rectangle_states,
)
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.motion import GREATEST_VARIANCE, MOVING, predict_place
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, Track


@parameters
class GmMemEkfParameters:
    """GM-MEM-EKF*: the sides that the sensor sees are components of a Gaussian mixture.

    Attributes:
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        heading_noise: root density of the angle's random walk, rad/s^0.5.
        size_noise: that of each half size, m/s^0.5.
        gate_probability: chi-square probability of the association's gate; null takes every point.
    """

    kind: Literal["gm_mem_ekf"]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    heading_noise: Annotated[float, Ge(0), Le(100)]
    size_noise: Annotated[float, Ge(0), Le(100)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None


MIDDLES = 0.99 * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
"""h_j (4, 2) of the front, left, rear and right side, in half sizes; points are a little inside."""

VARIANCES = np.array([[1e-4, 1.0], [1.0, 1e-4]] * 2) / 3.0
"""Diagonals (4, 2) of C_j: points are even along the side, and across within 0.01 half sizes."""

FACING, ASIDE = np.pi / 8.0, 3.0 * np.pi / 8.0
"""Angles to the sensor's direction, rad: nearer a side counts fully, then with `ASIDE_WEIGHT`, then
not at all."""

ASIDE_WEIGHT = 0.8

SQUARES = np.array([0, 1, 0]), np.array([0, 1, 1])
"""The factors of v_x², v_y² and v_x v_y."""


class Estimate(NamedTuple):
    """Gaussians of the kinematic state and of the shape."""

    state: np.ndarray
    covariance: np.ndarray
    """`state`, `covariance`: (4,) and (4, 4) of x, y and their rates, m and m/s, world frame."""
    shape: np.ndarray
    shape_covariance: np.ndarray
    """`shape`, `shape_covariance`: (3,) and (3, 3) of the first axis's angle in rad and the half
    sizes in m."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: GmMemEkfParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan, the first too.

    The shape starts with the heading and the class's size. The points of a scan are used in a
    random order, which is the same in every run: in the order of their bearings they would turn the
    rectangle. The reported states are x, y, heading, their rates, length and width; the heading is
    the direction along the sides that is nearest to the velocity's. The NIS is the sum of the
    points', with two degrees of freedom each, of the most probable side.
    """
    size = 0.5 * np.array([prior.length, prior.width])
    variances = (size * [prior.length_std, prior.width_std]) ** 2
    moving = initial.mean[MOVING], initial.covariance[np.ix_(MOVING, MOVING)]
    spread = np.diag([min(initial.covariance[2, 2], GREATEST_VARIANCE), *variances])
    estimate = Estimate(*moving, np.array([initial.mean[2], *size]), spread)
    noise_density = np.diag([tracker.heading_noise, *[tracker.size_noise] * 2]) ** 2

    heading, filtered = float(initial.mean[2]), Filtered(scans, 8)
    for scan in filtered:
        moving = predict_place(*estimate[:2], scan.interval, tracker.sigma_q)
        spread = estimate.shape_covariance + scan.interval * noise_density
        estimate = Estimate(*moving, estimate.shape, spread)
        turn = rotation(estimate.shape[0])
        area = turn @ np.diag(estimate.shape[1:] ** 2 / 3.0) @ turn.T
        spread = estimate.covariance[:2, :2] + area + scan.covariances
        indices = associate(scan.points, estimate.state[:2], spread, tracker.gate_probability)
        weights, nis = side_weights(estimate, scan.sensor[:2]), 0.0
        for i in generator(0, "gm_mem_ekf", scan.k).permutation(indices):
            estimate, distance = update(estimate, scan.points[i], scan.covariances[i], weights)
            nis += distance
        motion = heading, scan.interval, tracker.sigma_q
        states = rectangle_states(estimate[:2], estimate[2:], *motion)
        heading = states[0][2]
        filtered.add(*states, indices, nis, degrees=2 * len(indices))
    return filtered.track(contours_of(*filtered.states, prior))


def side_weights(estimate: Estimate, sensor: np.ndarray) -> np.ndarray:
    """Weights (4,) of the sides, with the sum 1, for a `sensor` at (2,) m in the world.

    The angle between the side's direction and the sensor's decides, both in half sizes.
    """
    angle, *half = estimate.shape
    x, y = rotation(angle).T @ (sensor - estimate.state[:2]) / half
    away = np.abs(wrap_angle(np.arctan2(y, x) - QUARTER * np.arange(4)))
    weights = np.where(away <= FACING, 1.0, np.where(away <= ASIDE, ASIDE_WEIGHT, 0.0))
    return weights / weights.sum()


def update(
    estimate: Estimate, point: np.ndarray, noise: np.ndarray, weights: np.ndarray
) -> tuple[Estimate, float]:
    """Posterior with one `point` (2,) m of covariance `noise` (2, 2) m², and the NIS.

    `weights` (4,) are those of the sides.
    """
    sides = np.flatnonzero(weights)
    posteriors = [_of_side(estimate, point, noise, side) for side in sides]
    logarithms = np.log(weights[sides]) + [one[1] for one in posteriors]
    shares = np.exp(logarithms - logarithms.max())
    shares /= shares.sum()
    parts = [np.stack(part) for part in zip(*(one[0] for one in posteriors), strict=True)]
    kinematic, shape = (kalman.mixture(shares, *parts[i : i + 2]) for i in (0, 2))
    shape[0][1:] = np.maximum(shape[0][1:], LEAST_SIZE)
    return Estimate(*kinematic, *shape), posteriors[int(shares.argmax())][2]


def _of_side(
    estimate: Estimate, point: np.ndarray, noise: np.ndarray, side: int
) -> tuple[Estimate, float, float]:
    """Posterior if the `point` is of this `side`, its log likelihood and its NIS."""
    state, covariance, shape, shape_covariance = estimate
    turn = rotation(shape[0])
    matrix = turn * shape[1:]
    # Derivatives of S's elements by the shape, (2, 2, 3).
    slopes = np.zeros((2, 2, 3))
    slopes[..., 0] = turn @ rotation(QUARTER) * shape[1:]
    slopes[:, 0, 1], slopes[:, 1, 2] = turn.T
    middle, variances = MIDDLES[side], VARIANCES[side]
    spreads = variances + middle**2, slopes, shape_covariance, slopes
    of_shape = np.einsum("h,ahp,pq,bhq->ab", *spreads)
    noise = (matrix * variances) @ matrix.T + of_shape + noise
    spread = covariance[:2, :2] + noise
    innovation = point - state[:2] - matrix @ middle
    correction, updated, distance = kalman.correct(covariance, kalman.PLACE, noise, innovation)

    # The squares of the innovation: their mean and covariance, and their slope by the shape.
    i, j = SQUARES
    squares = innovation[i] * innovation[j] - spread[i, j]
    firsts, seconds = i[:, None], j[:, None]
    moments = spread[firsts, i] * spread[seconds, j] + spread[firsts, j] * spread[seconds, i]
    products = np.einsum("ah,h,bhp->abp", matrix, variances, slopes)
    jacobian = products[i, j] + products[j, i]
    shape_gain = np.linalg.solve(moments, jacobian @ shape_covariance).T
    of_shape = shape_covariance - shape_gain @ jacobian @ shape_covariance
    posterior = Estimate(state + correction, updated, shape + shape_gain @ squares, of_shape)
    return posterior, -0.5 * (distance + float(np.log(np.linalg.det(spread)))), distance
