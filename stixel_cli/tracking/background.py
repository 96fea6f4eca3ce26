"""What stood elsewhere while the target was tracked is not the target.

A target that is hidden is lost to sight and not gone. Its covariance grows, and soon the gate holds
what hides it, which fits a road user as well as any. But that stood there before, while the target
was known to be somewhere else; so only points at new places are candidates. And a target that is
seen does not grow into its neighbours.
"""

from collections.abc import Sequence

import numpy as np

from stixel_cli.tracking.contour.contour_rays import APART, Rays, segments

GATE = 3.0
"""Standard deviations of the place by which the target's points may be off."""


class Background:
    """Places in the world, m, where points were that cannot have been the target's."""

    def __init__(self) -> None:
        self._places = np.zeros((0, 2))

    def others(self, rays: Rays, targets: Sequence[tuple[np.ndarray, float, float]]) -> np.ndarray:
        """Which points of a scan are known to be other objects': (n,).

        The target is at one of some places (2,) m with a standard deviation, m, and reaches so many
        m from there: `targets` has place, reach and deviation of each.
        """
        points, beyond = rays.points_world, np.full(len(rays.ranges), np.inf)
        for place, half, spread in targets:
            away = np.hypot(*(points - place).T) - half - GATE * spread
            beyond = np.minimum(beyond, away)
        if (beyond > APART).any():
            self._learn(points, beyond, segments(rays))
        if not len(self._places) or not len(points):
            return np.zeros(len(points), bool)
        from scipy.spatial import cKDTree

        return cKDTree(self._places).query(points)[0] < APART

    def _learn(self, points_world: np.ndarray, beyond: np.ndarray, labels: np.ndarray) -> None:
        """Remember the points (n, 2) m of the objects, labelled from 0 on, that are `beyond` reach.

        `beyond` (n,) is by how many m a point is.
        """
        nearest = np.full(labels.max() + 1, np.inf)
        np.minimum.at(nearest, labels, beyond)
        places = np.concatenate([self._places, points_world[nearest[labels] > APART]])
        _, first = np.unique(np.round(places / APART), axis=0, return_index=True)
        self._places = places[first]
