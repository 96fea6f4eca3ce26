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

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.kalman import correct
from stixel_cli.tracking.kernel import ContourProcess

SEEN = 3
"""The first states, the pose, are seen by a point; then come three rates, which are not."""


@dataclass(frozen=True)
class Linearisation:
    """The measurement model at n points, in each point's radial and tangential direction."""

    directions: np.ndarray
    """(n, 2) unit vectors p from the centre to the points, world frame."""
    residuals: np.ndarray
    """(n,) m, r - f, along p."""
    radial_matrix: np.ndarray
    """(n, 3 + N) derivatives of the radial component of h by x, y, heading and the radii."""
    tangential_slopes: np.ndarray
    """(n,) 1 - f / r: the tangential component's derivative by x^c is this times t = (-p_y,
    p_x)."""
    radius_variances: np.ndarray
    """(n,) R^f in m²."""
    turns: np.ndarray
    """(n,) f' / r, the slope of the radius over the point's distance, 1/rad."""

    @property
    def gradients(self) -> np.ndarray:
        """g (n, 2) = p - (f' / r) t, world frame: how far a residual changes as its point moves.

        The innovation of a point z is v = ‖z - x^c‖ - f(∠(z - x^c) - psi), a scalar.
        """
        px, py = self.directions.T
        return self.directions - self.turns[:, None] * np.stack([-py, px], axis=-1)

    @property
    def state_matrix(self) -> np.ndarray:
        """H (n, 6 + N): `radial_matrix` with columns of zeros for the rates."""
        matrix = np.zeros((len(self.residuals), self.radial_matrix.shape[1] + SEEN))
        matrix[:, :SEEN] = self.radial_matrix[:, :SEEN]
        matrix[:, 2 * SEEN :] = self.radial_matrix[:, SEEN:]
        return matrix


def linearise(points_world: np.ndarray, mean: np.ndarray, process: ContourProcess) -> Linearisation:
    """The model of the points `points_world` (n, 2) at a `mean` (6 + N,); thesis (65)-(77).

    No point may coincide with the centre.
    """
    deviations = mean[2 * SEEN :] - process.mean_radius
    offsets = points_world - mean[:2]
    distances = np.hypot(offsets[:, 0], offsets[:, 1])
    directions = offsets / distances[:, None]
    # u = θ - ψ as a direction: no angle is needed.
    directions_target = directions @ rotation(mean[2])
    correlations = process.correlations(directions_target)
    matrix = np.empty((len(points_world), SEEN + len(deviations)))
    _, variances = process.regression(correlations, out=matrix[:, SEEN:])
    expected = process.mean_radius + matrix[:, SEEN:] @ deviations
    slopes = process.slope(directions_target, correlations, deviations)
    fill_pose_columns(matrix, directions, distances, slopes)
    return Linearisation(
        directions=directions,
        residuals=distances - expected,
        radial_matrix=matrix,
        tangential_slopes=1.0 - expected / distances,
        radius_variances=variances,
        turns=slopes / distances,
    )


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    model: Linearisation,
    variance: float,
    tangential: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Posterior mean (6 + N,), covariance, gain and NIS of a scan; thesis (76), information form.

    `mean` and `covariance` are the *predicted* ones, `model` is that of n points at them, each with
    the same `variance`, m², in all directions. `tangential`: whether the rows that measure nothing
    count, as in [GP]. The gain (6 + N, n) is that of the radial residuals.
    """
    own = np.full(len(model.residuals), variance)
    matrix, noise, innovation = model.state_matrix, own + model.radius_variances, model.residuals
    radial = len(own)
    if tangential:
        rows = np.zeros_like(matrix)
        rows[:, 0] = -model.directions[:, 1] * model.tangential_slopes
        rows[:, 1] = model.directions[:, 0] * model.tangential_slopes
        matrix, noise = np.vstack([matrix, rows]), np.concatenate([noise, own])
        innovation = np.concatenate([innovation, np.zeros(radial)])
    correction, posterior, nis = correct(covariance, matrix, noise, innovation)
    gain = posterior @ (matrix[:radial].T / noise[:radial])
    return mean + correction, posterior, gain, nis


def fill_pose_columns(
    matrix: np.ndarray, directions: np.ndarray, distances: np.ndarray, slopes: np.ndarray
) -> None:
    """Write the derivatives by x, y and heading into the first columns of `matrix` (…, n, 3 + N).

    Of points at `distances` (…, n) m from the centre in `directions` (…, n, 2), where the slope of
    the radius is `slopes` (…, n) m/rad; thesis (77).
    """
    turn = slopes / distances
    # dθ/dw = (delta_y, -delta_x) / r² = (p_y, -p_x) / r
    np.add(directions[..., 0], turn * directions[..., 1], out=matrix[..., 0])
    np.subtract(directions[..., 1], turn * directions[..., 0], out=matrix[..., 1])
    np.negative(slopes, out=matrix[..., 2])
