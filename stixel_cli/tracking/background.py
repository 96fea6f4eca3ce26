"""What stood elsewhere while the target was tracked is not the target.

A target that is hidden is lost to sight and not gone. Its covariance grows, and soon the gate holds
what hides it, which fits a road user as well as any. But that stood there before, while the target
was known to be somewhere else; so only points at new places are candidates. And a target that is
seen does not grow into its neighbours.
"""

import numpy as np

from stixel_cli.measurements.clusters import GAP
from stixel_cli.tracking.contour.contour_rays import Rays

_NUMBER = np.array([2.0**26, 1.0])
"""Times the two whole numbers of a square is one number, in lexicographic order."""

_AROUND = (np.indices((3, 3)).reshape(2, -1).T - 1) @ _NUMBER
"""From a square to itself and its neighbours: what is nearer than a side is in one of them."""


class Background:
    """Places in the world, m, where points were that cannot have been the target's.

    An object is another one if it is farther by `GAP` than any point of the target may be. A place
    is remembered once in each square of this side, and a point is there if it is no farther away.
    """

    def __init__(self) -> None:
        self._places, self._squares = np.zeros((0, 2)), np.zeros(0)

    def others(self, rays: Rays, places: np.ndarray, reaches: np.ndarray) -> np.ndarray:
        """Which points of a scan are known to be other objects': (n,).

        The target is at one of the `places` (m, 2) m, and reaches so far (m,) from there, in m.
        """
        points = rays.points_world
        apart = np.linalg.norm(points[:, None] - places, axis=2) - reaches
        beyond = apart.min(axis=1) - GAP
        if (beyond > 0.0).any():
            self._learn(points, beyond, rays.labels)
        if not len(self._places) or not len(points):
            return np.zeros(len(points), bool)
        squares = (np.round(points / GAP) @ _NUMBER)[:, None] + _AROUND
        rows = np.searchsorted(self._squares, squares).clip(max=len(self._squares) - 1)
        return (np.linalg.norm(points[:, None] - self._places[rows], axis=2) < GAP).any(axis=1)

    def _learn(self, points_world: np.ndarray, beyond: np.ndarray, labels: np.ndarray) -> None:
        """Remember points (n, 2) m of the objects, labelled from 0 on, that are wholly `beyond`."""
        nearest = np.full(labels.max() + 1, np.inf)
        np.minimum.at(nearest, labels, beyond)
        places = np.concatenate([self._places, points_world[nearest[labels] > 0.0]])
        self._squares, first = np.unique(np.round(places / GAP) @ _NUMBER, return_index=True)
        self._places = places[first]
