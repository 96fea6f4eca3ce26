"""Poses and angles on the ground plane, and points moved between the frames that poses define.

A pose is (x, y, heading): metres, metres, radians counter-clockwise from the world's +x axis.
The target's x axis points along its heading. The ego car's *y* axis points along its heading (its
frame is x right, y forward), so its pose at k = 0 is (0, 0, pi/2).
"""

import numpy as np
from numpy.typing import ArrayLike

STRAIGHT_AHEAD = 0.5 * np.pi


def rotation(angle: float) -> np.ndarray:
    """Rotation matrix, shape (2, 2), that turns a vector counter-clockwise by `angle` rad."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]])


def world_from_target(points_target: np.ndarray, pose_world: np.ndarray) -> np.ndarray:
    """Points (n, 2) in m from the frame of a target at `pose_world` (3,) to the world."""
    return np.asarray(points_target) @ rotation(pose_world[2]).T + np.asarray(pose_world[:2])


def target_from_world(points_world: np.ndarray, pose_world: np.ndarray) -> np.ndarray:
    """Points (n, 2) in m from the world to the frame of a target at `pose_world` (3,)."""
    return (np.asarray(points_world) - np.asarray(pose_world[:2])) @ rotation(pose_world[2])


def world_from_ego(points_ego: np.ndarray, ego_pose_world: np.ndarray) -> np.ndarray:
    """Points (n, 2) in m from the ego car's ground plane (x right, y forward) to the world."""
    turn = rotation(ego_pose_world[2] - STRAIGHT_AHEAD)
    return np.asarray(points_ego) @ turn.T + np.asarray(ego_pose_world[:2])


def ego_from_world(points_world: np.ndarray, ego_pose_world: np.ndarray) -> np.ndarray:
    """Points (n, 2) in m from the world to the ego car's ground plane (x right, y forward)."""
    turn = rotation(ego_pose_world[2] - STRAIGHT_AHEAD)
    return (np.asarray(points_world) - np.asarray(ego_pose_world[:2])) @ turn


def rotate_covariances(covariances: np.ndarray, angle: float) -> np.ndarray:
    """Covariances (n, 2, 2) in m² of vectors that are turned counter-clockwise by `angle` rad."""
    turn = rotation(angle)
    return turn @ np.asarray(covariances) @ turn.T


def wrap_angle(angle: ArrayLike) -> np.ndarray:
    """`angle`, any shape, rad, wrapped to the half-open interval (-pi, pi]."""
    return -np.remainder(-np.asarray(angle, dtype=np.float64) + np.pi, 2.0 * np.pi) + np.pi
