"""Angles in radians."""

import numpy as np
from numpy.typing import ArrayLike


def wrap_angle(angle: ArrayLike) -> np.ndarray:
    """`angle`, any shape, rad, wrapped to the half-open interval (-pi, pi]."""
    return -np.remainder(-np.asarray(angle, dtype=np.float64) + np.pi, 2.0 * np.pi) + np.pi
