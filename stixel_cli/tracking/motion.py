"""Constant velocity and turn rate for the pose, forgetting for the radii; thesis (62), (72).

State order: x, y, heading, their three rates, then the N radii. Units m, rad, s. A target without a
heading of its own has the four states `MOVING`, moved by a white acceleration: Bar-Shalom, Li &
Kirubarajan 2001, chapter 5 and (6.2.2).
"""

import numpy as np

from stixel_cli.geometry.pose import wrap_angle

MOVING = np.array([0, 1, 3, 4])
"""Indices of x, y and their rates in a track's first six states."""

GREATEST_VARIANCE = np.pi**2 / 3.0
"""Variance of an angle that is quite unknown, rad²: even over a full turn."""

LEAST_SPEED = 0.5
"""Below it, m/s, a velocity does not tell where a road user is headed, nor whether it moves."""

LONGEST_GAP = 100.0
"""s after which nobody knows where a road user is: a covariance that grew on, for years, would be
beyond what can be inverted."""


def intervals(times: np.ndarray) -> np.ndarray:
    """Time in s from each scan's predecessor, shape (K,).

    A track is predicted to the first scan too, from one sample before it, so the first interval
    counts twice. A single scan has no sample time: 0. A longer gap counts as `LONGEST_GAP`.
    """
    times = np.asarray(times, dtype=np.float64)
    steps = np.minimum(np.diff(times), LONGEST_GAP)
    return np.concatenate([steps[:1] if len(steps) else np.zeros(min(len(times), 1)), steps])


def transition(interval: float) -> np.ndarray:
    """F̄ = [[1, T], [0, 1]] ⊗ I₃, shape (6, 6)."""
    return np.eye(6) + interval * np.eye(6, k=3)


def process_noise(interval: float, sigma_q: float, sigma_q_psi: float) -> np.ndarray:
    """Q̄ = [[T³/3, T²/2], [T²/2, T]] ⊗ diag(sigma_q², sigma_q², sigma_q_psi²), shape (6, 6)."""
    cross = interval**2 / 2.0
    densities = np.array([sigma_q, sigma_q, sigma_q_psi]) ** 2
    return np.kron([[interval**3 / 3.0, cross], [cross, interval]], np.diag(densities))


def tied_to_velocity(
    mean: np.ndarray, covariance: np.ndarray, slip: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Mean (d,) and covariance (d, d) of a target that slides sideways by 0 ± `slip` m/s.

    A road user moves along its heading: the velocity across it is measured as zero, which turns
    heading and velocity towards each other. Also that measurement's gain (d,) and row (d,).
    """
    cosine, sine = np.cos(mean[2]), np.sin(mean[2])
    across = cosine * mean[4] - sine * mean[3]
    row = np.zeros(len(mean))
    row[2:5] = -cosine * mean[3] - sine * mean[4], -sine, cosine
    spread = covariance @ row
    gain = spread / (row @ spread + slip**2)
    return mean - gain * across, covariance - np.outer(gain, spread), gain, row


def predict(
    mean: np.ndarray,
    covariance: np.ndarray,
    interval: float,
    noise: np.ndarray,
    forgetting_rate: float,
    radii_covariance: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (6 + N,) and covariance (6 + N, 6 + N) one `interval` in s later; thesis (71), (75).

    F^f = e^(-alpha T) I and Q^f = (1 - e^(-2 alpha T)) K, with `forgetting_rate` alpha in 1/s and
    the `radii_covariance` K (N, N) m². `noise` is Q̄. F is never formed: it scales blocks.
    """
    decay = np.exp(-forgetting_rate * interval)
    pose = transition(interval)
    predicted_mean = np.concatenate([pose @ mean[:6], decay * mean[6:]])
    predicted = np.empty_like(covariance)
    predicted[:6, :6] = pose @ covariance[:6, :6] @ pose.T + noise
    cross = decay * (pose @ covariance[:6, 6:])
    predicted[:6, 6:] = cross
    predicted[6:, :6] = cross.T
    np.multiply(covariance[6:, 6:], decay**2, out=predicted[6:, 6:])
    if forgetting_rate > 0.0:
        predicted[6:, 6:] += -np.expm1(-2.0 * forgetting_rate * interval) * radii_covariance
    return predicted_mean, predicted


def predict_place(
    mean: np.ndarray, covariance: np.ndarray, interval: float, sigma_q: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (4,) and covariance (4, 4) one `interval` in s on: thesis (62) without the heading."""
    chosen = np.ix_(MOVING, MOVING)
    matrix = transition(interval)[chosen]
    noise = process_noise(interval, sigma_q, 0.0)[chosen]
    return matrix @ mean, matrix @ covariance @ matrix.T + noise


def six_states(
    mean: np.ndarray,
    covariance: np.ndarray,
    heading: tuple[float, float],
    interval: float,
    sigma_q: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (6,) and covariance (6, 6) of x, y, heading and their rates, as a track has them.

    The heading is the velocity's direction; below `LEAST_SPEED` it is kept, with its
    variance. Motion is straight, so the rate of the heading is 0. The variance of its mean over an
    `interval` T, s, is sigma_q² / (T v²) at a speed v, by a white acceleration across the motion.
    The covariance of the six is linearised at the mean.

    `heading` is that of the scan before, rad, and its variance, rad². The heading is unwound: no
    jump of a full turn is between two scans. No variance of an angle exceeds that of one which is
    unknown.
    """
    velocity = mean[2:]
    speed = float(np.hypot(*velocity))
    # Rows of x, y, heading and their rates as functions of the four.
    matrix = np.zeros((6, 4))
    matrix[MOVING, np.arange(4)] = 1.0
    angle, kept_variance = heading
    if speed >= LEAST_SPEED:
        angle += float(wrap_angle(np.arctan2(velocity[1], velocity[0]) - angle))
        kept_variance = 0.0
        slope = np.array([-velocity[1], velocity[0]]) / speed**2
        variance = float(slope @ covariance[2:, 2:] @ slope)
        matrix[2, 2:] = slope / np.sqrt(max(1.0, variance / GREATEST_VARIANCE))
    states = np.zeros(6)
    states[MOVING], states[2] = mean, angle
    spread = matrix @ covariance @ matrix.T
    spread[2, 2] += kept_variance
    turning = interval * max(speed, LEAST_SPEED) ** 2
    spread[5, 5] = min(sigma_q**2 / turning, GREATEST_VARIANCE) if turning else GREATEST_VARIANCE
    return states, spread
