"""The update of the tracker `gp_ekf`: a scan's points on a Gaussian process contour.

For a point z with delta = z - x^c, r = ‖delta‖, p = delta / r and t ⊥ p, the innovation is
v = z - h(x) = p (r - f), with f = H^f x^f: it has no component along t. In the basis (p, t) the
Jacobian of thesis (77) is

    radial row:      p + g dθ/dw  |  -g  |  0  |  H^f        with g = (∂H^f / ∂u) x^f
    tangential row:  t (1 - f/r)  |   0  |  0  |  0

because p ⊥ ∂p/∂w. So a scan of n points is n radial rows of all states. The n tangential ones have
an innovation that is zero by construction and measures nothing; [GP] and the thesis count them.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.kalman import correct
from stixel_cli.tracking.kernel import ContourProcess


@dataclass(frozen=True)
class Linearisation:
    """The measurement model at n points, in each point's radial and tangential direction."""

    directions: np.ndarray
    """(n, 2) unit vectors p from the centre to the points, world frame."""
    distances: np.ndarray
    """(n,) m, r."""
    residuals: np.ndarray
    """(n,) m, r - f, along p."""
    pose_matrix: np.ndarray
    """(n, 3) derivatives of the radial component of h by x, y and heading."""
    process: ContourProcess
    directions_target: np.ndarray
    """(n, 2) of the points in the target's frame."""
    correlations: np.ndarray
    """(n, N) of these with those of the `process`."""

    @property
    def gradients(self) -> np.ndarray:
        """g (n, 2) = p - (f' / r) t, world frame: how far a residual changes as its point moves.

        The innovation of a point z is v = ‖z - x^c‖ - f(∠(z - x^c) - psi), a scalar.
        """
        return self.pose_matrix[:, :2]

    @cached_property
    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """H (n, 6 + N), the derivatives of the radial component of h, and R^f (n,) in m²."""
        regression, variances = self.process.regression(self.correlations)
        rows = np.zeros((len(regression), 6 + regression.shape[1]))
        rows[:, :3], rows[:, 6:] = self.pose_matrix, regression
        return rows, variances


def linearise(points_world: np.ndarray, mean: np.ndarray, process: ContourProcess) -> Linearisation:
    """The model of the points `points_world` (n, 2) at a `mean` (6 + N,); thesis (65)-(77).

    No point may coincide with the centre.
    """
    offsets = points_world - mean[:2]
    distances = np.hypot(offsets[:, 0], offsets[:, 1])
    directions = offsets / distances[:, None]
    # u = θ - ψ as a direction: no angle is needed.
    directions_target = directions @ rotation(mean[2])
    correlations = process.correlations(directions_target)
    radii, slopes = process.radius(directions_target, correlations, mean[6:])
    by_pose = pose_derivatives(directions, distances, slopes)
    return Linearisation(
        directions, distances, distances - radii, by_pose, process, directions_target, correlations
    )


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    model: Linearisation,
    variance: np.ndarray | float,
    tangential: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Posterior mean (6 + N,), covariance, gain and NIS of a scan; thesis (76), information form.

    `mean` and `covariance` are the *predicted* ones, `model` is that of n points at them, with the
    `variance` (n,) m² of each or of all, in all directions. `tangential`: whether the rows that
    measure nothing count, as in [GP]. The gain (6 + N, n) is that of the radial residuals.
    """
    own = np.broadcast_to(variance, len(model.residuals))
    (matrix, variances), innovation = model.rows, model.residuals
    noise, radial = own + variances, len(own)
    if tangential:
        # The derivative by x^c is 1 - f / r times t = (-p_y, p_x).
        rows, slopes = np.zeros_like(matrix), innovation / model.distances
        rows[:, 0], rows[:, 1] = -model.directions[:, 1] * slopes, model.directions[:, 0] * slopes
        matrix, noise = np.vstack([matrix, rows]), np.concatenate([noise, own])
        innovation = np.concatenate([innovation, np.zeros(radial)])
    correction, posterior, nis = correct(covariance, matrix, noise, innovation)
    gain = posterior @ (matrix[:radial].T / noise[:radial])
    return mean + correction, posterior, gain, nis


def pose_derivatives(
    directions: np.ndarray, distances: np.ndarray, slopes: np.ndarray
) -> np.ndarray:
    """Derivatives (…, n, 3) of the radial component of h by x, y and heading; thesis (77).

    Of points at `distances` (…, n) m from the centre in `directions` (…, n, 2), where the slope of
    the radius is `slopes` (…, n) m/rad.
    """
    turn, matrix = slopes / distances, np.empty((*slopes.shape, 3))
    # dθ/dw = (delta_y, -delta_x) / r² = (p_y, -p_x) / r
    matrix[..., 0] = directions[..., 0] + turn * directions[..., 1]
    matrix[..., 1] = directions[..., 1] - turn * directions[..., 0]
    matrix[..., 2] = -slopes
    return matrix
