"""Scans of clusters of points: the rears of cars, a wall."""

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.measurements.scans import Scans

CONFIGURATION = compose(["start=scans", "tracker=box"]).configuration
PRIOR, STD = CONFIGURATION.prior, CONFIGURATION.start.std
REAR = np.stack([np.linspace(-0.85, 0.85, 8), np.zeros(8)], axis=1)
WALL = np.stack([np.linspace(-9.0, -8.0, 5), np.full(5, 25.0)], axis=1)
LONGEST = 7.0


def scans_of(points_of_each, poses=None):
    """Scans at 10 Hz of points (n, 2) m whose standard deviation is 0.1 m."""
    count = len(points_of_each)
    poses = np.tile([0.0, 0.0, STRAIGHT_AHEAD], (count, 1)) if poses is None else poses
    each = [(points, np.tile(0.01 * np.eye(2), (len(points), 1, 1))) for points in points_of_each]
    return Scans.of_each(0.1 * np.arange(count), poses, each)


def car(place, velocity, k):
    """The rear of a car at scan k, (8, 2) m."""
    return REAR + np.array(place) + 0.1 * k * np.array(velocity)
