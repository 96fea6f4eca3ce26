"""The target's true contours, and the ground truth of a target along any motion.

The contour is the outline of the mesh's ground projection, without a convex hull. It follows the
limbs: every pose of theirs has its own.
"""

import numpy as np
import shapely

from stixel_cli.scene.outline import GRID, ground_contour, polygon_of, seen_from_above
from stixel_cli.scene.road_user import limb_poses, moving_parts, road_user_meshes
from stixel_cli.scene.road_user_parameters import RoadUser
from stixel_cli.scene.scenario import EgoMotion, Scenario, is_star_convex


def moving_target(
    ego_motion: EgoMotion,
    road_user: RoadUser,
    poses_world: np.ndarray,
    rates_world: np.ndarray,
    travelled: np.ndarray,
) -> Scenario:
    """Ground truth of `road_user` at the ego motion's K times.

    Args:
        ego_motion: of the ego car.
        road_user: the target.
        poses_world, rates_world: (K, 3) its poses (x m, y m, heading rad) and their derivatives.
        travelled: (K,) m, which moves the limbs.

    Raises:
        ValueError: if the mesh cannot be read.
    """
    contours = road_user_contours(road_user)
    return Scenario(
        times=ego_motion.times,
        ego_poses_world=ego_motion.poses_world,
        target_poses_world=poses_world,
        target_rates_world=rates_world,
        contours_target=contours,
        limb_poses=limb_poses(road_user, travelled),
        star_convex=all(is_star_convex(contour) for contour in contours),
    )


def road_user_contours(road_user: RoadUser) -> np.ndarray:
    """The outlines (L, M, 2) m of `road_user_meshes`, as `ground_contour` states them.

    All have the same number of vertices: edges are halved where a contour has fewer.

    Raises:
        ValueError: as `road_user_meshes` and `ground_contour` do.
    """
    meshes = road_user_meshes(road_user)
    if len(meshes) == 1:
        return ground_contour(meshes[0])[None]
    # What does not move is projected once.
    moving = moving_parts(road_user)
    rest = seen_from_above([p for p in meshes[0].parts if p.name not in moving])
    contours = []
    for mesh in meshes:
        limbs = seen_from_above([p for p in mesh.parts if p.name in moving])
        contours.append(polygon_of(shapely.union(rest, limbs, grid_size=GRID)))
    count = max(len(contour) for contour in contours)
    return np.stack([_with_vertices(contour, count) for contour in contours])


def _with_vertices(contour: np.ndarray, count: int) -> np.ndarray:
    """The same polygon with `count` vertices: the longest edge is halved again and again."""
    while len(contour) < count:
        following = np.roll(contour, -1, axis=0)
        longest = int(np.argmax(np.linalg.norm(following - contour, axis=1)))
        middle = 0.5 * (contour[longest] + following[longest])
        contour = np.insert(contour, longest + 1, middle, axis=0)
    return contour
