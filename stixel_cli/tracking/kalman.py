"""Kalman updates: of a measured place, and of many scalars with independent errors.

The latter is in information form, so no covariance is inverted.
"""

import numpy as np

PLACE = np.eye(2, 4)
"""The place as a function of the four states of place and velocity."""


def correct(
    covariance: np.ndarray, matrix: np.ndarray, noise: np.ndarray, innovation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """A Kalman update with independent errors: correction (d,), covariance (d, d) and NIS.

    `covariance` (d, d) is the prior's, `matrix` (n, d) the measurement's, `noise` (n,) variances,
    which must be far above rounding. In the information form the cost grows with n and not with n³.
    """
    weighted = matrix.T / noise
    posterior = np.linalg.solve(_scale(covariance, weighted @ matrix), covariance)
    posterior, pull = 0.5 * (posterior + posterior.T), weighted @ innovation
    correction = posterior @ pull
    return correction, posterior, float(innovation @ (innovation / noise) - pull @ correction)


def normalised_innovation_squared(
    covariance: np.ndarray, matrix: np.ndarray, noise: np.ndarray, innovation: np.ndarray
) -> tuple[float, float]:
    """NIS of an `innovation` (n,), and the logarithm of its density; the others as of `correct`."""
    weighted = matrix.T / noise
    scale, pull = _scale(covariance, weighted @ matrix), weighted @ innovation
    nis = innovation @ (innovation / noise) - pull @ np.linalg.solve(scale, covariance @ pull)
    volume = np.log(2.0 * np.pi * noise).sum() + np.linalg.slogdet(scale)[1]
    return float(nis), float(-0.5 * (nis + volume))


def _scale(covariance: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """I + P Hᵀ R⁻¹ H: the prior's covariance (d, d) is so many times that of the posterior."""
    scale = covariance @ precision
    scale.flat[:: len(scale) + 1] += 1.0
    return scale


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    innovation: np.ndarray,
    noise: np.ndarray,
    matrix: np.ndarray = PLACE,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean (4,), covariance (4, 4) and NIS with an `innovation` (2,) m of covariance `noise` m².

    `matrix` (2, 4) is the measurement's derivative by the state of place and velocity. The
    covariance is updated in Joseph's form, which keeps it positive.
    """
    innovation_covariance = matrix @ covariance @ matrix.T + noise
    gain = np.linalg.solve(innovation_covariance, matrix @ covariance).T
    keep = np.eye(4) - gain @ matrix
    updated = keep @ covariance @ keep.T + gain @ noise @ gain.T
    nis = float(innovation @ np.linalg.solve(innovation_covariance, innovation))
    return mean + gain @ innovation, 0.5 * (updated + updated.T), nis


def mixture(
    shares: np.ndarray, means: np.ndarray, covariances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (d,) and covariance (d, d) of n Gaussians with `shares` (n,), whose sum is 1.

    Their `means` are (n, d), their `covariances` (n, d, d).
    """
    mean = shares @ means
    away = means - mean
    whole = np.einsum("j,jab->ab", shares, covariances + away[:, :, None] * away[:, None, :])
    return mean, 0.5 * (whole + whole.T)
