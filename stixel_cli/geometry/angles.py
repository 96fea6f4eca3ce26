"""Angles in radians."""

import numpy as np


def wrap_angle(angle):
    """Wrap `angle` (any shape, rad) to the half-open interval (-pi, pi]."""
    return -np.remainder(-np.asarray(angle, dtype=np.float64) + np.pi, 2.0 * np.pi) + np.pi
