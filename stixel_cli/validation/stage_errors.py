"""Errors of the steps from disparity to stixels against the rendered truth, frame by frame.

The tables are small, so that frames of many runs can be pooled and binned by range afterwards.
Errors are found minus true. The truth is the result of a perfect stereo camera and perfect stixels;
its depths run along the level frame's z axis, parallel to the road, like those of the stixels.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import ROAD_ID, SKY_ID, TARGET_ID, RenderedFrames
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.parameters import FreeSpaceParameters, OccupancyParameters, RoadParameters
from stixel_cli.stixels.types import FreeSpace, Stixels

GROSS = 1.0
"""An error of more than this is gross, px."""

BORDER = 2
"""Pixels this near to another object are not inside: half the default matcher's block, px."""

SQUARE = 0.2
"""The depths of a square face's pixels are within this, m, from the 10 % to the 90 % quantile."""

STIXEL_COLUMNS = ("depth", "disparity", "error", "square", "sigma", "lateral", "height")


@dataclass(frozen=True)
class StageErrors:
    """Errors of all stages in n frames `first`, `first` + 1, …."""

    first: int
    """Index k of the first frame."""
    frames: dict[str, np.ndarray]
    """Columns (n,) by name. `depth`: m, true depth along the road of the target's nearest column,
    NaN without one. Of the pixels inside the target: `pixels`; `valid`, with a disparity; `gross`,
    of these, off by more than `GROSS`; `total` and `squares`, sums of the errors of the others, px
    and px². Of the image's columns: `columns`, whose nearest obstacle is the target; `missed`, in
    which free space has no obstacle, or one more than `GROSS` px farther; `uncovered`, without a
    stixel."""
    stixels: dict[str, np.ndarray]
    """Columns (S,) by name, one row for each stixel on the target: the target is the nearest
    obstacle in at least half of its columns. `depth`: m, the true one along the road, of the front
    face, which is the median nearest obstacle of its columns on the target (`frame_truth`);
    `disparity`, px, and `error`, m: errors against that; `square`: m, error of the depth against
    the median of the target's pixels in the stixel's area, NaN if their depths are not within
    `SQUARE`; `sigma`: m, the stated standard deviation in depth; `lateral`: m, error of the point
    to the right; `height`: m, error of the top's height above the road."""


@dataclass(frozen=True)
class FrameTruth:
    """Truth of one frame of the left camera."""

    disparity: np.ndarray
    """(H, W) px, f B / z of the image; 0 where there is nothing."""
    depth: np.ndarray
    """(H, W) m along the road; inf without a surface."""
    ids: np.ndarray
    """(H, W) uint8, as in `RenderedFrames`."""
    nearest_depth: np.ndarray
    """(W,) m along the road, of each column's nearest obstacle; NaN where free."""
    nearest_lateral: np.ndarray
    """(W,) m to the right of the camera, of the same point."""
    of_target: np.ndarray
    """(W,) bool, whether that obstacle is the target."""

    @cached_property
    def on_target(self) -> np.ndarray:
        """Which pixels (H, W) show the target."""
        return self.ids == TARGET_ID


def stage_errors(
    rendered: RenderedFrames,
    disparities: Disparities,
    obstacles: FreeSpace,
    stixels: Stixels,
    rig: Rig,
    road: RoadParameters,
    occupancy: OccupancyParameters,
    free_space: FreeSpaceParameters,
    frames: range,
) -> StageErrors:
    """Errors of `frames` of disparities, free space (`obstacles`), height and stixels."""
    rows, of_stixels = [], []
    for k in frames:
        i = k - rendered.first
        truth = frame_truth(rendered.depth(i), rendered.ids[i], rig, road, occupancy, free_space)
        nearest = truth.nearest_depth[truth.of_target]
        covered, errors = stixel_errors(stixels, k - stixels.first, truth, rig)
        of_stixels += errors
        path = obstacles.disparity[k - obstacles.first]
        depth = {"depth": nearest.min() if len(nearest) else np.nan}
        of_pixels = disparity_errors(disparities.pixels(k - disparities.first), truth)
        missed, uncovered = missed_columns(path, truth, rig), truth.of_target & ~covered
        counts = {"columns": len(nearest), "missed": missed.sum(), "uncovered": uncovered.sum()}
        rows.append(depth | of_pixels | counts)
    by_name = np.array(of_stixels, dtype=np.float64).reshape(-1, len(STIXEL_COLUMNS)).T
    return StageErrors(
        first=frames.start,
        frames={name: np.array([row[name] for row in rows]) for name in rows[0]},
        stixels=dict(zip(STIXEL_COLUMNS, by_name, strict=True)),
    )


