"""The outline of a mesh's projection on the ground, without a convex hull."""

import numpy as np
import shapely

from stixel_cli.scene.mesh import Mesh, Part, corners

SIMPLIFIED_BY = 1e-3
"""The contour may differ from the outline by this much, m."""

GRID = 1e-6
"""Projected corners are rounded to this, m, so that slivers cannot break the union."""


def seen_from_above(parts: list[Part]) -> shapely.Geometry:
    """Ground projection of closed surfaces: its upward triangles cover all of it."""
    flat = corners(Mesh(tuple(parts)))[:, :, :2]
    return shapely.union_all(shapely.polygons(flat[_doubled_areas(flat) > 1e-10]))


def ground_contour(mesh: Mesh) -> np.ndarray:
    """Outline (M, 2) m of the ground projection of `mesh`, in its own frame; see `outline`."""
    return outline(corners(mesh))


def outline(triangles: np.ndarray) -> np.ndarray:
    """Outline (M, 2) m of the ground projection of `triangles` (T, 3, 3) m.

    One simple polygon, counter-clockwise, the first vertex not repeated. Holes are filled, because
    a sensor on the ground can only see the outline. Parts that do not touch in the projection are
    joined by a morphological closing with the smallest sufficient radius of 1, 2, 4 … mm. This
    fills gaps and notches narrower than twice that radius, and changes nothing else. The outline is
    then simplified by `SIMPLIFIED_BY` at most.

    Raises:
        ValueError: if the projection has no area.
    """
    flat = triangles[:, :, :2]
    flat = flat[np.abs(_doubled_areas(flat)) > 1e-10]
    if len(flat) == 0:
        raise ValueError("the mesh's ground projection has no area")
    return polygon_of(shapely.union_all(shapely.polygons(flat), grid_size=GRID))


def polygon_of(shape: shapely.Geometry) -> np.ndarray:
    """The pieces of a projection as one polygon (M, 2) m without holes, see `outline`."""
    shape = _without_holes(shape)
    radius = 1e-3
    while shape.geom_type != "Polygon":
        closed = shape.buffer(radius, join_style="mitre").buffer(-radius, join_style="mitre")
        shape = _without_holes(shapely.union(closed, shape))
        radius *= 2.0
    shape = shapely.orient_polygons(shape.simplify(SIMPLIFIED_BY))
    return np.array(shape.exterior.coords)[:-1]


def _doubled_areas(flat: np.ndarray) -> np.ndarray:
    a, b = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _without_holes(shape: shapely.Geometry) -> shapely.Geometry:
    pieces = [shapely.Polygon(piece.exterior) for piece in shapely.get_parts(shape)]
    return shapely.union_all([piece for piece in pieces if piece.area > 0.0])
