"""Poses and angles on the ground plane, and points moved between the frames that poses define.

A pose is (x, y, heading): metres, metres, radians counter-clockwise from the world's +x axis.
The target's x axis points along its heading. The ego car's *y* axis points along its heading (its
frame is x right, y forward), so its pose at k = 0 is (0, 0, pi/2).
"""

import numpy as np
from numpy.typing import ArrayLike

STRAIGHT_AHEAD = 0.5 * np.pi

STATE = ("x", "y", "heading", "x_rate", "y_rate", "heading_rate")
"""Columns of a target's motion in tables: m, rad, and their rates, m/s, rad/s."""


def rotation(angle: float) -> np.ndarray:
    """Rotation matrix, shape (2, 2), that turns a vector counter-clockwise by `angle` rad."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]])


def rotations(angles: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 2, 2) by angles (n,) rad."""
    return np.moveaxis(rotation(angles), -1, 0)


def world_from_target(points_target: np.ndarray, pose_world: np.ndarray) -> np.ndarray:
    """Points (n, 2) in m from the frame of a target at `pose_world` (3,) to the world."""
    return np.asarray(points_target) @ rotation(pose_world[2]).T + np.asarray(pose_world[:2])


def target_from_world(points_world: np.ndarray, pose_world: np.ndarray) -> np.ndarray:
    """Points (n, 2) in m from the world to the frame of a target at `pose_world` (3,)."""
    return (np.asarray(points_world) - np.asarray(pose_world[:2])) @ rotation(pose_world[2])


def world_from_ego(points_ego: np.ndarray, ego_pose_world: np.ndarray) -> np.ndarray:
    """Points (n, 2) in m from the ego car's ground plane (x right, y forward) to the world."""
    return world_from_target(points_ego, np.subtract(ego_pose_world, [0.0, 0.0, STRAIGHT_AHEAD]))


def ego_from_world(points_world: np.ndarray, ego_pose_world: np.ndarray) -> np.ndarray:
    """Points (n, 2) in m from the world to the ego car's ground plane (x right, y forward)."""
    return target_from_world(points_world, np.subtract(ego_pose_world, [0.0, 0.0, STRAIGHT_AHEAD]))


def rotate_covariances(covariances: np.ndarray, angle: float) -> np.ndarray:
    """Covariances (n, 2, 2) in m² of vectors that are turned counter-clockwise by `angle` rad."""
    turn = rotation(angle)
    return turn @ np.asarray(covariances) @ turn.T


def wrap_angle(angle: ArrayLike) -> np.ndarray:
    """`angle`, any shape, rad, wrapped to the half-open interval (-pi, pi]."""
    return -np.remainder(-np.asarray(angle, dtype=np.float64) + np.pi, 2.0 * np.pi) + np.pi


def pose_rates(before: np.ndarray, after: np.ndarray, interval: float) -> np.ndarray:
    """Rates (3,) m/s, m/s, rad/s from one pose (3,) to the next, an `interval` in s later.

    0 where the interval is: two poses at one time, to the clock's last digit, say nothing of them.
    """
    change = np.array([*(after - before)[:2], wrap_angle(after[2] - before[2])])
    return change / interval if interval > 0.0 else np.zeros(3)


def rectangle(length: float, width: float) -> np.ndarray:
    """Corners (4, 2) m of a rectangle about the origin, counter-clockwise, x along its length."""
    return 0.5 * np.array([[length, width], [-length, width], [-length, -width], [length, -width]])


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
