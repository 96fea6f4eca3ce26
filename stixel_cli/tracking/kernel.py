"""The periodic Gaussian process that a star-convex contour's radius is drawn from.

Frame: angles are in the target's frame, counter-clockwise from the heading, rad; radii in m.

Source: Wahlström & Özkan 2015, *Extended target tracking using Gaussian processes*, section III;
thesis (53)-(54), (58), (77), as corrected: the length scale divides the whole exponent, and the
measurement noise is no part of R^f. The recursion on basis points is Huber 2014, *Recursive
Gaussian process*.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike


def kernel(
    angles: ArrayLike, other_angles: ArrayLike, length_scale: float, sigma_f: float, sigma_r: float
) -> np.ndarray:
    """k(u, u') = sigma_f² exp(-2 sin²((u - u') / 2) / l²) + sigma_r², shape (n, m), m².

    `angles` (n,) and `other_angles` (m,) in rad. The second term is the unknown mean radius.
    """
    half = 0.5 * (np.asarray(angles)[:, None] - np.asarray(other_angles)[None, :])
    return sigma_f**2 * np.exp(-2.0 * np.sin(half) ** 2 / length_scale**2) + sigma_r**2


@dataclass(frozen=True)
class ContourProcess:
    """The process, and what regression from its basis points needs at every scan."""

    basis_points: int
    """N, at even angles."""
    length_scale: float
    sigma_f: float
    sigma_r: float
    """`length_scale`, `sigma_f`, `sigma_r`: of the kernel; rad, m, m."""
    jitter: float = 1e-6
    """In m²; goes only into the inverse of K."""

    @cached_property
    def basis_angles(self) -> np.ndarray:
        """u^f (N,) rad, even in [0, 2 pi)."""
        return 2.0 * np.pi * np.arange(self.basis_points) / self.basis_points

    @cached_property
    def basis_directions(self) -> np.ndarray:
        """Unit vectors (cos u^f, sin u^f), (N, 2)."""
        return np.stack([np.cos(self.basis_angles), np.sin(self.basis_angles)], axis=-1)

    @cached_property
    def covariance(self) -> np.ndarray:
        """K = k(u^f, u^f), (N, N) m², without jitter."""
        angles = self.basis_angles
        return kernel(angles, angles, self.length_scale, self.sigma_f, self.sigma_r)

    @cached_property
    def inverse(self) -> np.ndarray:
        """(K + jitter I)⁻¹, (N, N).

        Raises:
            numpy.linalg.LinAlgError: if the jitter is too small for K to be inverted.
        """
        from scipy.linalg import cho_factor, cho_solve

        identity = np.eye(self.basis_points)
        inverse = cho_solve(cho_factor(self.covariance + self.jitter * identity), identity)
        return 0.5 * (inverse + inverse.T)

    @cached_property
    def _harmonics(self) -> np.ndarray:
        """(3, N) constant, cosine and sine at the basis angles, by the scales in `radius`."""
        slope = (self.sigma_f / self.length_scale) ** 2
        cosines, sines = slope * self.basis_directions.T
        return np.stack([np.full(self.basis_points, self.sigma_f**2), cosines, sines])

    @cached_property
    def _weights(self) -> tuple[np.ndarray, np.ndarray]:
        return self.sigma_f**2 * self.inverse, self.sigma_r**2 * self.inverse.sum(axis=0)

    def correlations(self, directions: np.ndarray) -> np.ndarray:
        """exp(-2 sin²((u - u^f_i) / 2) / l²), shape (n, N).

        `directions` (n, 2) = (cos u, sin u). As -2 sin²(x / 2) = cos x - 1, the exponent is a
        matrix product of rank two.
        """
        exponent = (directions / self.length_scale**2) @ self.basis_directions.T
        exponent -= 1.0 / self.length_scale**2
        return np.exp(exponent, out=exponent)

    def regression(self, correlations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """H^f(u), shape (n, N), and R^f(u), shape (n,) in m²; thesis (58).

        H^f = k(u, u^f) K⁻¹ and R^f = k(u, u) - k(u, u^f) K⁻¹ k(u^f, u), from the `correlations`
        (n, N) of the directions.
        """
        weights, offset = self._weights
        matrix = correlations @ weights
        matrix += offset
        explained = self.sigma_f**2 * np.einsum("ij,ij->i", correlations, matrix)
        explained += self.sigma_r**2 * (matrix @ np.ones(matrix.shape[1]))
        # Only rounding makes it negative, at a basis angle.
        variance = np.maximum(self.sigma_f**2 + self.sigma_r**2 - explained, 0.0)
        return matrix, variance

    def radius(
        self, directions: np.ndarray, correlations: np.ndarray, radii: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """f = H^f x^f (…, n) m and its slope (∂H^f / ∂u) x^f (…, n) m/rad; thesis (58), (77i).

        For the `radii` (…, N) m of the basis points. `correlations` (n, N) are those of
        `directions` (n, 2). As sin(u - u_i) = sin u cos u_i - cos u sin u_i, no second kernel
        matrix is needed.
        """
        # The inverse is symmetric.
        coefficients = radii @ self.inverse
        sums = (coefficients[..., None, :] * self._harmonics) @ correlations.T
        mean = self.sigma_r**2 * coefficients.sum(axis=-1, keepdims=True)
        slope = directions[:, 0] * sums[..., 2, :] - directions[:, 1] * sums[..., 1, :]
        return mean + sums[..., 0, :], slope

    def at(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """H^f (n, N) and R^f (n,) in m² at `angles` (n,) rad."""
        directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return self.regression(self.correlations(directions))
