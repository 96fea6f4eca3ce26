"""Two-bone leg kinematics of pedestrians and cyclists."""

import numpy as np


def knee(hip: np.ndarray, ankle: np.ndarray, thigh: float, shin: float) -> np.ndarray:
    """Where the knee is, (3,) m: in front of the line from `hip` to `ankle`, (3,) m.

    The leg bends in the upright plane through both, x forward. A leg that is too short to reach is
    straight.
    """
    line = ankle - hip
    distance = np.linalg.norm(line)
    along = 0.5 * (distance + (thigh**2 - shin**2) / distance)
    out = np.sqrt(max(thigh**2 - along**2, 0.0))
    ahead = np.array([-line[2], 0.0, line[0]]) / np.hypot(line[0], line[2])
    return hip + along / distance * line + out * ahead


def turned(points: np.ndarray, about: np.ndarray, angle: float) -> np.ndarray:
    """`points` (…, 3) turned about the y axis through `about` (3,) by `angle` rad, x towards z."""
    cosine, sine = np.cos(angle), np.sin(angle)
    matrix = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    return about + (np.asarray(points) - about) @ matrix.T