def inside_target(truth: FrameTruth) -> np.ndarray:
    """Whether all within `BORDER` rows and columns of each pixel (H, W) show the target."""
    side = np.ones((2 * BORDER + 1, 2 * BORDER + 1), dtype=np.uint8)
    return cv2.erode(truth.on_target.astype(np.uint8), side) > 0


def disparity_errors(found: np.ndarray, truth: FrameTruth) -> dict[str, float]:
    """The columns of `StageErrors.frames` on pixels; `found` (H, W) px, NaN where invalid."""
    inside = inside_target(truth)
    error = found[inside].astype(np.float64) - truth.disparity[inside]
    error = error[np.isfinite(error)]
    fine = error[np.abs(error) <= GROSS]
    return {
        "pixels": np.sum(inside),
        "valid": len(error),
        "gross": len(error) - len(fine),
        "total": np.sum(fine),
        "squares": np.sum(fine**2),
    }


def missed_columns(path: np.ndarray, truth: FrameTruth, rig: Rig) -> np.ndarray:
    """Which columns (W,) miss the target: free space has no obstacle, or one too far.

    `path` (W,) px is pitch-compensated, NaN where free.
    """
    true = rig.disparity_from_depth(truth.nearest_depth).astype(np.float32)
    error = path.astype(np.float64) - true.astype(np.float64)
    return truth.of_target & ~(error >= -GROSS)


def stixel_errors(
    stixels: Stixels, index: int, truth: FrameTruth, rig: Rig
) -> tuple[np.ndarray, list[tuple[float, ...]]]:
    """Which columns (W,) have a stixel in a frame, and the `STIXEL_COLUMNS` of those on the target.

    Of stixels with the same columns only the nearest, the first, counts.
    """
    rows = stixels.rows(index)
    nearest = rows.start + np.flatnonzero(np.diff(stixels.left[rows], prepend=-1))
    covered, errors = np.zeros(rig.width, dtype=bool), []
    for s in nearest:
        left, right = stixels.left[s], stixels.right[s]
        covered[left:right] = True
        if 2 * truth.of_target[left:right].sum() >= right - left:
            errors.append(_errors_of(stixels, s, truth, rig))
    return covered, errors


def _errors_of(stixels: Stixels, s: int, truth: FrameTruth, rig: Rig) -> tuple[float, ...]:
    """The values of `STIXEL_COLUMNS` of stixel `s`."""
    left, right = stixels.left[s], stixels.right[s]
    u = np.arange(left, right)[truth.of_target[left:right]]
    area = slice(stixels.top[s], stixels.base[s] + 1), slice(left, right)
    surface, square = truth.depth[area][truth.on_target[area]], np.nan
    if surface.size and np.subtract(*np.percentile(surface, [90, 10])) <= SQUARE:
        square = stixels.depth[s] - np.median(surface)
    tops = np.argmax(truth.on_target[:, u], axis=0)
    # The upper edge of the topmost row that shows it, upright at that pixel's own depth.
    down = (tops - 0.5 - rig.v0) / rig.focal_v
    cosine, sine = np.cos(rig.pitch_radians), np.sin(rig.pitch_radians)
    below = (cosine * down + sine) / (cosine - sine * down)
    edge = rig.camera_height - below * truth.depth[tops, u]
    depth = np.median(truth.nearest_depth[u])
    return (
        depth,
        stixels.disparity[s] - np.median(rig.disparity_from_depth(truth.nearest_depth[u])),
        stixels.depth[s] - depth,
        square,
        np.sqrt(stixels.covariances_ego[s, 1, 1]),
        stixels.points_ego[s, 0] - truth.nearest_lateral[u].mean(),
        stixels.height[s] - np.median(edge),
    )


