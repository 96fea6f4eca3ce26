"""The measurement noise R that a tracker gave its points, as far as its settings determine it."""

from typing import Any

import numpy as np

from stixel_cli.measurements.scans import Scans
from stixel_cli.report.page_numbers import ellipses
from stixel_cli.results.result import RunResult

MOST_ELLIPSES = 20_000
"""With more used points than this, the page shows the scan's covariances: it must stay small."""


def noise_of(run: RunResult) -> dict[str, Any]:
    """R of the used points of a computed run, for the playback page.

    Returns `text`, a description; `std`, mm, if R is the same for all points, else None; and
    `ellipses`, for each scan the 1σ ellipses of its used points in their order, None if they are
    those of the scan.
    """
    tracker = run.composition.configuration.tracker
    kind = getattr(tracker, "kind", "")
    if kind in ("point", "box") or (
        kind == "gp_ekf" and tracker.measurement_covariance == "isotropic"
    ):
        std = tracker.measurement_std
        return _same(f"R = ({std:.3g} m)² for each of them", std)
    if kind == "gp_ekf" and tracker.measurement_covariance == "projected":
        return _of_the_scan("R from the scan, projected on the normal of the contour")
    if kind in ("pyrecest", "random_matrix", "rectangle"):
        std = tracker.measurement_std
        added = run.scans.covariances_world + std**2 * np.eye(2)
        return _own(run, added, f"R = the scan's + ({std:.3g} m)²")
    if kind == "contour":
        covariances = _stretched(run.scans, tracker.noise_factor, tracker.offset_std)
        text = f"R along the ray = ({tracker.noise_factor:g} σ)², and the shape's error"
        return _own(run, covariances, text)
    return _of_the_scan("the covariance that the scan states")


def _same(text: str, std: float) -> dict[str, Any]:
    return {"text": text, "std": round(1000.0 * std), "ellipses": None}


def _of_the_scan(text: str) -> dict[str, Any]:
    return {"text": text, "std": None, "ellipses": None}


def _own(run: RunResult, covariances: np.ndarray, text: str) -> dict[str, Any]:
    """Ellipses of the used points from `covariances` (P, 2, 2) m² of all points."""
    offsets, rows = run.track.used_offsets, run.track.used_points
    if len(rows) > MOST_ELLIPSES:
        return _of_the_scan(f"{text}; too many points to show it")
    shown = [
        ellipses(covariances[rows[offsets[k] : offsets[k + 1]]]) for k in range(len(offsets) - 1)
    ]
    return {"text": text, "std": None, "ellipses": shown}


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
