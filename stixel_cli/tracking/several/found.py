"""Several road users of one run: the results of the stages `found_tracks` and `tracks`."""

from dataclasses import dataclass

import numpy as np

from stixel_cli.tracking.track import InitialState, Track

SLOWEST, OF_SENSOR = 0.3, 0.05
"""A road user is faster than this, m/s, plus this share of the sensor's speed: the error of the
sensor's motion moves all that stands still."""

LEAST_SCANS = 6
"""A road user is in so many scans, or more."""


def least_speed(of_sensor: float) -> float:
    """The speed, m/s, of the slowest road user that moves, given that of the sensor."""
    return SLOWEST + OF_SENSOR * of_sensor


@dataclass(frozen=True)
class FoundTrack:
    """A cluster of points that moves like a road user.

    Attributes:
        scans: (n,) int64, the scans that have the cluster, ascending.
        rows: for each of them the rows (n_k,) of the scans' arrays; no other track has them.
        confirmed: the scan up to which it was followed until it was clear that it moves.
        initial: the state one sample before the first of these scans.
    """

    scans: np.ndarray
    rows: tuple[np.ndarray, ...]
    confirmed: int
    initial: InitialState


@dataclass(frozen=True)
class ObjectTrack:
    """The track of one road user.

    Attributes:
        first: the first of its scans.
        confirmed: as in `FoundTrack`.
        track: from the first scan to its last. `used_points` are rows of all scans' arrays.
    """

    first: int
    confirmed: int
    track: Track
