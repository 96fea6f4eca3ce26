"""Randomness that is named: one generator for each seed, stage and frame."""

import zlib

import numpy as np


def generator(seed: int, stage: str, k: int = 0) -> "np.random.Generator":
    """Generator of `stage` at frame `k` under the run's `seed` (all non-negative).

    It depends only on these three, so frames can be drawn in any order, on any worker.
    """
    return np.random.default_rng([seed, zlib.crc32(stage.encode()), k])
