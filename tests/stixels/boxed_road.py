"""What stands on the analytic road of `conftest.py`, and an ego car that does not move."""

import numpy as np

from stixel_cli.scene.scenario import EgoMotion

BOXES = [(-2.0, 9.0, 1.6, 1.5), (2.5, 16.0, 2.0, 1.7)]
"""x, depth, width, height, m."""


def columns_of(rig, box):
    """First and last column of a box, px."""
    at, distance, width, _ = box
    return rig.u0 + rig.focal * (at + np.array([-0.5, 0.5]) * width) / distance


def parked(count):
    return EgoMotion(np.arange(count) * 0.1, np.tile([0.0, 0.0, np.pi / 2], (count, 1)))
