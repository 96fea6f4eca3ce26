"""The scenario: the ground truth of one run, from its configuration."""

from stixel_cli.scene.contour import ground_contour, is_star_convex
from stixel_cli.scene.path import path_poses
from stixel_cli.scene.path_parameters import Path
from stixel_cli.scene.road_user import road_user_mesh
from stixel_cli.scene.road_user_parameters import RoadUser
from stixel_cli.scene.scenario import EgoMotion, Scenario


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
