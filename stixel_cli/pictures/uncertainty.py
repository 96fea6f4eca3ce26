"""What pictures and pages draw of an uncertainty: noise, ellipses, bounds; a target's size."""

from typing import Any

import numpy as np

from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track


def target_radius(track: Track, scenario: Scenario) -> float:
    """Greatest radius of the true contour, m; without one, the median of the estimated ones."""
    if scenario.known.any():
        return float(np.linalg.norm(scenario.contours_target, axis=2).max())
    radii = np.linalg.norm(track.contours_world - track.means[:, None, :2], axis=2).max(axis=1)
    finite = radii[np.isfinite(radii)]
    return float(np.clip(np.median(finite), 0.1, 30.0)) if len(finite) else 1.0


def ellipse_axes(covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Semi-axes (2, n) m, the longer first, and angles (n,) rad of 1σ ellipses, (n, 2, 2) m²."""
    a, b, c = covariances[:, 0, 0], covariances[:, 0, 1], covariances[:, 1, 1]
    # The eigenvalues of a symmetric 2 × 2 matrix in closed form.
    mean, spread = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
    with np.errstate(invalid="ignore"):
        axes = np.sqrt(np.maximum(np.stack([mean + spread, mean - spread]), 0.0))
    return axes, 0.5 * np.arctan2(2.0 * b, a - c)


def normalised_chi_square_bounds(degrees_of_freedom: np.ndarray) -> np.ndarray:
    """Approximate bounds (2, K) of the central 95 % of χ² / degrees of freedom (K,).

    Exact for two degrees of freedom, else by Wilson & Hilferty (1931): the error is below 0.1 for
    four degrees and 0.01 for twenty. NaN for none. SciPy takes longer to import than a figure
    to draw.
    """
    n = np.where(degrees_of_freedom > 0, degrees_of_freedom, np.nan).astype(np.float64)
    spread = 2.0 / (9.0 * n)
    bounds = [np.maximum(1.0 - spread + z * np.sqrt(spread), 0.0) ** 3 for z in (-1.96, 1.96)]
    exact = -np.log([0.975, 0.025])
    return np.where(n == 2.0, exact[:, None], np.stack(bounds))


def tracker_noise(tracker: Any, scans: Scans) -> tuple[str, np.ndarray, float | None]:
    """R of all points for the parameters of a tracker.

    Returns a description, the covariances (P, 2, 2) m², which are those of the scan where R is not
    known, and the standard deviation, m, if it is the same for all points, else None.
    """
    kind = getattr(tracker, "kind", "")
    if kind in ("point", "box", "gp_ekf"):
        std = tracker.measurement_std
        same = np.broadcast_to(std**2 * np.eye(2), scans.covariances_world.shape)
        return f"R = (measurement_std, {std:.3g} m)² for each of them", same, std
    if kind in ("pyrecest", "rectangle"):
        std = tracker.measurement_std
        added = scans.covariances_world + std**2 * np.eye(2)
        return f"R = the scan's + (measurement_std, {std:.3g} m)²", added, None
    if kind == "contour":
        text = f"R along the ray = ({tracker.noise_factor:g} σ)², and the shape's error"
        return text, _stretched(scans, tracker.noise_factor), None
    return "the covariance that the scan states", scans.covariances_world, None


def _stretched(scans: Scans, factor: float) -> np.ndarray:
    """Covariances (P, 2, 2) m² with a `factor` on the standard deviation along the ray."""
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    rays = scans.points_world - scans.sensor_poses_world[k, :2]
    rays /= np.maximum(np.linalg.norm(rays, axis=1), 1e-9)[:, None]
    along = np.einsum("pi,pij,pj->p", rays, scans.covariances_world, rays)
    across = np.trace(scans.covariances_world, axis1=1, axis2=2) - along
    squares = rays[:, :, None] * rays[:, None, :]
    return (factor**2 * along - across)[:, None, None] * squares + across[:, None, None] * np.eye(2)
