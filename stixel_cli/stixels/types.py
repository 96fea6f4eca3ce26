"""Results of the stages from disparity to stixels.

Disparities here are pitch-compensated: f B / depth along the level frame's z axis. An upright
object has a single one. With a pitch of zero they are the image's.
"""

from dataclasses import dataclass

import numpy as np

SAME_OBJECT = 1.5
"""Neighbouring stixels less than this apart in depth are on one object, m."""


@dataclass(frozen=True)
class FreeSpace:
    """The nearest obstacle of every image column, for n frames `first`, `first` + 1, …."""

    first: int
    """Index k of the first frame."""
    disparity: np.ndarray
    """(n, W) float32, disparity of the obstacle in px; NaN where the column is free."""
    base_row: np.ndarray
    """(n, W) int32, image row where that obstacle meets the road; -1 where free."""
    road: np.ndarray
    """(n, 2) float64, the road's disparity in row v: road[0] * v + road[1], px."""
    unknown_row: np.ndarray
    """(n, W) int32, nothing is known of the column from this row upwards to its obstacle; -1 where
    all is known."""


@dataclass(frozen=True)
class Stixels:
    """Stixels of n frames `first`, `first` + 1, …, concatenated; arrays have one row a stixel.

    They are ordered by `left`; those of more than one layer in the same columns by depth.

    Attributes:
        first: index k of the first frame.
        offsets: (n + 1,) int64, the stixels of frame i are rows offsets[i]:offsets[i + 1].
        left, right: (S,) int32, columns left … right - 1.
        top, base: (S,) int32, rows top … base, both inclusive.
        disparity: (S,) float64 px, and disparity_variance: (S,) px².
        depth: (S,) float64 m along the level frame's z axis.
        height: (S,) float64 m, of the top above the road.
        points_ego: (S, 2) float64 m on the ego car's ground plane.
        covariances_ego: (S, 2, 2) float64 m².
    """

    first: int
    offsets: np.ndarray
    left: np.ndarray
    right: np.ndarray
    top: np.ndarray
    base: np.ndarray
    disparity: np.ndarray
    disparity_variance: np.ndarray
    depth: np.ndarray
    height: np.ndarray
    points_ego: np.ndarray
    covariances_ego: np.ndarray

    def rows(self, index: int) -> slice:
        """The rows of the `index`-th frame here."""
        return slice(int(self.offsets[index]), int(self.offsets[index + 1]))

    def inside(self, gates: tuple[float, float, float, float]) -> np.ndarray:
        """Which stixels (S,) are candidates: finite, and inside the gates.

        `gates` are the least and greatest height above the road, and range, m.
        """
        height_min, height_max, range_min, range_max = gates
        ranges = np.hypot(self.points_ego[:, 0], self.points_ego[:, 1])
        inside = (self.height >= height_min) & (self.height <= height_max)
        inside &= (ranges >= range_min) & (ranges <= range_max)
        return inside & np.isfinite(self.covariances_ego).all(axis=(1, 2))


@dataclass(frozen=True)
class OccupancyGrid:
    """The occupancy grid of one frame, for its picture."""

    kind: str
    """One of "polar", "column_disparity" and "cartesian"."""
    values: np.ndarray
    """(R, C) float32, obstacle pixels per px of disparity (cartesian: per px²)."""
    depths: np.ndarray
    """(R,) m, depth of each row's centre, nearest first."""
    laterals: np.ndarray
    """(C,) m lateral position of each column (cartesian), else the image column u, px."""


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
