"""Errors of the steps from disparity to stixels against the rendered truth, frame by frame.

The records are compact and additive, so that frames of many runs can be pooled and binned by range
afterwards. Errors are found minus true.
"""

from dataclasses import dataclass, fields, replace

import cv2
import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import ROAD_ID, SKY_ID, TARGET_ID, RenderedFrames
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.nearest_obstacle import nearest_obstacle
from stixel_cli.stixels.occupancy import Layout, layout
from stixel_cli.stixels.parameters import FreeSpaceParameters, OccupancyParameters, RoadParameters
from stixel_cli.stixels.types import FreeSpace, Stixels
from stixel_cli.validation.stage_stixels import StixelErrors, stixel_errors
from stixel_cli.validation.stage_truth import FrameTruth, frame_truth

GROSS = 1.0
"""An error of more than this is gross, px."""

BORDER = 2
"""Pixels this near to another object are the border: half the default matcher's block, px."""

ZONES = ("target, inside", "target, border", "other obstacles, inside")
PHASES = 10
HISTOGRAM_EDGES = np.linspace(-2.0, 2.0, 129)
"""Bins of the disparity errors, 1/32 px; values outside are in the first and the last bin."""


@dataclass(frozen=True)
class DisparityErrors:
    """Sums over the pixels of each zone of `ZONES`, for n frames.

    Attributes:
        pixels, valid, gross: (n, 3) int64; pixels of the zone, those with a disparity, and those
            of them that are off by more than `GROSS`.
        total, squares: (n, 3) px and px², sums over the valid pixels that are not gross.
        histogram: (n, 3, 128) int32 of the valid pixels' errors, see `HISTOGRAM_EDGES`.
        phase_count, phase_total: (n, 3, `PHASES`), number and sum of the same pixels' errors, by
            the fractional part of the true disparity.
    """

    pixels: np.ndarray
    valid: np.ndarray
    gross: np.ndarray
    total: np.ndarray
    squares: np.ndarray
    histogram: np.ndarray
    phase_count: np.ndarray
    phase_total: np.ndarray


@dataclass(frozen=True)
class ColumnErrors:
    """Nearest obstacles by column in n frames: pitch-compensated disparities in px, NaN where free.

    Attributes:
        of_target: (n, W) bool, whether the true nearest obstacle is the target.
        true: (n, W) float32.
        grid: (n, W) float32, the cell that the occupancy grid by itself would choose, column by
            column, without the path's ties to the neighbours and to the last frame.
        path: (n, W) float32, the obstacle of the free space.
        grid_there, path_there: (n, W) bool, whether any surface is in the column at the disparity
            of `grid` and `path`, even a small or low one, or one beyond the grid's range.
    """

    of_target: np.ndarray
    true: np.ndarray
    grid: np.ndarray
    path: np.ndarray
    grid_there: np.ndarray
    path_there: np.ndarray


@dataclass(frozen=True)
class StageErrors:
    """Errors of all stages in frames `first`, `first` + 1, ….

    Attributes:
        first: index k of the first frame.
        target_depth: (n,) m, true depth along the road of the target's nearest column; NaN where no
            column's nearest obstacle is the target.
        target_pixels: (n,) int64, how many pixels show the target.
        disparity, columns, stixels: of the steps.
    """

    first: int
    target_depth: np.ndarray
    target_pixels: np.ndarray
    disparity: DisparityErrors
    columns: ColumnErrors
    stixels: StixelErrors


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
    """Errors of `frames` of disparities, grid, free space (`obstacles`), height and stixels."""
    grid = layout(occupancy, rig, disparities.count)
    truths, disparity, columns, of_stixels = [], [], [], []
    for k in frames:
        i = k - rendered.first
        truth = frame_truth(rendered.depth(i), rendered.ids[i], rig, road, occupancy, free_space)
        raw = disparities.raw(k - disparities.first)
        found = disparities.pixels(k - disparities.first)
        line = obstacles.road[k - obstacles.first]
        alone = grid_choice(raw, line, road, grid, free_space)
        truths.append((_nearest(truth), int(np.sum(truth.ids == TARGET_ID))))
        disparity.append(disparity_errors(found, truth))
        path = obstacles.disparity[k - obstacles.first]
        columns.append(column_errors(alone, path, truth, rig, road))
        of_stixels.append(stixel_errors(stixels, k - stixels.first, truth, rig, GROSS))
    return StageErrors(
        first=frames.start,
        target_depth=np.array([depth for depth, _ in truths], dtype=np.float64),
        target_pixels=np.array([pixels for _, pixels in truths], dtype=np.int64),
        disparity=_stacked(DisparityErrors, disparity),
        columns=_stacked(ColumnErrors, columns),
        stixels=StixelErrors.joined(of_stixels),
    )


def zones(ids: np.ndarray) -> np.ndarray:
    """Index in `ZONES` (H, W) int8 of each pixel, -1 for road, sky and other objects' borders.

    A pixel is inside an object if all within `BORDER` rows and columns show the same one.
    """
    side = np.ones((2 * BORDER + 1, 2 * BORDER + 1), dtype=np.uint8)
    inside = cv2.erode(ids, side) == cv2.dilate(ids, side)
    of_target = ids == TARGET_ID
    other = inside & ~of_target & (ids != ROAD_ID) & (ids != SKY_ID)
    return np.select([of_target & inside, of_target, other], [0, 1, 2], -1).astype(np.int8)


