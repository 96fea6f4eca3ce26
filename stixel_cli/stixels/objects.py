"""Objects of the frames: the result of the stage `objects`."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Objects:
    """Clusters of stixels of n frames `first`, `first` + 1, …; arrays have one row an object.

    The objects of a frame are in the order of their leftmost columns.

    Attributes:
        first: index k of the first frame.
        offsets: (n + 1,) int64, the objects of frame i are rows offsets[i]:offsets[i + 1].
        boxes: (B, 4) int32: left, right, top, base in the left image: columns left … right - 1,
            rows top … base.
        corners_ego: (B, 4, 2) m on the ego car's ground plane, the smallest rectangle that contains
            the stixels' points, the corners in order; its sides may be 0.
        counts: (B,) int64, stixels.
        of_stixels: (S,) int32, for each stixel of these frames the row of its object, or -1.
    """

    first: int
    offsets: np.ndarray
    boxes: np.ndarray
    corners_ego: np.ndarray
    counts: np.ndarray
    of_stixels: np.ndarray

    def rows(self, index: int) -> slice:
        """The rows of the `index`-th frame here."""
        return slice(int(self.offsets[index]), int(self.offsets[index + 1]))
