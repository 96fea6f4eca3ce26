"""A Kalman update with independent errors, in information form: no covariance is inverted."""

import numpy as np


def condition(
    covariance: np.ndarray, matrix: np.ndarray, noise: np.ndarray, innovation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float, float]:
    """`correct`, and the NIS and the logarithm of the density of the `innovation` (n,)."""
    correction, posterior, scale = correct(covariance, matrix, noise, innovation)
    pull = matrix.T @ (innovation / noise)
    nis = innovation @ (innovation / noise) - pull @ correction
    determinant = np.linalg.slogdet(scale)[1] + np.log(noise).sum()
    density = -0.5 * (nis + determinant + len(innovation) * np.log(2.0 * np.pi))
    return correction, posterior, float(nis), float(density)


def correct(
    covariance: np.ndarray, matrix: np.ndarray, noise: np.ndarray, innovation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A Kalman update with independent errors: correction (d,), covariance (d, d), I + P Hᵀ R⁻¹ H.

    `covariance` (d, d) is the prior's, `matrix` (n, d) the measurement's, `noise` (n,) variances,
    which must be far above rounding. In the information form the cost grows with n and not with n³.
    """
    weighted = matrix.T / noise
    scale = np.eye(len(covariance)) + covariance @ (weighted @ matrix)
    try:
        posterior = np.linalg.solve(scale, covariance)
    except np.linalg.LinAlgError:
        # Singular by rounding, after a gap of years.
        posterior = np.linalg.pinv(scale) @ covariance
    posterior = 0.5 * (posterior + posterior.T)
    return posterior @ (weighted @ innovation), posterior, scale
