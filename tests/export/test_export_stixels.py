"""Which stixels an export gives to the target."""

import numpy as np
from made_stixels import made_stixels

from stixel_cli.export.stx1 import used_stixels
from stixel_cli.measurements.scans import Scans

GATES = (0.3, 2.5, 1.0, 40.0)


def stixels_of(first, heights_of_each):
    """Stixels of frames from `first` on, 10 m ahead; one below 0.3 m is no candidate."""
    heights = np.concatenate(heights_of_each)
    points = np.tile([0.0, 10.0], (len(heights), 1))
    offsets = np.cumsum([0, *map(len, heights_of_each)])
    return made_stixels(first, offsets, height=heights, points_ego=points)


def scans_with(counts):
    points = [(np.zeros((count, 2)), np.tile(np.eye(2), (count, 1, 1))) for count in counts]
    return Scans.of_each(np.arange(len(counts)), np.zeros((len(counts), 3)), points)


def test_clutter_and_dropouts_do_not_shift_the_stixels_of_the_target():
    # Frame 2 has two candidates and one clutter point, frame 3 a dropout, frame 4 no clutter.
    chunk = stixels_of(2, [[1.0, 0.1, 1.0], [1.0], [1.0, 1.0]])
    scans = scans_with([1, 0, 3, 0, 2])
    used = np.array([0, 2, 3, 4])  # In frame 2 the second candidate and the clutter.
    assert used_stixels(chunk, GATES, scans, used).tolist() == [0, 0, 1, 0, 1, 0]
