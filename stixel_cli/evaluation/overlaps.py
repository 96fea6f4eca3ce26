"""Overlaps of estimated and true areas, one value per scan.

Conventions: K scans. The contours of all scans are polygons (K, M, 2) m in one frame, the first
vertex not repeated. If a polygon is not finite, its overlap is 0.
"""

import numpy as np
import shapely


def areas(polygons: np.ndarray) -> np.ndarray:
    """Valid shapely geometries (K,) of polygons; empty where a polygon is not finite.

    A polygon that crosses itself is repaired by shapely's `make_valid`: its area consists of the
    points that it encloses an odd number of times.
    """
    found = np.full(len(polygons), shapely.Polygon(), dtype=object)
    finite = np.isfinite(polygons).all(axis=(1, 2))
    found[finite] = shapely.polygons(polygons[finite])
    crossed = ~shapely.is_valid(found)
    found[crossed] = shapely.make_valid(found[crossed])
    return found


def overlaps(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Intersection over union (K,), 0 … 1, of shapely geometries (K,); 0 for two empty ones.

    `true` may be (1,), for all scans.
    """
    common = shapely.area(shapely.intersection(estimated, true))
    union = shapely.area(estimated) + shapely.area(true) - common
    return np.clip(np.divide(common, union, out=np.zeros_like(common), where=union > 0.0), 0.0, 1.0)


def intersections_over_unions(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """IoU (K,) of the areas inside polygons, see `areas`; 0 if not finite."""
    return overlaps(areas(estimated), areas(true))
