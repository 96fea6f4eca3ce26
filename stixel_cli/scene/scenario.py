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

    Attributes:
        times: (K,) s.
        ego_poses_world: (K, 3) x m, y m, heading rad.
        target_poses_world: (K, 3) x m, y m, heading rad.
        target_rates_world: (K, 3) m/s, m/s, rad/s: the poses' derivatives.
        contour_target: (M, 2) m, the outline of the mesh's ground projection in the target frame:
            one simple polygon, counter-clockwise, the first vertex not repeated.
        star_convex: whether every point of the contour is seen from the target's centre.
        only_box: whether only the target's box is known, as in labelled recordings. Then
            `contour_target` is that box.
    """

    times: np.ndarray
    ego_poses_world: np.ndarray
    target_poses_world: np.ndarray
    target_rates_world: np.ndarray
    contour_target: np.ndarray
    star_convex: bool
    only_box: bool = False
