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
        target_poses_world: (K, 3) x m, y m, heading rad; NaN where the truth is unknown, which
            only scans from a file and recordings can have.
        target_rates_world: (K, 3) m/s, m/s, rad/s: the poses' derivatives; NaN as the poses.
        contour_target: (M, 2) m, the outline of the mesh's ground projection in the target frame:
            one simple polygon, counter-clockwise, the first vertex not repeated; (0, 2) without
            any truth.
        star_convex: whether every point of the contour is seen from the target's centre.
        scored: (K,) bool, the scans that count for the scores; None for all with a known truth.
    """

    times: np.ndarray
    ego_poses_world: np.ndarray
    target_poses_world: np.ndarray
    target_rates_world: np.ndarray
    contour_target: np.ndarray
    star_convex: bool
    scored: np.ndarray | None = None

    @property
    def known(self) -> np.ndarray:
        """Whether the target's pose is known, (K,)."""
        return np.isfinite(self.target_poses_world).all(axis=1)


def is_star_convex(contour: np.ndarray) -> bool:
    """Whether every point of the polygon `contour` (M, 2), ccw, is seen from the origin.

    Exact: the origin must be on the inner side of the line through every edge, which is when the
    cross product of each edge's ends is not negative.
    """
    following = np.roll(contour, -1, axis=0)
    crosses = contour[:, 0] * following[:, 1] - contour[:, 1] * following[:, 0]
    return bool(np.all(crosses >= 0.0))
