"""The target's true contours.

A contour is the outline of the mesh's ground projection, without a convex hull. It follows the
limbs: each of their poses has its own.
"""

from functools import lru_cache

import numpy as np
import shapely

from stixel_cli.scene.mesh import Part, corners
from stixel_cli.scene.parameters import RoadUser
from stixel_cli.scene.road_user import moving_parts, road_user_meshes

SIMPLIFIED_BY = 1e-3
"""The contour may differ from the outline by this much, m."""

GRID = 1e-6
"""Projected corners are rounded to this, m, so that slivers cannot break the union."""


def seen_from_above(parts: list[Part]) -> shapely.Geometry:
    """Ground projection of closed surfaces: its upward triangles cover all of it."""
    flat = corners(tuple(parts))[:, :, :2]
    return _united(flat[_doubled_areas(flat) > 1e-10].tobytes())


def outline(triangles: np.ndarray) -> np.ndarray:
    """Outline (M, 2) m of the ground projection of `triangles` (T, 3, 3) m.

    One simple polygon, counter-clockwise, the first vertex not repeated. Holes are filled, because
    a sensor on the ground can only see the outline. Parts that do not touch in the projection are
    joined by a morphological closing with the smallest sufficient radius of 1, 2, 4 … mm. This
    fills gaps and notches narrower than twice that radius, and changes nothing else. The outline is
    then simplified by `SIMPLIFIED_BY` at most. ValueError if the projection has no area.
    """
    flat = triangles[:, :, :2]
    flat = flat[np.abs(_doubled_areas(flat)) > 1e-10]
    if len(flat) == 0:
        raise ValueError("the mesh's ground projection has no area")
    return polygon_of(_united(flat.tobytes(), GRID))


@lru_cache(maxsize=64)
def _united(flat: bytes, grid: float | None = None) -> shapely.Geometry:
    """The union of triangles (T, 3, 2) m, given as bytes: it takes tenths of a second."""
    triangles = shapely.polygons(np.frombuffer(flat).reshape(-1, 3, 2))
    try:
        return shapely.union_all(triangles, grid_size=grid)
    except shapely.GEOSException:
        # Of a few shapes the exact union fails: corners next to an edge.
        return shapely.union_all(triangles, grid_size=GRID)


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


def road_user_contours(road_user: RoadUser) -> np.ndarray:
    """The outlines (L, M, 2) m of `road_user_meshes`, as `outline` states them.

    All have the same number of vertices: edges are halved where a contour has fewer. ValueError as
    `road_user_meshes` and `outline` do.
    """
    meshes = road_user_meshes(road_user)
    if len(meshes) == 1:
        return outline(corners(meshes[0]))[None]
    # What does not move is projected once.
    moving = moving_parts(road_user)
    rest = seen_from_above([p for p in meshes[0] if p.name not in moving])
    limbs = [seen_from_above([p for p in mesh if p.name in moving]) for mesh in meshes]
    contours = [polygon_of(_both(rest, one)) for one in limbs]
    count = max(len(contour) for contour in contours)
    return np.stack([_with_vertices(contour, count) for contour in contours])


def _both(rest: shapely.Geometry, limbs: shapely.Geometry) -> shapely.Geometry:
    try:
        return shapely.union(rest, limbs, grid_size=GRID)
    except shapely.GEOSException:
        # Of a few shapes, such as a cyclist of `shape_seed=1068`.
        return shapely.union_all([rest, limbs], grid_size=GRID)


def _with_vertices(contour: np.ndarray, count: int) -> np.ndarray:
    """The same polygon with `count` vertices: the longest edge is halved again and again."""
    while len(contour) < count:
        following = np.roll(contour, -1, axis=0)
        longest = int(np.argmax(np.linalg.norm(following - contour, axis=1)))
        middle = 0.5 * (contour[longest] + following[longest])
        contour = np.insert(contour, longest + 1, middle, axis=0)
    return contour
