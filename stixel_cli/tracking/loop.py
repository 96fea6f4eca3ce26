"""The loop of a filter over scans, and the track of what the filter has after each."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.kalman import unit_variance
from stixel_cli.tracking.motion import intervals
from stixel_cli.tracking.track import Track


class Scan(NamedTuple):
    """One scan, in the world."""

    k: int
    """Its number."""
    interval: float
    """Time in s since the scan before; at the first, the filter starts one sample before it."""
    points: np.ndarray
    """(n, 2) m."""
    covariances: np.ndarray
    """(n, 2, 2) m²."""
    sensor: np.ndarray
    """(3,) its pose."""
    heights: np.ndarray | None
    """(n,) m of the points above the road; None: unknown."""


def each_scan(scans: Scans) -> Iterator[Scan]:
    """One after the other, the first too."""
    for k, interval in enumerate(intervals(scans.times)):
        rows = scans.rows(k)
        points, covariances = scans.points_world[rows], scans.covariances_world[rows]
        heights = None if scans.heights is None else scans.heights[rows]
        yield Scan(k, interval, points, covariances, scans.sensor_poses_world[k], heights)


class Filtered:
    """Gives the scans one after the other, and keeps what a filter has after each.

    Of several points of one bearing the filter gets the nearest, see `Scans.nearest_returns`.

    Attributes:
        states: means (K, d) and covariances (K, d, d).
    """

    def __init__(self, scans: Scans, size: int):
        """For a filter of `size` states, d."""
        count, (self._scans, self._rows) = len(scans), scans.nearest_returns()
        self.states = np.empty((count, size)), np.empty((count, size, size))
        self._used: list[np.ndarray] = []
        self._nis, self._degrees = np.full(count, np.nan), np.zeros(count, np.int64)

    def __iter__(self) -> Iterator[Scan]:
        """The scans, the first too: predict, update, and `add` the result before the next."""
        return each_scan(self._scans)

    def add(
        self,
        mean: np.ndarray,
        covariance: np.ndarray,
        indices: np.ndarray,
        nis: float = np.nan,
        degrees: int | None = None,
    ) -> None:
        """Keep mean (d,) and covariance (d, d) after a scan, and the indices (m,) of used points.

        `nis` has so many `degrees` of freedom, by default one a point; both count with points only.
        """
        k = len(self._used)
        for kept, value in zip(self.states, (mean, covariance), strict=True):
            kept[k] = value
        self._used.append(indices + self._scans.offsets[k])
        if len(indices):
            self._nis[k] = nis
            self._degrees[k] = len(indices) if degrees is None else degrees

    def widen_by_innovations(self) -> None:
        """Multiply each covariance by the `unit_variance` of the scans up to it."""
        sums = np.nancumsum(self._nis), np.cumsum(self._degrees)
        self.states[1][:] *= unit_variance(*sums)[:, None, None]

    def track(
        self,
        contours: tuple[np.ndarray, np.ndarray],
        states: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> Track:
        """The track with these `contours`, see `Track.of_scans`, and `states`: by default its own.

        They are six or more.
        """
        used = self._used, self._nis, self._degrees
        track = Track.of_scans(self._scans.times, states or self.states, contours, *used)
        return track.of_points(self._rows)
