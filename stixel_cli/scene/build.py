"""The scenario: the ground truth of one run, with the true contour."""

from stixel_cli.scene.contours import moving_target
from stixel_cli.scene.path import distance_travelled, path_poses
from stixel_cli.scene.path_parameters import Path
from stixel_cli.scene.road_user_parameters import RoadUser
from stixel_cli.scene.scenario import EgoMotion, Scenario


def build_scenario(ego_motion: EgoMotion, road_user: RoadUser, path: Path) -> Scenario:
    """Ground truth at the ego motion's times: poses, their rates, and the target's true contour.

    Raises:
        ValueError: if the path's values contradict each other, or the mesh cannot be read.
    """
    poses, rates = path_poses(path, ego_motion.times)
    travelled = distance_travelled(path, ego_motion.times)
    return moving_target(ego_motion, road_user, poses, rates, travelled)
