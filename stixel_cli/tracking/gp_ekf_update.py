"""The update of the tracker `gp_ekf`: a scan's points on a Gaussian process contour.

For a point z with delta = z - x^c, r = ‖delta‖, p = delta / r and t ⊥ p, the innovation is
v = z - h(x) = p (r - f), with f = H^f x^f: it has no component along t. In the basis (p, t) the
Jacobian of thesis (77) is

    radial row:      p + g dθ/dw  |  -g  |  0  |  H^f        with g = (∂H^f / ∂u) x^f
    tangential row:  t (1 - f/r)  |   0  |  0  |  0

because p ⊥ ∂p/∂w. So a scan of n points is n radial rows of all states, and n tangential ones that
touch only the centre. With A = Hᵀ R⁻¹ H summed over the points and P = L Lᵀ,
P⁺ = L (I + Lᵀ A L)⁻¹ Lᵀ: O(n N²), and P, which is near singular, is never inverted.

SciPy is imported where it is used: it takes 0.2 s.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.kernel import ContourProcess

SEEN = 3
"""The first states, the pose, are seen by a point; then come three rates, which are not."""


@dataclass(frozen=True)
class Linearisation:
    """The measurement model at n points, in each point's radial and tangential direction.

    Attributes:
        directions: (n, 2) unit vectors p from the centre to the points, world frame.
        residuals: (n,) m, r - f, along p.
        radial_matrix: (n, 3 + N) derivatives of the radial component of h by x, y, heading and
            the radii.
        tangential_slopes: (n,) 1 - f / r: the tangential component's derivative by x^c is this
            times t = (-p_y, p_x).
        radius_variances: (n,) R^f in m².
        turns: (n,) f' / r, the slope of the radius over the point's distance, 1/rad.
    """

    directions: np.ndarray
    residuals: np.ndarray
    radial_matrix: np.ndarray
    tangential_slopes: np.ndarray
    radius_variances: np.ndarray
    turns: np.ndarray


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


def information(
    model: Linearisation, covariances: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Hᵀ R⁻¹ H (3 + N, 3 + N), Hᵀ R⁻¹ v (3 + N,) and vᵀ R⁻¹ v of a scan, rates left out.

    R_l = p R^f pᵀ + R, thesis (68c), with `covariances` R in m²: (2, 2), or (n, 2, 2). The two rows
    of a point are made independent: the radial one given the tangential one.
    """
    px, py = np.ascontiguousarray(model.directions.T)
    px2, py2 = px * px, py * py
    xx, xy, yy = covariances[..., 0, 0], covariances[..., 0, 1], covariances[..., 1, 1]
    tangent_rows = np.empty((len(px), 2))
    np.multiply(-py, model.tangential_slopes, out=tangent_rows[:, 0])
    np.multiply(px, model.tangential_slopes, out=tangent_rows[:, 1])
    if xy.any() or (xx != yy).any():
        mixed = 2.0 * xy * px * py
        tangential = xx * py2 - mixed + yy * px2
        cross = xy * (px2 - py2) + (yy - xx) * px * py
        radial = xx * px2 + mixed + yy * py2 + model.radius_variances
        gain = cross / tangential
        scale = 1.0 / np.sqrt(radial - gain * cross)
        rows = model.radial_matrix * scale[:, None]
        rows[:, :2] -= (gain * scale)[:, None] * tangent_rows
    else:
        # R is a multiple of I: the two rows of a point are independent.
        tangential = xx * py2 + yy * px2
        scale = 1.0 / np.sqrt(xx * px2 + yy * py2 + model.radius_variances)
        rows = model.radial_matrix * scale[:, None]
    residuals = model.residuals * scale
    matrix = rows.T @ rows
    tangent_rows /= np.sqrt(tangential)[:, None]
    matrix[:2, :2] += tangent_rows.T @ tangent_rows
    return matrix, rows.T @ residuals, float(residuals @ residuals)


def project(model: Linearisation, covariances: np.ndarray) -> np.ndarray:
    """R (n, 2, 2) m² = (gᵀ R g) I of the points' own `covariances` R (n, 2, 2) m².

    The innovation of a point z is v = ‖z - x^c‖ - f(∠(z - x^c) - psi), a scalar: it has no
    component along t. Its gradient in z is g = p - (f' / r) t, so its variance is gᵀ R g. With R
    itself, thesis (68c) takes the tangential component, which is zero by construction, for a
    measured error of zero, and conditions the radial error on it: with an elongated R the filter
    becomes over-confident and diverges. With a multiple of I there is nothing to condition on.
    """
    px, py = model.directions.T
    tangents = np.stack([-py, px], axis=-1)
    gradients = model.directions - model.turns[:, None] * tangents
    variances = np.einsum("ni,nij,nj->n", gradients, covariances, gradients)
    return variances[:, None, None] * np.eye(2)


def factor(covariance: np.ndarray) -> np.ndarray:
    """L (D, D) with L Lᵀ = `covariance`, which may be semi-definite; rows in the state's order.

    Cholesky with diagonal pivoting stops at the numerical rank: what is left out is within
    rounding of the largest variance, and no jitter is needed.
    """
    from scipy.linalg.lapack import dpstrf

    packed, pivots, rank, _ = dpstrf(covariance, lower=1)
    packed[:, rank:] = 0.0
    lower = np.empty_like(packed)
    lower[pivots - 1] = np.where(_lower_triangle(len(packed)), packed, 0.0)
    return lower


@cache
def _lower_triangle(size: int) -> np.ndarray:
    """Where a lower triangular matrix (size, size) may differ from 0."""
    return np.tri(size, dtype=bool)


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    points_world: np.ndarray,
    covariances: np.ndarray,
    process: ContourProcess,
    projected: bool = False,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Posterior mean (6 + N,), covariance, and NIS of a scan; thesis (76) in information form.

    `mean` and `covariance` are the *predicted* ones; `points_world` (n, 2) m; `covariances` R
    (2, 2) or (n, 2, 2) m², `projected` or as they are. The NIS by Woodbury:
    vᵀ S⁻¹ v = vᵀ R⁻¹ v - (Hᵀ R⁻¹ v)ᵀ P⁺ (Hᵀ R⁻¹ v).
    """
    from scipy.linalg.lapack import dpotrf, dtrtrs

    model = linearise(points_world, mean, process)
    if projected:
        covariances = project(model, covariances)
    matrix, vector, norm = information(model, covariances)
    lower = factor(covariance)
    seen = np.concatenate([lower[:SEEN], lower[2 * SEEN :]])
    inner = seen.T @ (matrix @ seen)
    inner.flat[:: len(inner) + 1] += 1.0
    root, _ = dpotrf(inner, lower=1)
    # P⁺ = GᵀG with G = C⁻¹ Lᵀ and C Cᵀ = I + Lᵀ A L: symmetric to the bit.
    posterior_root, _ = dtrtrs(root, lower.T, lower=1)
    whitened, _ = dtrtrs(root, seen.T @ vector, lower=1)
    nis = norm - float(whitened @ whitened)
    return mean + posterior_root.T @ whitened, posterior_root.T @ posterior_root, nis


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
