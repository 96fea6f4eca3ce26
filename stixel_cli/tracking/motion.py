"""Constant velocity and turn rate for the pose, forgetting for the radii; thesis (62), (72).

State order: x, y, heading, their three rates, then the N radii. Units m, rad, s.
"""

import numpy as np

POSE, RATES = np.arange(3), np.arange(3, 6)
"""Indices of the pose and its rates in the state."""


def intervals(times: np.ndarray) -> np.ndarray:
    """Time in s from each scan's predecessor, shape (K,).

    A track is predicted to the first scan too, from one sample before it, so the first interval
    counts twice. A single scan has no sample time: 0.
    """
    times = np.asarray(times, dtype=np.float64)
    steps = np.diff(times)
    return np.concatenate([steps[:1] if len(steps) else np.zeros(min(len(times), 1)), steps])


def transition(interval: float) -> np.ndarray:
    """F̄ = [[1, T], [0, 1]] ⊗ I₃, shape (6, 6)."""
    matrix = np.eye(6)
    matrix[POSE, RATES] = interval
    return matrix


def process_noise(interval: float, sigma_q: float, sigma_q_psi: float) -> np.ndarray:
    """Q̄ = [[T³/3, T²/2], [T²/2, T]] ⊗ diag(sigma_q², sigma_q², sigma_q_psi²), shape (6, 6)."""
    noise = np.zeros((6, 6))
    densities = np.array([sigma_q, sigma_q, sigma_q_psi]) ** 2
    noise[POSE, POSE] = interval**3 / 3.0 * densities
    noise[POSE, RATES] = noise[RATES, POSE] = interval**2 / 2.0 * densities
    noise[RATES, RATES] = interval * densities
    return noise


def velocity_across(mean: np.ndarray) -> tuple[float, np.ndarray]:
    """The velocity across the heading, m/s, to the left, and its derivative (d,) by the state."""
    cosine, sine = np.cos(mean[2]), np.sin(mean[2])
    row = np.zeros(len(mean))
    row[2:5] = -cosine * mean[3] - sine * mean[4], -sine, cosine
    return cosine * mean[4] - sine * mean[3], row


def tied_to_velocity(
    mean: np.ndarray, covariance: np.ndarray, slip: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean (d,) and covariance (d, d) of a target that slides sideways by 0 ± `slip` m/s.

    A road user moves along its heading: the velocity across it is measured as zero, which turns
    heading and velocity towards each other. Also the gain (d,) of that measurement.
    """
    across, row = velocity_across(mean)
    spread = covariance @ row
    gain = spread / (row @ spread + slip**2)
    return mean - gain * across, covariance - np.outer(gain, spread), gain


def predict(
    mean: np.ndarray,
    covariance: np.ndarray,
    interval: float,
    noise: np.ndarray,
    forgetting_rate: float,
    radii_covariance: np.ndarray,
    mean_radius: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (6 + N,) and covariance (6 + N, 6 + N) one `interval` in s later; thesis (71), (75).

    F^f = e^(-alpha T) I and Q^f = (1 - e^(-2 alpha T)) K, with `forgetting_rate` alpha in 1/s and
    `radii_covariance` K (N, N) in m². The radii return to `mean_radius`, m. `noise` is Q̄. F is
    never formed: it scales blocks.
    """
    decay = np.exp(-forgetting_rate * interval)
    pose = transition(interval)
    radii = mean_radius + decay * (mean[6:] - mean_radius)
    predicted_mean = np.concatenate([pose @ mean[:6], radii])
    predicted = np.empty_like(covariance)
    predicted[:6, :6] = pose @ covariance[:6, :6] @ pose.T + noise
    cross = decay * (pose @ covariance[:6, 6:])
    predicted[:6, 6:] = cross
    predicted[6:, :6] = cross.T
    np.multiply(covariance[6:, 6:], decay**2, out=predicted[6:, 6:])
    if forgetting_rate > 0.0:
        predicted[6:, 6:] += -np.expm1(-2.0 * forgetting_rate * interval) * radii_covariance
    return predicted_mean, predicted
