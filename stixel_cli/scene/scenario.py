"""The motion in a scene: poses of the ego car and the target at every time."""

from dataclasses import dataclass

import numpy as np

from stixel_cli.geometry.pose import world_from_target


@dataclass(frozen=True)
class EgoMotion:
    """The ego car's known motion, as from odometry."""

    times: np.ndarray
    """(K,) s."""
    poses_world: np.ndarray
    """(K, 3) x m, y m, heading rad; (0, 0, pi/2) at k = 0."""
    pitches: np.ndarray = None
    """(K,) rad, the camera's pitch beyond that of the rig, positive with the nose down."""
    heights: np.ndarray = None
    """(K,) m, its height beyond that of the rig. By default, both are 0."""

    def __post_init__(self) -> None:
        for name in ("pitches", "heights"):
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.zeros(len(self.times)))


@dataclass(frozen=True)
class Scenario:
    """Ground truth, read only by renderers, fabrication, the initialisation, scores and pictures.

    Attributes:
        times: (K,) s.
        ego_poses_world: (K, 3) x m, y m, heading rad.
        target_poses_world: (K, 3) x m, y m, heading rad; NaN where the truth is unknown, which
            only scans from a file and recordings can have.
        target_rates_world: (K, 3) m/s, m/s, rad/s: the poses' derivatives; NaN as the poses.
        contours_target: (L, M, 2) m, for each pose of the target's limbs the outline of the mesh's
            ground projection in the target frame: one simple polygon, counter-clockwise, the first
            vertex not repeated. L is 1 if nothing moves; M is 0 without any truth.
        limb_poses: (K,) int64, the pose of the limbs at each time, an index of `contours_target`;
            by default 0: nothing moves.
        only_box: whether only the target's box is known, as in labelled recordings. Then
            `contours_target` has only that box.
        scored: (K,) bool, the scans that count for the scores; None for all with a known truth.
    """

    times: np.ndarray
    ego_poses_world: np.ndarray
    target_poses_world: np.ndarray
    target_rates_world: np.ndarray
    contours_target: np.ndarray
    limb_poses: np.ndarray | None = None
    only_box: bool = False
    scored: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.limb_poses is None:
            object.__setattr__(self, "limb_poses", np.zeros(len(self.times), dtype=np.int64))

    @property
    def star_convex(self) -> bool:
        """Whether every point of every contour is seen from the target's centre.

        Exact: the centre must be on the inner side of the line through every edge, which is when
        the cross product of each edge's ends is not negative.
        """
        following = np.roll(self.contours_target, -1, axis=1)
        (x, y), (x_after, y_after) = self.contours_target.T, following.T
        return bool(np.all(x * y_after - y * x_after >= 0.0))

    @property
    def known(self) -> np.ndarray:
        """Whether the target's pose is known, (K,)."""
        return np.isfinite(self.target_poses_world).all(axis=1)

    def contour_target(self, k: int) -> np.ndarray:
        """The true contour (M, 2) m at k, in the target frame."""
        return self.contours_target[self.limb_poses[k]]

    def contour_world(self, k: int) -> np.ndarray:
        """The true contour (M, 2) m at k, in the world frame."""
        return world_from_target(self.contour_target(k), self.target_poses_world[k])

    @property
    def contours_world(self) -> np.ndarray:
        """The true contours (K, M, 2) m at all k, in the world frame."""
        return np.stack([self.contour_world(k) for k in range(len(self.times))])

    @property
    def box_target(self) -> np.ndarray:
        """The true box, the same at all k: least and greatest x and y, (2, 2) m, in its frame.

        It contains the contours of all poses of the limbs. NaN without any truth.
        """
        points = self.contours_target
        if not points.size:
            return np.full((2, 2), np.nan)
        return np.array([points.min(axis=(0, 1)), points.max(axis=(0, 1))])

    @property
    def boxes_world(self) -> np.ndarray:
        """The true box (K, 4, 2) m at all k, in the world frame."""
        (left, bottom), (right, top) = self.box_target
        box = np.array([[left, bottom], [right, bottom], [right, top], [left, top]])
        return np.stack([world_from_target(box, pose) for pose in self.target_poses_world])
