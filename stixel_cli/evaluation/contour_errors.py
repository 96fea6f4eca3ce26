"""Errors of estimated contours against true ones, one value per scan.

Conventions: K scans. A contour of a scan is a polygon (M, 2) m in the world, the first vertex not
repeated; M may differ between scans. Poses (K, 3) = x m, y m, heading rad. If a polygon is not
finite, its error is NaN, but an overlap is 0.
"""

from collections.abc import Sequence

import numpy as np
import shapely

from stixel_cli.geometry.pose import rotation

SAMPLES = 72
"""Points of a contour, even in arc length, where it is compared with another one."""

COVERED = 1.96
"""Standard deviations on both sides of the estimated contour: 95 % of a normal error."""

SHRUNK = 0.01
"""Parts of a target that are thinner than twice this, m, hide nothing of it."""

Contours = Sequence[np.ndarray]


def areas(polygons: Contours) -> np.ndarray:
    """Valid shapely geometries (K,) of polygons; empty where a polygon is not finite.

    A polygon that crosses itself is repaired by shapely's `make_valid`: its area consists of the
    points that it encloses an odd number of times.
    """
    empty = shapely.Polygon()
    found = np.array(
        [shapely.Polygon(p) if np.isfinite(p).all() else empty for p in polygons], dtype=object
    )
    crossed = ~shapely.is_valid(found)
    if crossed.any():
        found[crossed] = shapely.make_valid(found[crossed])
    return found


def overlaps(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Intersection over union (K,), 0 … 1, of shapely geometries (K,); 0 for two empty ones."""
    common = shapely.area(shapely.intersection(estimated, true))
    union = shapely.area(estimated) + shapely.area(true) - common
    return np.clip(np.divide(common, union, out=np.zeros_like(common), where=union > 0.0), 0.0, 1.0)


def boxes(polygons: Contours, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least boxes along the headings: corners (K, 4, 2) m, counter-clockwise; sides (K, 2) m.

    The sides are the length along the heading and the width across it.
    """
    corners, sides = np.empty((len(polygons), 4, 2)), np.empty((len(polygons), 2))
    for k, (polygon, pose) in enumerate(zip(polygons, poses, strict=True)):
        turn = rotation(pose[2])
        body = (polygon - pose[:2]) @ turn
        low, high = body.min(axis=0), body.max(axis=0)
        box = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
        corners[k], sides[k] = box @ turn.T + pose[:2], high - low
    return corners, sides


def area_moments(polygons: Contours) -> tuple[np.ndarray, np.ndarray]:
    """Mean (K, 2) m and covariance (K, 2, 2) m² of the uniform density inside simple polygons.

    By Green's theorem, about each polygon's first vertex, so that the distance from the origin does
    not cost digits. A polygon without an area has the mean of its vertices, and covariance zero.
    """
    means, covariances = np.empty((len(polygons), 2)), np.zeros((len(polygons), 2, 2))
    for k, polygon in enumerate(polygons):
        a = polygon - polygon[0]
        b = np.roll(a, -1, axis=0)
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        doubled, total = cross.sum(), a + b
        if doubled == 0.0:
            means[k] = polygon.mean(axis=0)
            continue
        mean = cross @ total / (3.0 * doubled)
        second = sum((part * cross[:, None]).T @ part for part in (a, b, total))
        covariances[k] = second / (12.0 * doubled) - np.outer(mean, mean)
        means[k] = mean + polygon[0]
    return means, covariances


def gaussian_wasserstein(estimated: Contours, true: Contours) -> np.ndarray:
    """Gaussian-Wasserstein distance (K,) m of the uniform areas inside two polygons each.

    d² = ‖m₁ - m₂‖² + tr(C₁ + C₂ - 2 (C₁^½ C₂ C₁^½)^½), Yang, Baum, Granström 2016, *Metrics for
    performance evaluation of elliptic extended object tracking methods*. For 2 × 2 matrices the
    last trace is √(tr(C₁ C₂) + 2 √(det C₁ det C₂)).
    """
    (m1, c1), (m2, c2) = area_moments(estimated), area_moments(true)
    determinants = np.maximum(_determinant(c1) * _determinant(c2), 0.0)
    inner = np.einsum("kij,kji->k", c1, c2) + 2.0 * np.sqrt(determinants)
    traces = np.trace(c1, axis1=1, axis2=2) + np.trace(c2, axis1=1, axis2=2)
    square = ((m1 - m2) ** 2).sum(axis=1) + traces - 2.0 * np.sqrt(np.maximum(inner, 0.0))
    return np.sqrt(np.maximum(square, 0.0))


def _determinant(matrices: np.ndarray) -> np.ndarray:
    return matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] * matrices[:, 1, 0]


