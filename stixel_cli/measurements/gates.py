"""The gates of height and range that make a stixel a candidate."""

import numpy as np

from stixel_cli.measurements.disturbance_parameters import Gates
from stixel_cli.stixels.types import Stixels


def candidates(chunk: Stixels, gates: Gates) -> np.ndarray:
    """Which stixels (S,) of a chunk are inside the gates; one that is not finite is not."""
    height_min, height_max, range_min, range_max = gates
    ranges = np.hypot(chunk.points_ego[:, 0], chunk.points_ego[:, 1])
    return (
        (chunk.height >= height_min)
        & (chunk.height <= height_max)
        & (ranges >= range_min)
        & (ranges <= range_max)
        & np.isfinite(chunk.covariances_ego).all(axis=(1, 2))
    )
