"""Poses on the ground plane, of 6-DoF poses of the camera and of labels."""

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, world_from_ego


def planar_poses(poses: np.ndarray, level_from_camera: np.ndarray) -> np.ndarray:
    """Poses (K, 3) x m, y m, heading rad on the ground plane of the first camera pose.

    Args:
        poses: (K, 3, 4) poses of the camera (x right, y down, z forward) in any one frame, m.
            Their roll, height, and changes of pitch are left out.
        level_from_camera: (3, 3) rotation, see `Rig`.
    """
    turn, place = poses[0, :, :3] @ level_from_camera.T, poses[0, :, 3]
    places = (poses[:, :, 3] - place) @ turn
    ahead = poses[:, :, :3] @ level_from_camera[2] @ turn
    headings = np.unwrap(np.arctan2(ahead[:, 2], ahead[:, 0]))
    return np.stack([places[:, 0], places[:, 2], headings], axis=1)


def label_pose(place: np.ndarray, yaw: float, ego_pose: np.ndarray) -> np.ndarray:
    """Pose (3,) in the world of a label at `place` (3,) m in the level frame, turned by `yaw`."""
    x, y = world_from_ego(place[None, [0, 2]], ego_pose)[0]
    return np.array([x, y, ego_pose[2] - STRAIGHT_AHEAD - yaw])
