"""The lidar's scanner and its noise-free returns."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.parameters import parameters


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
    """Noise-free returns of K scans of the whole scene, L layers of A beams each.

    Attributes:
        elevations: (L,) rad, ascending.
        azimuths: (A,) rad, ascending.
        ranges: (K, L, A) float32 m along the beams to the first surface; inf without a hit.
    """

    elevations: np.ndarray
    azimuths: np.ndarray
    ranges: np.ndarray

    def __len__(self) -> int:
        return len(self.ranges)