def even_points(polygons: Contours, count: int = SAMPLES) -> np.ndarray:
    """Points (K, count, 2) m on polygons, even in arc length, the first vertex first."""
    found = np.empty((len(polygons), count, 2))
    for k, polygon in enumerate(polygons):
        closed = np.concatenate([polygon, polygon[:1]])
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
        wanted = np.arange(count) * (lengths[-1] / count)
        found[k] = np.stack([np.interp(wanted, lengths, closed[:, i]) for i in range(2)], axis=-1)
    return found


def boundary_distances(points: np.ndarray, polygons: Contours) -> np.ndarray:
    """Distances (K, S) m of points (K, S, 2) from the outlines of polygons; NaN if not finite."""
    found = np.full(points.shape[:2], np.nan)
    for k, polygon in enumerate(polygons):
        if np.isfinite(polygon).all() and np.isfinite(points[k]).all():
            found[k] = shapely.distance(shapely.points(points[k]), shapely.LinearRing(polygon))
    return found


def seen_points(points: np.ndarray, polygons: Contours, sensors: np.ndarray) -> np.ndarray:
    """Which `points` (K, S, 2) on the outlines of polygons a sensor at `sensors` (K, 2) m sees.

    A polygon hides only itself. It is first shrunk by `SHRUNK`, so that an outline does not hide
    its own points from a ray along it.
    """
    seen = np.empty(points.shape[:2], dtype=bool)
    for k, (polygon, sensor) in enumerate(zip(polygons, sensors, strict=True)):
        inside = shapely.buffer(shapely.Polygon(polygon), -SHRUNK, quad_segs=1)
        shapely.prepare(inside)
        ends = np.stack([np.broadcast_to(sensor, points[k].shape), points[k]], axis=1)
        seen[k] = ~shapely.intersects(inside, shapely.linestrings(ends))
    return seen


def differences_along_rays(
    centre: np.ndarray,
    directions: np.ndarray,
    contour: np.ndarray,
    std: np.ndarray,
    points: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """How far points are outside an estimated star-convex contour, along rays from its centre.

    Args:
        centre: (2,) m.
        directions: (M, 2) unit vectors to the contour's points, counter-clockwise, over one turn.
        contour: (M, 2) m.
        std: (M,) m, standard deviations of the contour's distance from the centre.
        points: (S, 2) m.

    Returns:
        The differences (S,) m, negative inside, and standard deviations (S,) m, interpolated by
        angle.
    """
    count, turn = len(contour), 2.0 * np.pi
    offsets = points - centre
    bearings = np.arctan2(directions[:, 1], directions[:, 0])
    starts = np.mod(bearings - bearings[0], turn)
    angles = np.mod(np.arctan2(offsets[:, 1], offsets[:, 0]) - bearings[0], turn)
    before = np.maximum(np.searchsorted(starts, angles, side="right") - 1, 0)
    after = (before + 1) % count
    width = np.mod(starts[after] - starts[before], turn)
    along = angles - starts[before]
    radii = np.hypot(*(contour - centre).T)
    first, second = radii[before], radii[after]
    # The edge between two vertices at the angles 0 and `width`, met by the ray at `along`.
    sines = first * np.sin(along) + second * np.sin(width - along)
    with np.errstate(divide="ignore", invalid="ignore"):
        met = np.where(sines > 0.0, first * second * np.sin(width) / sines, 0.0)
        weight = along / width
    deviations = (1.0 - weight) * std[before] + weight * std[after]
    return np.hypot(offsets[:, 0], offsets[:, 1]) - met, deviations
