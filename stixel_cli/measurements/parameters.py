"""Parameters that kinds of measurements share: dropouts, clutter, gates; the lidar's scanner."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters

Seconds = Annotated[float, Ge(0), Le(1e6)]


@parameters(kw_only=True)
class Disturbance:
    """Disturbances of the scans of any sensor.

    Attributes:
        dropout: [first, last] time since the first scan, s: the scans between are empty, as while
            another object hides the target; null: no scan is emptied.
        clutter_rate: mean number of clutter points per scan.
    """

    dropout: tuple[Seconds, Seconds] | None
    clutter_rate: Annotated[float, Ge(0), Le(1000)]


RANGE_MIN = 1.0
"""Least distance from the sensor on the ground plane, m."""

Gates = tuple[float, float, float, float]
"""Least and greatest height above the road, least and greatest range, m."""


@parameters(kw_only=True)
class Gated(Disturbance):
    """Gates that make a point a candidate. They see only the point: no tracker and no truth.

    Attributes:
        height_min, height_max: of a point above the road, m: below are the ground, kerbs and errors
            of the road, above are walls, poles and trees.
        range_max: greatest distance from the sensor on the ground plane, m.
    """

    height_min: Annotated[float, Ge(0), Le(10)]
    height_max: Annotated[float, Gt(0), Le(100)]
    range_max: Annotated[float, Gt(RANGE_MIN), Le(1000)]

    range_min: ClassVar[float] = RANGE_MIN

    @property
    def gates(self) -> Gates:
        """The gates of height and range, m."""
        return self.height_min, self.height_max, self.range_min, self.range_max

    def check(self) -> None:
        """Raise ValueError unless the gate of height is open."""
        if self.height_max <= self.height_min:
            raise ValueError(
                f"measurement.height_max: must be > measurement.height_min ({self.height_min} m), "
                f"got {self.height_max} m"
            )


def check_dropout(measurement: Disturbance) -> None:
    """Raise ValueError if the dropout ends before it begins."""
    dropout = measurement.dropout
    if dropout is not None and dropout[1] < dropout[0]:
        raise ValueError(
            f"measurement.dropout: the second must be at least the first, got {list(dropout)}"
        )


def undisturbed(measurement: Disturbance) -> Disturbance:
    """The same measurement without dropout and clutter, as its own stages see it."""
    return replace(measurement, dropout=None, clutter_rate=0.0)


@parameters
class Scanner:
    """Directions and mounting of a lidar's beams: its noise-free returns depend only on these.

    Attributes:
        layers: number of layers, even in elevation from the lowest to the highest; a single one
            is in the middle.
        elevation_lowest, elevation_highest: degrees above the horizon, of the middle of a beam.
        azimuth_step: degrees between neighbouring beams of a layer.
        horizontal_fov: degrees, straight ahead in its middle; null is that of the camera rig.
        mount_height: of the lidar above the road, m.
    """

    layers: Annotated[int, Ge(1), Le(256)]
    elevation_lowest: Annotated[float, Ge(-80), Le(80)]
    elevation_highest: Annotated[float, Ge(-80), Le(80)]
    azimuth_step: Annotated[float, Ge(0.02), Le(30)]
    horizontal_fov: Annotated[float, Gt(0), Le(360)] | None
    mount_height: Annotated[float, Gt(0), Le(5)]


@dataclass(frozen=True)
class LidarReturns:
    """Noise-free returns of K scans of the whole scene, L layers of A beams each."""

    elevations: np.ndarray
    """(L,) rad, ascending."""
    azimuths: np.ndarray
    """(A,) rad, ascending."""
    ranges: np.ndarray
    """(K, L, A) float32 m along the beams to the first surface; inf without a hit."""
