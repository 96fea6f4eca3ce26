"""Errors of the stixels on the target, of one frame after the other."""

from dataclasses import dataclass, fields

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.stixels.road import base_rows, road_line
from stixel_cli.stixels.types import Stixels
from stixel_cli.validation.stage_truth import FrameTruth

SQUARE = 0.2
"""The depths of a square face's pixels are within this, m, from the 10 % to the 90 % quantile."""


@dataclass(frozen=True)
class StixelErrors:
    """The stixels on the target, n frames concatenated, and how the target's columns are covered.

    A stixel is on the target if the target is the nearest obstacle in at least half of its columns.
    Errors are found minus true. A depth is compared with two truths, never with a mixture of them:

    - the *front face*: the nearest obstacle of a column (`stage_truth.frame_truth`), the median
      over the stixel's columns on the target;
    - its *own pixels*: the median depth of the target's pixels in the stixel's area. If their
      depths are within `SQUARE` the face is square, else slanted (or stepped).

    Attributes:
        offsets: (n + 1,) int64, frame i has the rows offsets[i]:offsets[i + 1].
        true_depth: (S,) m along the road, of the front face.
        disparity: (S,) px, error of the pitch-compensated disparity against the front face.
        depth: (S,) m, error against the front face.
        own_depth: (S,) m, error against the own pixels; NaN without such pixels.
        own_spread: (S,) m, from the 10 % to the 90 % quantile of the own pixels' true depths.
        sigma: (S,) m, the stixel's stated standard deviation in depth.
        lateral: (S,) m, error of the point to the right.
        top, base: (S,) px, errors of the rows, downwards. The true top is the target's topmost row
            in the column; the true base is where its nearest surface meets the road.
        height: (S,) m, error of the top's height above the road.
        columns, covered, matched: (n,) int64, columns whose nearest obstacle is the target; those
            of them in a stixel; those in a stixel whose disparity is not off by a gross error.
        shown, unseen: (n,) int64, columns that show the target at all, even too little of it for
            an obstacle (a wheel, a handlebar); those of them in no stixel within a gross error of
            the target's disparities in the column: the width of the target that no stixel covers.
        overhang: (n, 2) int64, columns next to the target, on its left and right, that a stixel
            with the target's disparity covers although they show no part of the target and have
            another depth.
        hanging: (n,) int64, stixels that cover such a column.
    """

    offsets: np.ndarray
    true_depth: np.ndarray
    disparity: np.ndarray
    depth: np.ndarray
    own_depth: np.ndarray
    own_spread: np.ndarray
    sigma: np.ndarray
    lateral: np.ndarray
    top: np.ndarray
    base: np.ndarray
    height: np.ndarray
    columns: np.ndarray
    covered: np.ndarray
    matched: np.ndarray
    shown: np.ndarray
    unseen: np.ndarray
    overhang: np.ndarray
    hanging: np.ndarray

    @property
    def square(self) -> np.ndarray:
        """Which stixels (S,) bool have own pixels on a square face."""
        return self.own_spread <= SQUARE

    @property
    def slanted(self) -> np.ndarray:
        """Which stixels (S,) bool have own pixels on a slanted or stepped face."""
        return self.own_spread > SQUARE

    @classmethod
    def joined(cls, parts: "list[StixelErrors]") -> "StixelErrors":
        """All frames of `parts`, at least one, in their order."""
        arrays = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(cls)
            if field.name != "offsets"
        }
        counts = np.concatenate([np.diff(part.offsets) for part in parts])
        return cls(offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), **arrays)


ROW_FIELDS = tuple(field.name for field in fields(StixelErrors))[1:11]
"""The fields (S,), `true_depth` to `height`: one value for each stixel."""


