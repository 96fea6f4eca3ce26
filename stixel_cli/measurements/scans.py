"""Scans: what every tracker is given, whatever the sensor was."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Scans:
    """Candidate points of K scans, gated by the scene alone and by no tracker.

    An empty scan is an ordinary scan.

    Attributes:
        times: (K,) s.
        sensor_poses_world: (K, 3) x m, y m, heading rad of the sensor.
        offsets: (K + 1,) int64, the points of scan k are rows offsets[k]:offsets[k + 1].
        points_world: (P, 2) m.
        covariances_world: (P, 2, 2) m².
    """

    times: np.ndarray
    sensor_poses_world: np.ndarray
    offsets: np.ndarray
    points_world: np.ndarray
    covariances_world: np.ndarray

    def __len__(self) -> int:
        return len(self.times)

    def rows(self, k: int) -> slice:
        """The rows of scan k."""
        return slice(int(self.offsets[k]), int(self.offsets[k + 1]))
