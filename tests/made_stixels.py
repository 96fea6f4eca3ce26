"""Stixels of which a test states what it is about."""

import numpy as np

from stixel_cli.stixels.types import Stixels


def made_stixels(first=0, offsets=None, **columns) -> Stixels:
    """Stixels with these columns, all of one frame without `offsets`; the others are zeros."""
    count = len(next(iter(columns.values())))
    shapes = {"points_ego": (count, 2), "covariances_ego": (count, 2, 2)}
    names = ("left", "right", "top", "base", "disparity", "disparity_variance", "depth", "height")
    values = {name: np.zeros(shapes.get(name, count)) for name in (*names, *shapes)}
    values |= {name: np.asarray(value) for name, value in columns.items()}
    return Stixels(first, np.array([0, count]) if offsets is None else offsets, **values)