def stixel_errors(
    stixels: Stixels, index: int, truth: FrameTruth, rig: Rig, gross: float
) -> StixelErrors:
    """Errors of the `index`-th frame of `stixels`; beyond `gross` px a disparity is elsewhere."""
    rows = stixels.rows(index)
    found = np.full(rig.width, np.nan)
    owner = np.full(rig.width, -1)
    # What is behind the nearest obstacle comes after it, with the same columns.
    nearest = rows.start + np.flatnonzero(np.diff(stixels.left[rows], prepend=-1))
    for s in nearest:
        found[stixels.left[s] : stixels.right[s]] = stixels.disparity[s]
        owner[stixels.left[s] : stixels.right[s]] = s
    true = rig.disparity_from_depth(truth.nearest_depth)
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    records = [
        _errors_of(stixels, s, truth, line, rig)
        for s in nearest
        if 2 * truth.of_target[stixels.left[s] : stixels.right[s]].sum()
        >= stixels.right[s] - stixels.left[s]
    ]
    shown = truth.on_target.any(axis=0)
    sides = overhang(found, true, truth.of_target, shown, gross)
    with np.errstate(invalid="ignore"):
        matched = truth.of_target & (np.abs(found - true) <= gross)
    return StixelErrors(
        offsets=np.array([0, len(records)]),
        **dict(zip(ROW_FIELDS, np.array(records).reshape(-1, len(ROW_FIELDS)).T, strict=True)),
        columns=np.array([truth.of_target.sum()]),
        covered=np.array([np.sum(truth.of_target & np.isfinite(found))]),
        matched=np.array([matched.sum()]),
        shown=np.array([shown.sum()]),
        unseen=np.array([np.sum(shown & ~_on_surface(found, truth, rig, gross))]),
        overhang=np.array([[len(side) for side in sides]]),
        hanging=np.array([len({int(owner[u]) for side in sides for u in side})]),
    )


def _on_surface(found: np.ndarray, truth: FrameTruth, rig: Rig, gross: float) -> np.ndarray:
    """Whether `found` (W,) px is among the target's disparities in the column, up to `gross` px."""
    nearest = np.where(truth.on_target, truth.depth, np.inf).min(axis=0)
    farthest = np.where(truth.on_target, truth.depth, 0.0).max(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        most, least = rig.disparity_from_depth(nearest), rig.disparity_from_depth(farthest)
        return (found >= least - gross) & (found <= most + gross)


def overhang(
    found: np.ndarray, true: np.ndarray, of_target: np.ndarray, shown: np.ndarray, gross: float
) -> tuple[list[int], list[int]]:
    """Columns on the left and on the right of the target that are given the target's disparity.

    From the outermost column `of_target` (W,) on, as long as the stixel's disparity is within
    `gross` px of that column's true one and more than `gross` px from the truth of its own (a free
    column is always so). Columns in which the target is `shown` (W,), if too little of it for an
    obstacle (a wheel, a hand), are passed over. `found` and `true` (W,) px are NaN without an
    obstacle.
    """
    columns = np.flatnonzero(of_target)
    if len(columns) == 0:
        return [], []
    sides: tuple[list[int], list[int]] = ([], [])
    ends = ((columns[0], -1), (columns[-1], 1))
    for side, (edge, step) in zip(sides, ends, strict=True):
        u = int(edge) + step
        while 0 <= u < len(found) and abs(found[u] - true[edge]) <= gross:
            if abs(found[u] - true[u]) <= gross:
                break
            if not shown[u]:
                side.append(u)
            u += step
    return sides


def _errors_of(stixels: Stixels, s: int, truth: FrameTruth, line: np.ndarray, rig: Rig) -> tuple:
    """The values of `ROW_FIELDS` of stixel `s`; `line` (2,) px is the road's disparity."""
    left, right = stixels.left[s], stixels.right[s]
    u = np.arange(left, right)[truth.of_target[left:right]]
    area = slice(stixels.top[s], stixels.base[s] + 1), slice(left, right)
    surface = truth.depth[area][truth.on_target[area]]
    tops = np.argmax(truth.on_target[:, u], axis=0)
    # The upper edge of the topmost row that shows it, upright at that pixel's own depth.
    down = (tops - 0.5 - rig.v0) / rig.focal_v
    cosine, sine = np.cos(rig.pitch_radians), np.sin(rig.pitch_radians)
    below = (cosine * down + sine) / (cosine - sine * down)
    edge = rig.camera_height - below * truth.depth[tops, u]
    depth = float(np.median(truth.nearest_depth[u]))
    disparity = float(np.median(rig.disparity_from_depth(truth.nearest_depth[u])))
    base = np.clip(np.rint(base_rows(np.float64(disparity), line, rig)), 0, rig.height - 1)
    return (
        depth,
        stixels.disparity[s] - disparity,
        stixels.depth[s] - depth,
        stixels.depth[s] - np.median(surface) if surface.size else np.nan,
        np.subtract(*np.percentile(surface, [90, 10])) if surface.size else np.nan,
        np.sqrt(stixels.covariances_ego[s, 1, 1]),
        stixels.points_ego[s, 0] - truth.nearest_lateral[u].mean(),
        stixels.top[s] - np.median(tops),
        stixels.base[s] - base,
        stixels.height[s] - np.median(edge),
    )
