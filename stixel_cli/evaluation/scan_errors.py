"""Errors of a track against the truth, one number a scan.

Conventions: K scans; poses (K, 3) = x m, y m, heading rad in the world; polygons (K, M, 2) m in the
world, the first vertex not repeated; estimated minus true. Errors count at every scan, also
at empty ones. A missing value is NaN.
"""

import numpy as np
import shapely

from stixel_cli.geometry.angles import wrap_angle


def centre_errors(estimated_world: np.ndarray, true_world: np.ndarray) -> np.ndarray:
    """Distance (K,) m of the centres, the first two columns of (K, …)."""
    offsets = estimated_world[:, :2] - true_world[:, :2]
    return np.hypot(offsets[:, 0], offsets[:, 1])


def orientation_errors(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Estimated minus true heading (K,), wrapped to (-pi, pi] rad."""
    return wrap_angle(np.asarray(estimated) - np.asarray(true))


def intersections_over_unions(estimated_world: np.ndarray, true_world: np.ndarray) -> np.ndarray:
    """IoU (K,) of the areas inside the polygons (K, M, 2) and (K, N, 2) m.

    A polygon that crosses itself is repaired by shapely's `make_valid`: its area is what an odd
    number of turns encloses. An estimate that is not finite overlaps nothing: 0.
    """
    finite = np.isfinite(estimated_world).all(axis=(1, 2))
    overlap = np.zeros(len(estimated_world))
    estimated = _areas(estimated_world[finite])
    true = _areas(true_world[finite])
    common = shapely.area(shapely.intersection(estimated, true))
    union = shapely.area(estimated) + shapely.area(true) - common
    overlap[finite] = np.divide(common, union, out=np.zeros_like(common), where=union > 0.0)
    return np.clip(overlap, 0.0, 1.0)


def normalised_errors(errors: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """NEES (K,) divided by its dimension: eᵀ P⁻¹ e / D of `errors` (K, D) and P (K, D, D).

    NaN where P is not positive definite.
    """
    result = np.full(len(errors), np.nan)
    for k, (error, covariance) in enumerate(zip(errors, covariances, strict=True)):
        try:
            root = np.linalg.cholesky(covariance)
        except np.linalg.LinAlgError:
            continue
        whitened = np.linalg.solve(root, error)
        result[k] = whitened @ whitened / len(error)
    return result


def _areas(polygons: np.ndarray) -> np.ndarray:
    """Shapely geometries (K,) of polygons (K, M, 2), valid ones."""
    areas = shapely.polygons(polygons)
    crossed = ~shapely.is_valid(areas)
    if crossed.any():
        areas[crossed] = shapely.make_valid(areas[crossed])
    return areas
