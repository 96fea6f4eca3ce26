"""The scenario: the ground truth of one run, with the true contour.

The contour is the outline of the mesh's ground projection, without a convex hull.
"""

import numpy as np
import shapely

from stixel_cli.scene.mesh import Mesh, corners
from stixel_cli.scene.path import path_poses
from stixel_cli.scene.path_parameters import Path
from stixel_cli.scene.road_user import road_user_mesh
from stixel_cli.scene.road_user_parameters import RoadUser
from stixel_cli.scene.scenario import EgoMotion, Scenario, is_star_convex


def build_scenario(ego_motion: EgoMotion, road_user: RoadUser, path: Path) -> Scenario:
    """Ground truth at the ego motion's times: poses, their rates, and the target's true contour.

    Raises:
        ValueError: if the path's values contradict each other, or the mesh cannot be read.
    """
    poses, rates = path_poses(path, ego_motion.times)
    contour = ground_contour(road_user_mesh(road_user))
    return Scenario(
        times=ego_motion.times,
        ego_poses_world=ego_motion.poses_world,
        target_poses_world=poses,
        target_rates_world=rates,
        contour_target=contour,
        star_convex=is_star_convex(contour),
    )


SIMPLIFIED_BY = 1e-3
"""The contour may differ from the outline by this much, m."""

GRID = 1e-6
"""Projected corners are rounded to this, m, so that slivers cannot break the union."""


def ground_contour(mesh: Mesh) -> np.ndarray:
    """Outline (M, 2) m of the ground projection of `mesh`, in its own frame.

    One simple polygon, counter-clockwise, the first vertex not repeated. Holes are filled, because
    a sensor on the ground can only see the outline. Parts that do not touch in the projection are
    joined by a morphological closing with the smallest sufficient radius of 1, 2, 4 … mm. This
    fills gaps and notches narrower than twice that radius, and changes nothing else. The outline is
    then simplified by `SIMPLIFIED_BY` at most.

    Raises:
        ValueError: if the projection has no area.
    """
    flat = corners(mesh)[:, :, :2]
    flat = flat[_doubled_areas(flat) > 1e-10]
    if len(flat) == 0:
        raise ValueError("the mesh's ground projection has no area")
    outline = _without_holes(shapely.union_all(shapely.polygons(flat), grid_size=GRID))
    radius = 1e-3
    while outline.geom_type != "Polygon":
        closed = outline.buffer(radius, join_style="mitre").buffer(-radius, join_style="mitre")
        outline = _without_holes(shapely.union(closed, outline))
        radius *= 2.0
    outline = shapely.orient_polygons(outline.simplify(SIMPLIFIED_BY))
    return np.array(outline.exterior.coords)[:-1]


def _doubled_areas(flat: np.ndarray) -> np.ndarray:
    a, b = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    return np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _without_holes(shape: shapely.Geometry) -> shapely.Geometry:
    pieces = [shapely.Polygon(piece.exterior) for piece in shapely.get_parts(shape)]
    return shapely.union_all([piece for piece in pieces if piece.area > 0.0])
