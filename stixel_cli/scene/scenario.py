"""The motion in a scene: poses of the ego car and the target at every time."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class EgoMotion:
    """The ego car's known motion, as from odometry.

    Attributes:
        times: (K,) s.
        poses_world: (K, 3) x m, y m, heading rad; (0, 0, pi/2) at k = 0.
    """

    times: np.ndarray
    poses_world: np.ndarray


@dataclass(frozen=True)
class Scenario:
    """Ground truth, read only by renderers, fabrication, the initialisation, scores and pictures.

    A recording may have no truth at some times: the target's pose and rates are NaN there.

    Attributes:
        times: (K,) s.
        ego_poses_world: (K, 3) x m, y m, heading rad.
        target_poses_world: (K, 3) x m, y m, heading rad.
        target_rates_world: (K, 3) m/s, m/s, rad/s: the poses' derivatives.
        contour_target: (M, 2) m, the outline of the mesh's ground projection in the target frame:
            one simple polygon, counter-clockwise, the first vertex not repeated.
        star_convex: whether every point of the contour is seen from the target's centre.
        scored: (K,) bool, the scans that count for the scores; None for all scans with a truth.
    """

    times: np.ndarray
    ego_poses_world: np.ndarray
    target_poses_world: np.ndarray
    target_rates_world: np.ndarray
    contour_target: np.ndarray
    star_convex: bool
    scored: np.ndarray | None = None