def disparity_errors(found: np.ndarray, truth: FrameTruth) -> DisparityErrors:
    """Sums for one frame, without the leading n. `found` (H, W) px, NaN where invalid."""
    zone = zones(truth.ids)
    count, bins = len(ZONES), len(HISTOGRAM_EDGES) - 1
    looked_at = zone >= 0
    zone, true = zone[looked_at].astype(np.int64), truth.disparity[looked_at]
    error = found[looked_at].astype(np.float64) - true
    valid = np.isfinite(error)
    pixels = np.bincount(zone, minlength=count)
    zone, true, error = zone[valid], true[valid], error[valid]
    gross = np.abs(error) > GROSS
    bin_ = np.clip(np.searchsorted(HISTOGRAM_EDGES, error, side="right") - 1, 0, bins - 1)
    fine, small = zone[~gross], error[~gross]
    phase = np.minimum((true[~gross] % 1.0 * PHASES).astype(np.int64), PHASES - 1)

    def by_phase(weights=None):
        flat = np.bincount(fine * PHASES + phase, weights, minlength=count * PHASES)
        return flat.reshape(count, PHASES)

    return DisparityErrors(
        pixels=pixels,
        valid=np.bincount(zone, minlength=count),
        gross=np.bincount(zone[gross], minlength=count),
        total=np.bincount(fine, small, minlength=count),
        squares=np.bincount(fine, small**2, minlength=count),
        histogram=np.bincount(zone * bins + bin_, minlength=count * bins)
        .reshape(count, bins)
        .astype(np.int32),
        phase_count=by_phase(),
        phase_total=by_phase(small),
    )


def grid_choice(
    raw: np.ndarray,
    line: np.ndarray,
    road: RoadParameters,
    grid: Layout,
    free_space: FreeSpaceParameters,
) -> np.ndarray:
    """Pitch-compensated disparity (W,) px that the grid chooses in each column; NaN where free.

    Free space without its ties: E_s of Badino, Franke, Mester 2007 set to zero, no last frame.
    `raw` (H, W) int16 disparities, `line` (2,) the road's disparity a v + b.
    """
    untied = replace(free_space, spatial_cost=0.0)
    return nearest_obstacle(cv2.transpose(raw), line, None, road, grid, untied)


def column_errors(
    grid: np.ndarray, path: np.ndarray, truth: FrameTruth, rig: Rig, road: RoadParameters
) -> ColumnErrors:
    """The columns (W,) of one frame: choices of the grid and of the path next to the truth."""
    return ColumnErrors(
        of_target=truth.of_target,
        true=rig.disparity_from_depth(truth.nearest_depth).astype(np.float32),
        grid=grid.astype(np.float32),
        path=path.astype(np.float32),
        grid_there=has_surface(grid, truth, rig, road),
        path_there=has_surface(path, truth, rig, road),
    )


def has_surface(found: np.ndarray, truth: FrameTruth, rig: Rig, road: RoadParameters) -> np.ndarray:
    """Whether each column (W,) shows a surface above the road within `GROSS` px of `found`.

    `found` (W,) px is pitch-compensated, NaN where free. Every pixel below the clearance height
    counts that is neither road nor sky.
    """
    standing = (truth.ids != ROAD_ID) & (truth.ids != SKY_ID)
    with np.errstate(invalid="ignore"):
        standing &= truth.height <= road.greatest_height
        near = np.abs(rig.disparity_from_depth(truth.depth) - found) <= GROSS
    return (standing & near).any(axis=0)


def _nearest(truth: FrameTruth) -> float:
    depths = truth.nearest_depth[truth.of_target]
    return float(depths.min()) if len(depths) else float("nan")


def _stacked(kind, records):
    names = [field.name for field in fields(kind)]
    return kind(**{name: np.stack([getattr(r, name) for r in records]) for name in names})


@dataclass(frozen=True)
class ColumnKinds:
    """The result of each column; bool arrays of any one shape.

    Attributes:
        real: has a true nearest obstacle.
        hit: its obstacle was found within `GROSS` px.
        missed: it has one, and no obstacle was found, or one more than `GROSS` px farther.
        below_threshold: an obstacle was found where the column has no true one, or more than
            `GROSS` px nearer than the true one, at a surface below the threshold: smaller than the
            least obstacle, or beyond the grid's range.
        false_positive: the same, without a surface there.
    """

    real: np.ndarray
    hit: np.ndarray
    missed: np.ndarray
    below_threshold: np.ndarray
    false_positive: np.ndarray


def column_kinds(true: np.ndarray, found: np.ndarray, there: np.ndarray) -> ColumnKinds:
    """Kinds of columns of pitch-compensated disparities in px, any shape, NaN where free.

    See `ColumnErrors`.
    """
    real, any_ = np.isfinite(true), np.isfinite(found)
    error = found.astype(np.float64) - true.astype(np.float64)
    with np.errstate(invalid="ignore"):
        extra = any_ & (~real | (error > GROSS))
        return ColumnKinds(
            real=real,
            hit=np.abs(error) <= GROSS,
            missed=real & (~any_ | (error < -GROSS)),
            below_threshold=extra & there,
            false_positive=extra & ~there,
        )
