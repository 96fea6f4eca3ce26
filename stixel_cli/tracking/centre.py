"""The centre of a target: a Kalman filter of constant velocity on a measured place.

State: x, y and their rates, m and m/s, world frame. A white acceleration moves the target:
Bar-Shalom, Li & Kirubarajan 2001, chapter 5 and (6.2.2).
"""

import numpy as np

from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.tracking.motion import process_noise, transition

MOVING = np.array([0, 1, 3, 4])
"""Indices of x, y and their rates in a track's first six states."""

PLACE = np.eye(2, 4)
"""The place as a function of the four states."""

GREATEST_VARIANCE = np.pi**2 / 3.0
"""Variance of an angle that is quite unknown, rad²: even over a full turn."""


def predict(
    mean: np.ndarray, covariance: np.ndarray, interval: float, sigma_q: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (4,) and covariance (4, 4) one `interval` in s on: thesis (62) without the heading."""
    chosen = np.ix_(MOVING, MOVING)
    matrix = transition(interval)[chosen]
    noise = process_noise(interval, sigma_q, 0.0)[chosen]
    return matrix @ mean, matrix @ covariance @ matrix.T + noise


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    innovation: np.ndarray,
    noise: np.ndarray,
    matrix: np.ndarray = PLACE,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean (4,), covariance (4, 4) and NIS with an `innovation` (2,) m of covariance `noise` m².

    `matrix` (2, 4) is the measurement's derivative by the state. The covariance is updated in
    Joseph's form, which keeps it positive.
    """
    innovation_covariance = matrix @ covariance @ matrix.T + noise
    gain = np.linalg.solve(innovation_covariance, matrix @ covariance).T
    keep = np.eye(4) - gain @ matrix
    updated = keep @ covariance @ keep.T + gain @ noise @ gain.T
    nis = float(innovation @ np.linalg.solve(innovation_covariance, innovation))
    return mean + gain @ innovation, 0.5 * (updated + updated.T), nis


def six_states(
    mean: np.ndarray,
    covariance: np.ndarray,
    heading: tuple[float, float],
    interval: float,
    sigma_q: float,
    least_speed: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (6,) and covariance (6, 6) of x, y, heading and their rates, as a track has them.

    The heading is the velocity's direction; below `least_speed`, m/s, it is kept, with its
    variance. Motion is straight, so the rate of the heading is 0; its variance is that of the mean
    rate over one `interval`, s, which the white acceleration across the motion makes,
    sigma_q² / (T v²). The covariance of the six is linearised at the mean.

    `heading` is that of the scan before, rad, and its variance, rad². The heading is unwound: no
    jump of a full turn is between two scans. No variance of an angle exceeds that of one which is
    unknown, and a rate's is bounded by the same number in rad²/s².
    """
    velocity = mean[2:]
    speed = float(np.hypot(*velocity))
    # Rows of x, y, heading and their rates as functions of the four.
    matrix = np.zeros((6, 4))
    matrix[MOVING, np.arange(4)] = 1.0
    kept_variance = 0.0
    if speed >= least_speed:
        turned = wrap_angle(np.arctan2(velocity[1], velocity[0]) - heading[0])
        angle = heading[0] + float(turned)
        slope = np.array([-velocity[1], velocity[0]]) / speed**2
        variance = float(slope @ covariance[2:, 2:] @ slope)
        matrix[2, 2:] = slope / np.sqrt(max(1.0, variance / GREATEST_VARIANCE))
    else:
        angle, kept_variance = heading
    states = np.zeros(6)
    states[MOVING], states[2] = mean, angle
    spread = matrix @ covariance @ matrix.T
    spread[2, 2] += kept_variance
    least = max(speed, least_speed)
    rate_variance = sigma_q**2 / (interval * least**2) if interval > 0.0 else np.inf
    spread[5, 5] = min(rate_variance, GREATEST_VARIANCE)
    return states, spread