def frame_truth(
    depth_camera: np.ndarray,
    ids: np.ndarray,
    rig: Rig,
    road: RoadParameters,
    occupancy: OccupancyParameters,
    free_space: FreeSpaceParameters,
) -> FrameTruth:
    """Truth of a frame from its rendered depth (H, W) m along the optical axis and ids (H, W).

    **A column's nearest obstacle.** Of the column's pixels that are neither road nor sky and are
    between `road.least_height` and `road.greatest_height` above the road, the nearest are taken
    until they are as many as the least obstacle that free space must find has at the depth
    of the last of them: max(`free_space.obstacle_pixels`, f `free_space.obstacle_height` / z). The
    last one's depth is the obstacle's, if it is within the grid's range. So the truth has no
    smaller obstacles than the grid must find, and one stray pixel is not an obstacle.
    """
    v = np.arange(rig.height)[:, None] - rig.v0
    cosine, sine = np.cos(rig.pitch_radians), np.sin(rig.pitch_radians)
    down = v / rig.focal_v
    depth_camera = depth_camera.astype(np.float64)
    depth = depth_camera * (cosine - sine * down)
    with np.errstate(invalid="ignore"):
        height = rig.camera_height - depth_camera * (cosine * down + sine)
    obstacle = (ids != ROAD_ID) & (ids != SKY_ID) & np.isfinite(depth_camera)
    obstacle &= (height >= road.least_height) & (height <= road.greatest_height)
    least = rig.focal_v * free_space.obstacle_height, free_space.obstacle_pixels
    rows, found = nearest_rows(np.where(obstacle, depth, np.inf), *least)
    columns = np.arange(rig.width)
    nearest = depth[rows, columns]
    found &= (nearest >= occupancy.nearest) & (nearest <= occupancy.farthest)
    with np.errstate(invalid="ignore"):
        lateral = (columns - rig.u0) / rig.focal * depth_camera[rows, columns]
    return FrameTruth(
        disparity=rig.disparity_from_depth(depth_camera),
        depth=depth,
        ids=ids,
        nearest_depth=np.where(found, nearest, np.nan),
        nearest_lateral=np.where(found, lateral, np.nan),
        of_target=found & (ids[rows, columns] == TARGET_ID),
    )


def nearest_rows(
    depth: np.ndarray, focal_height: float, least_pixels: float
) -> tuple[np.ndarray, np.ndarray]:
    """Row (W,) in each column of the pixel that completes the nearest obstacle, and whether one is.

    The n-th nearest pixel of depth z completes it if n is at least `least_pixels` and
    `focal_height` / z (the rows of an obstacle of a certain height). `depth` (H, W) is inf where
    there is no obstacle.
    """
    some = np.flatnonzero(np.isfinite(depth).any(axis=1))
    if len(some) == 0:
        return np.zeros(depth.shape[1], dtype=np.int64), np.zeros(depth.shape[1], dtype=bool)
    top = some[0]
    part = depth[top : some[-1] + 1]
    order = np.argsort(part, axis=0, kind="stable")
    ascending = np.take_along_axis(part, order, axis=0)
    rank = np.arange(1, len(part) + 1)[:, None]
    complete = np.isfinite(ascending)
    complete &= (rank >= least_pixels) & (rank >= focal_height / ascending)
    first = np.argmax(complete, axis=0)
    columns = np.arange(depth.shape[1])
    return order[first, columns] + top, complete[first, columns]
