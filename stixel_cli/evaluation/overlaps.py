"""Overlaps of estimated and true areas, one value per scan.

Conventions: K scans. The contours of all scans are polygons (K, M, 2) m in one frame, the first
vertex not repeated. If a polygon is not finite, its overlap is 0.
"""

import numpy as np
import shapely

CHUNK = 4
"""Scans that are computed at once: their arrays fit into the processor's cache."""

LEAST = 1e-9
"""An overlap below this is a rounding error: areas do not overlap."""


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors (…, 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def areas(polygons: np.ndarray) -> np.ndarray:
    """Valid shapely geometries (K,) of polygons; empty where a polygon is not finite.

    A polygon that crosses itself is repaired by shapely's `make_valid`: its area consists of the
    points that it encloses an odd number of times.
    """
    found = _unrepaired(polygons)
    crossed = ~shapely.is_valid(found)
    found[crossed] = shapely.make_valid(found[crossed])
    return found


def _unrepaired(polygons: np.ndarray) -> np.ndarray:
    found = np.full(len(polygons), shapely.Polygon(), dtype=object)
    finite = np.isfinite(polygons).all(axis=(1, 2))
    found[finite] = shapely.polygons(polygons[finite])
    return found


def overlaps(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Intersection over union (K,), 0 … 1, of shapely geometries (K,); 0 for two empty ones."""
    common = shapely.area(shapely.intersection(estimated, true))
    return _ratios(common, shapely.area(estimated) + shapely.area(true))


def _ratios(common: np.ndarray, both: np.ndarray) -> np.ndarray:
    """IoU from the common areas and the sums of both areas; 0 where they are 0 or NaN."""
    union = both - common
    return np.clip(np.divide(common, union, out=np.zeros_like(common), where=union > 0.0), 0.0, 1.0)


def intersections_over_unions(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """IoU (K,) of the areas inside polygons, see `areas`; 0 if not finite or less than `LEAST`.

    Polygons that cross themselves are left to shapely, which is slower.
    """
    common = common_areas(estimated, true)
    # A polygon's area is the one that it has in common with itself; this formula is faster.
    found = _ratios(common, _enclosed(estimated) + _enclosed(true))
    crossed = ~(shapely.is_valid(_unrepaired(estimated)) & shapely.is_valid(_unrepaired(true)))
    found[crossed] = overlaps(areas(estimated[crossed]), areas(true[crossed]))
    # Whether areas overlap at all decides whether a track is off its target.
    return np.where(found < LEAST, 0.0, found)


def _enclosed(polygons: np.ndarray) -> np.ndarray:
    """Areas (K,) m² of simple polygons."""
    start = polygons - polygons[:, :1]
    return 0.5 * np.abs(cross(start, np.roll(start, -1, axis=1)).sum(axis=1))


def common_areas(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Area (K,) m² that is inside simple polygons `one` (K, M, 2) m and `other` (K, N, 2) m.

    With s = 1 for an edge that leads to the left and -1 for one to the right, the area inside of
    both is -½ ΣΣ s₁ s₂ ∫ |y₁(x) - y₂(x)| dx, over all pairs of an edge of each and the x that both
    have: at x, Σ s [y < y(x)] is 1 inside a polygon and 0 outside, the product of two such terms
    integrates to min(y₁, y₂), and the sums of s are 0. No case needs a special treatment: where
    edges are nearly equal, their distance is nearly 0.
    """
    first, second = _edges(one), _edges(other)
    total = np.zeros(len(one))
    for k in range(0, len(one), CHUNK):
        few = slice(k, k + CHUNK)
        (low_1, high_1, *_), (low_2, high_2, *_) = first[:, few], second[:, few]
        meet = (low_1[..., None] < high_2[:, None]) & (low_2[:, None] < high_1[..., None])
        row, column = np.divmod(np.flatnonzero(meet), other.shape[1])
        scan = row // one.shape[1]
        low_1, high_1, y_1, slope_1, sign_1 = first[:, few].reshape(5, -1).take(row, 1)
        column += scan * other.shape[1]
        low_2, high_2, y_2, slope_2, sign_2 = second[:, few].reshape(5, -1).take(column, 1)
        left = np.maximum(low_1, low_2)
        width = np.minimum(high_1, high_2) - left
        at_left = y_1 - y_2 + slope_1 * (left - low_1) - slope_2 * (left - low_2)
        at_right = at_left + (slope_1 - slope_2) * width
        # Twice the mean of |y₁ - y₂|: of a trapezoid, or of two triangles where the edges cross.
        height = np.abs(at_left) + np.abs(at_right)
        crossing = at_left * at_right < 0.0
        np.divide(at_left**2 + at_right**2, height, out=height, where=crossing)
        weights = sign_1 * sign_2 * width * height
        total[few] = np.bincount(scan, weights, minlength=len(meet))
    return 0.25 * np.abs(total)


def _edges(polygons: np.ndarray) -> np.ndarray:
    """Of each edge (5, K, M): least and greatest x, y at the least x, slope, sign."""
    end = np.roll(polygons, -1, axis=1)
    leftwards = end[..., 0] < polygons[..., 0]
    low, high = (
        np.where(leftwards[..., None], *pair) for pair in ((end, polygons), (polygons, end))
    )
    with np.errstate(invalid="ignore"):
        width, height = np.moveaxis(high - low, -1, 0)
    # The area under an edge this narrow does not matter.
    slope = np.divide(height, width, out=np.zeros_like(width), where=width > 1e-12)
    return np.stack([low[..., 0], high[..., 0], low[..., 1], slope, np.where(leftwards, 1.0, -1.0)])
