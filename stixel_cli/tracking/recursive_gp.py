"""Recursive Gaussian process regression of a fixed contour; thesis section 5.4.2 and (57)-(60).

The radius as a function of the angle is learnt from noisy values that come batch by batch, in a
filter whose state is the radius at the basis angles: Huber 2014, *Recursive Gaussian process*.
"""

import numpy as np

from stixel_cli.tracking.kernel import ContourProcess


def start(process: ContourProcess) -> tuple[np.ndarray, np.ndarray]:
    """Mean (N,) m and covariance (N, N) m² before any value: x^f ~ N(0, K)."""
    return np.zeros(len(process.basis_angles)), process.covariance.copy()


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    angles: np.ndarray,
    radii: np.ndarray,
    std: float,
    process: ContourProcess,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (N,) m and covariance (N, N) m² with a batch of values.

    `radii` (n,) m were measured at `angles` (n,) rad with a standard `std` in m:
    r = H^f x^f + e with e ~ N(0, R^f + R), and the values of a batch are taken as independent given
    the basis points, thesis (49).
    """
    matrix, variances = process.at(angles)
    innovation_covariance = matrix @ covariance @ matrix.T + np.diag(variances + std**2)
    gain = np.linalg.solve(innovation_covariance, matrix @ covariance).T
    updated = covariance - gain @ innovation_covariance @ gain.T
    return mean + gain @ (radii - matrix @ mean), 0.5 * (updated + updated.T)


def radius(
    mean: np.ndarray, covariance: np.ndarray, angles: np.ndarray, process: ContourProcess
) -> tuple[np.ndarray, np.ndarray]:
    """Radius (n,) and its standard deviation (n,) in m at `angles` (n,) rad."""
    matrix, variances = process.at(angles)
    spread = np.einsum("ij,ij->i", matrix @ covariance, matrix)
    return matrix @ mean, np.sqrt(np.maximum(spread, 0.0) + variances)
