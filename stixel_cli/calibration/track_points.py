"""The stage that tracks static points through a recording, see `tracks`."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from stixel_cli.calibration.tracks import MOST_STEPS, Pair, Tracks, followed, gathered
from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.stereo.matching import MatchingParameters, match

MOST_FIRST = 8
"""First images of pairs in a recording: so many take two seconds, and more show little more."""


def track_points(
    pairs: Sequence[StereoPairs], stereo: MatchingParameters, rig: Rig, by_motion: bool
) -> Tracks:
    """Corners with a disparity in one image, and their places in a later one.

    `pairs` are chunks in the order of their frames, all but the last of one length. Nothing is
    tracked unless `by_motion`, and if the rig states its error.
    """
    found: list[Pair] = []
    if not by_motion or rig.states_error:
        return gathered(found)
    # Of a long recording only the images that are needed are loaded.
    chunk = lru_cache(2)(pairs.__getitem__)
    last, size = chunk(len(pairs) - 1), len(chunk(0))
    count = last.first + len(last)
    if count < 2:
        return gathered(found)
    left = lru_cache(MOST_STEPS + 1)(lambda k: chunk(k // size).left[k % size])
    for k in np.unique(np.linspace(0, count - 2, MOST_FIRST).astype(int)).tolist():
        pair = StereoPairs(k, (left(k),), (chunk(k // size).right[k % size],))
        disparity = match(pair, stereo, rig, range(k, k + 1)).pixels(0)
        images = map(left, range(k, min(k + MOST_STEPS + 1, count)))
        found += [(k, *row) for row in followed(images, disparity, rig)]
    return gathered(found)
