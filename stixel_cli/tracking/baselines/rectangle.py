"""An extended Kalman filter on an oriented rectangle, with the sides that the sensor sees.

State: x, y, heading psi, their rates, length and width; world frame, m, rad, s. The pose moves as
in thesis (62), the size stays. The sensor sees one or two sides of the predicted rectangle. Each
point belongs to the nearest of them. With the side's outward normal n and the point q, both in the
target's frame, and half the length or width h, the measurement is

    nᵀ q - f h = 0 + error of the side + error of the point

f is the area of the class's shape over that of its box: the sides of a shape that is not a
rectangle are on average nearer to its middle. The error of a side, such as a bent one, is the same
for all its points in a scan, so n points are not n independent ones. The first and the last point
from right to left are near the corners where the rectangle ends for the sensor. With the unit
vector a across the ray through such a point z, towards the outside, and the corner c in the world,

    aᵀ (c - z) = half the distance of neighbouring rays + error

This makes the rest of the pose and the size observable. A road user does not slide sideways: the
velocity across the heading is measured as 0 ± slip. Rows with a large normalised innovation are
left out.
"""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.association import associate
from stixel_cli.tracking.baselines.rectangle_contour import contours_of
from stixel_cli.tracking.baselines.rectangle_sides import Rows, joined, measure, slip_row
from stixel_cli.tracking.kalman import condition
from stixel_cli.tracking.loop import Filtered
from stixel_cli.tracking.motion import process_noise, transition
from stixel_cli.tracking.prior import PriorShape, fullness_of
from stixel_cli.tracking.track import InitialState, Track


@parameters
class RectangleParameters:
    """An extended Kalman filter on an oriented rectangle, with the sides that the sensor sees.

    Attributes:
        sigma_q: process noise of the position, a white acceleration's root density, m/s^1.5.
        sigma_q_psi: process noise of the heading, rad/s^1.5.
        slip: standard deviation of the velocity across the heading, m/s.
        measurement_std: m, along each axis, added to the covariance of each point.
        side_std: standard deviation, m, of an error that all points on a side share in a scan.
        corner_std: standard deviation, m, of the place across the ray where the target ends.
        gate_probability: chi-square probability of the gates; null takes every point.
    """

    kind: Literal["rectangle"]
    sigma_q: Annotated[float, Ge(0), Le(100)]
    sigma_q_psi: Annotated[float, Ge(0), Le(100)]
    slip: Annotated[float, Gt(0), Le(100)]
    measurement_std: Annotated[float, Ge(1e-6), Le(10)]
    side_std: Annotated[float, Ge(1e-6), Le(10)]
    corner_std: Annotated[float, Ge(1e-6), Le(10)]
    gate_probability: Annotated[float, Gt(0), Lt(1)] | None


LEAST_SIZE = 0.1
"""Least length and width, m."""


def track(
    scans: Scans, initial: InitialState, prior: PriorShape, tracker: RectangleParameters
) -> Track:
    """Track one target through `scans`: predict, associate, update at every scan, the first too.

    The size starts as that of the class's `prior`. Reads no truth. The reported states are x, y,
    heading, their rates, length and width. Each point has one degree of freedom, each end of the
    target that is used has one, and so has the velocity across the heading.
    """
    size, fullness = np.array([prior.length, prior.width]), fullness_of(prior)
    mean = np.concatenate([initial.mean, size])
    covariance = np.zeros((8, 8))
    covariance[:6, :6] = initial.covariance
    covariance[6, 6], covariance[7, 7] = (size * [prior.length_std, prior.width_std]) ** 2

    filtered = Filtered(scans, 8)
    for scan in filtered:
        mean, covariance = predict(mean, covariance, scan.interval, tracker)
        noises, nis, degrees = scan.covariances + tracker.measurement_std**2 * np.eye(2), np.nan, 0
        turn = rotation(mean[2])
        area = turn @ np.diag(mean[6:] ** 2 / 12.0) @ turn.T
        spread = covariance[:2, :2] + area + noises
        indices = associate(scan.points, mean[:2], spread, tracker.gate_probability)
        if len(indices):
            measured = joined(
                measure(
                    mean,
                    scan.points[indices],
                    noises[indices],
                    scan.sensor,
                    fullness,
                    tracker.corner_std,
                    scans.field_of_view,
                ),
                slip_row(mean, tracker.slip),
            )
            kept = inside(covariance, measured, tracker)
            indices = indices[kept[: len(indices)]]
        if len(indices):
            measured = Rows(*(part[kept] for part in measured))
            mean, covariance, nis = update(mean, covariance, measured, tracker.side_std)
            degrees = len(measured.innovations)
        filtered.add(mean, covariance, indices, nis, degrees)
    return filtered.track(contours_of(*filtered.states, prior, tracker.side_std))


def predict(
    mean: np.ndarray, covariance: np.ndarray, interval: float, tracker: RectangleParameters
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (8,) and covariance (8, 8) one `interval` in s later; thesis (62), (72)."""
    matrix = np.eye(8)
    matrix[:6, :6] = transition(interval)
    predicted = matrix @ covariance @ matrix.T
    predicted[:6, :6] += process_noise(interval, tracker.sigma_q, tracker.sigma_q_psi)
    return matrix @ mean, predicted


def inside(covariance: np.ndarray, rows: Rows, tracker: RectangleParameters) -> np.ndarray:
    """Which rows (m,) have an innovation inside the gate."""
    if tracker.gate_probability is None:
        return np.ones(len(rows.innovations), bool)
    from scipy.special import chdtri

    whole = _with_sides(covariance, tracker.side_std)
    spread = np.einsum("mi,ij,mj->m", rows.matrix, whole, rows.matrix) + rows.variances
    return rows.innovations**2 <= chdtri(1, 1.0 - tracker.gate_probability) * spread


def _with_sides(covariance: np.ndarray, side_std: float) -> np.ndarray:
    """Covariance (12, 12) of the eight states and the errors of the four sides."""
    whole = side_std**2 * np.eye(12)
    whole[:8, :8] = covariance
    return whole


def update(
    mean: np.ndarray, covariance: np.ndarray, rows: Rows, side_std: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Posterior mean (8,), covariance (8, 8) and NIS.

    In information form: with the sides' errors as further states and D the rows' own variances,
    A = Hᵀ D⁻¹ H, P⁺ = (I + P A)⁻¹ P and vᵀ S⁻¹ v = vᵀ D⁻¹ v - (Hᵀ D⁻¹ v)ᵀ P⁺ (Hᵀ D⁻¹ v).
    """
    whole = _with_sides(covariance, side_std)
    correction, posterior, nis, _ = condition(whole, rows.matrix, rows.variances, rows.innovations)
    updated = mean + correction[:8]
    updated[6:] = np.maximum(updated[6:], LEAST_SIZE)
    return updated, posterior[:8, :8], nis
