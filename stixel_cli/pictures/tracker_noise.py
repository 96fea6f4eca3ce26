"""The measurement noise R that a tracker uses, as pictures and pages show it."""

from typing import Any

import numpy as np

from stixel_cli.measurements.scans import Scans


def tracker_noise(tracker: Any, scans: Scans) -> tuple[str, np.ndarray, float | None]:
    """R of all points for the parameters of a tracker.

    Returns a description, the covariances (P, 2, 2) m², which are those of the scan where R is not
    known, and the standard deviation, m, if it is the same for all points, else None.
    """
    kind = getattr(tracker, "kind", "")
    if kind in ("point", "box") or (
        kind == "gp_ekf" and tracker.measurement_covariance == "isotropic"
    ):
        std = tracker.measurement_std
        same = np.broadcast_to(std**2 * np.eye(2), scans.covariances_world.shape)
        return f"R = ({std:.3g} m)² for each of them", same, std
    if kind in ("pyrecest", "rectangle"):
        std = tracker.measurement_std
        added = scans.covariances_world + std**2 * np.eye(2)
        return f"R = the scan's + ({std:.3g} m)²", added, None
    if kind == "contour":
        stretched = _stretched(scans, tracker.noise_factor, tracker.offset_std)
        text = f"R along the ray = ({tracker.noise_factor:g} σ)², and the shape's error"
        return text, stretched, None
    return "the covariance that the scan states", scans.covariances_world, None


def _stretched(scans: Scans, factor: float, across_std: float) -> np.ndarray:
    """Covariances (P, 2, 2) m² with `factor` on the std along the ray, and more std across it."""
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    rays = scans.points_world - scans.sensor_poses_world[k, :2]
    rays /= np.maximum(np.linalg.norm(rays, axis=1), 1e-9)[:, None]
    along = np.einsum("pi,pij,pj->p", rays, scans.covariances_world, rays)
    across = np.trace(scans.covariances_world, axis1=1, axis2=2) - along
    normal = np.stack([-rays[:, 1], rays[:, 0]], axis=1)
    return (factor**2 * along)[:, None, None] * rays[:, :, None] * rays[:, None, :] + (
        across + across_std**2
    )[:, None, None] * normal[:, :, None] * normal[:, None, :]
