"""Stixels of one frame against true disparities of the image's pixels, or against labels."""

from dataclasses import dataclass

import numpy as np

from stixel_cli.geometry.pose import rectangle, world_from_target
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.types import Labels
from stixel_cli.stixels.parameters import FreeSpaceParameters, RoadParameters
from stixel_cli.stixels.road import find_road, pitch_and_height, pitch_factors
from stixel_cli.stixels.types import FreeSpace, Stixels
from stixel_cli.validation.point_errors import ranges_along
from stixel_cli.validation.stage_errors import nearest_rows

LEAST_PIXELS = 4
"""With a true disparity, in the area of a stixel."""

LEAST_ROWS = 0.25
"""Share of the rows of the area's lower half that have a true disparity."""

SQUARE = 0.5
"""A surface is square if its true disparities differ by less, from 10 % to 90 %, px."""

FOOT, TOP = 0.25, 2.0
"""Heights above the road between which stixels are compared, m."""

OUTLIER_PX, OUTLIER_SHARE = 3.0, 0.05
"""An outlier has a greater error, px and of the true disparity (Menze, Geiger 2015)."""

ELSEWHERE = 1.5
"""An obstacle is called free where the column is found free this far behind it, m."""


@dataclass(frozen=True)
class AreaErrors:
    """Stixels against the truth in their areas, one row per stixel with enough of it."""

    stixels: np.ndarray
    """(n,) their indices."""
    errors: np.ndarray
    """(n,) px, found disparity minus the median of the true ones."""
    spreads: np.ndarray
    """(n,) px, of the true disparities, from 10 % to 90 %."""
    truths: np.ndarray
    """(n,) px, the median of the true ones."""

    @property
    def square(self) -> np.ndarray:
        """Which stixels (n,) bool are on square surfaces."""
        return self.spreads < SQUARE

    @property
    def outliers(self) -> np.ndarray:
        """Which stixels (n,) bool are outliers, see `is_outlier`."""
        return is_outlier(self.errors, self.truths)


def is_outlier(errors: np.ndarray, truths: np.ndarray) -> np.ndarray:
    """Which `errors`, any shape, px, are outliers, given the true disparities, px."""
    return np.abs(errors) > np.maximum(OUTLIER_PX, OUTLIER_SHARE * truths)


def area_errors(stixels: Stixels, index: int, truth: np.ndarray, rig: Rig) -> AreaErrors:
    """Errors of the `index`-th frame of `stixels`; `truth` (H, W) px, NaN where unknown.

    Both are pitch-compensated, see `compensated`. The area of a stixel is its part between `FOOT`
    and `TOP` m above the road: a stixel represents the front of an object on the road, not a wall
    above it.
    """
    rows = []
    for s in range(*stixels.rows(index).indices(len(stixels.left))):
        # A height h has f_v h / z = (f_v / f) h d / B rows.
        per_metre = rig.focal_v / rig.focal * stixels.disparity[s] / rig.baseline
        first = max(stixels.top[s], round(stixels.base[s] - TOP * per_metre), 0)
        last = round(stixels.base[s] - FOOT * per_metre)
        area = truth[first : max(last, 0) + 1, stixels.left[s] : stixels.right[s]]
        known = np.isfinite(area)
        values = area[known]
        # Truth in the upper half only is what is seen above an object, or through its windows.
        lower = known[len(known) // 2 :].any(axis=1)
        if len(values) >= LEAST_PIXELS and lower.mean() >= LEAST_ROWS:
            spread = np.subtract(*np.percentile(values, [90, 10]))
            true = np.median(values)
            rows.append((s, stixels.disparity[s] - true, spread, true))
    indices, *values = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return AreaErrors(indices.astype(int), *values)


def nearest_disparity(stixels: Stixels, index: int, width: int) -> np.ndarray:
    """Disparity (W,) px of the nearest stixel in each column of a frame; NaN without one."""
    nearest = np.full(width, np.nan)
    for s in range(*stixels.rows(index).indices(len(stixels.left))):
        columns = slice(stixels.left[s], stixels.right[s])
        nearest[columns] = np.fmax(nearest[columns], stixels.disparity[s])
    return nearest


def found_columns(stixels: Stixels, index: int, obstacles: np.ndarray, rig: Rig) -> np.ndarray:
    """Columns (W,) bool whose true obstacle, at a depth (W,) m, has a stixel that is no outlier."""
    true, found = rig.disparity_from_depth(obstacles), np.zeros(rig.width, dtype=bool)
    for s in range(*stixels.rows(index).indices(len(stixels.left))):
        columns = slice(stixels.left[s], stixels.right[s])
        # Without an obstacle, the difference is NaN.
        difference = np.nan_to_num(stixels.disparity[s] - true[columns], nan=np.inf)
        found[columns] |= ~is_outlier(difference, true[columns])
    return found


def compensated(truth: np.ndarray, rig: Rig, road: RoadParameters) -> np.ndarray:
    """Pitch-compensated disparities (H, W) px of `truth` (H, W) px, by the road that it shows."""
    return truth * pitch_factors(_road_line(truth, rig, road), rig)[:, None]


def _road_line(truth: np.ndarray, rig: Rig, road: RoadParameters) -> np.ndarray:
    """Road line (2,) px of true disparities (H, W) px."""
    raw = np.where(np.isfinite(truth), np.rint(16.0 * truth), -1).astype(np.int16)
    return find_road(np.ascontiguousarray(raw.T), 256, rig, road)


def true_obstacles(
    truth: np.ndarray, rig: Rig, road: RoadParameters, free_space: FreeSpaceParameters
) -> np.ndarray:
    """Depth (W,) m, along the road, of each column's nearest true obstacle; NaN without one.

    As `stage_errors.frame_truth`, of the pixels with a true disparity. The road is the plane, with
    roll, of the true disparities.
    """
    line = _road_line(truth, rig, road)
    plane = road_plane(truth, line, rig)
    _, height = pitch_and_height(line, rig)
    with np.errstate(invalid="ignore", divide="ignore"):
        above = height * (1.0 - plane / truth)
        obstacle = (above >= road.least_height) & (above <= road.greatest_height)
        obstacle &= truth > plane + road.disparity_margin
        level = truth * pitch_factors(line, rig)[:, None]
        depth = np.where(obstacle, rig.depth_from_disparity(level), np.inf)
    if not obstacle.any():
        return np.full(rig.width, np.nan)
    # The truth of a laser has a part of the pixels only.
    share = max(float(np.isfinite(truth[obstacle.any(axis=1)]).mean()), 0.05)
    needed = share * rig.focal_v * free_space.obstacle_height
    rows, found = nearest_rows(depth, needed, max(share * free_space.obstacle_pixels, 2.0))
    return np.where(found, depth[rows, np.arange(rig.width)], np.nan)


def road_plane(truth: np.ndarray, line: np.ndarray, rig: Rig) -> np.ndarray:
    """Disparity (H, W) px of the road, with roll, by least squares near the `line` (2,) px."""
    height, width = truth.shape
    v, u = np.mgrid[:height, :width].astype(np.float64)
    u -= rig.u0
    plane = line[0] * v + line[1]
    for tolerance in (3.0, 1.5, 0.75, 0.75):
        with np.errstate(invalid="ignore"):
            near = (np.abs(truth - plane) < tolerance) & (plane > 4.0)
        if near.sum() < 100:
            break
        design = np.stack([v[near], np.ones(near.sum()), u[near]], axis=1)
        a, b, c = np.linalg.lstsq(design, truth[near].astype(np.float64), rcond=None)[0]
        plane = a * v + b + c * u
    return plane


def label_obstacles(
    labels: list[Labels], frame: int, rig: Rig, left_camera: tuple[float, float, float]
) -> np.ndarray:
    """Depth (W,) m of the nearest labelled box that each column sees; NaN without one."""
    nearest = np.full(rig.width, np.nan)
    for one in labels:
        for row in np.flatnonzero(one.frames == frame):
            nearest = np.fmin(nearest, label_face(one, row, rig, left_camera))
    return nearest


def face_depths(contour: np.ndarray, rig: Rig) -> np.ndarray:
    """Depth (W,) m at which the ray of each column enters a contour (M, 2) m; NaN outside it.

    The contour is in the camera's frame: x ahead, y to the left.
    """
    angles = np.arctan((rig.u0 - np.arange(rig.width)) / rig.focal)
    depths = ranges_along(contour, angles) * np.cos(angles)
    return np.where(np.isfinite(depths), depths, np.nan)


def label_face(
    labels: Labels, row: int, rig: Rig, left_camera: tuple[float, float, float]
) -> np.ndarray:
    """Depth (W,) m at which the ray of each column enters a label's box; NaN outside it."""
    place = rig.level_from_camera @ (labels.places[row] - np.array(left_camera))
    _, width, length = labels.sizes[row]
    pose = np.array([place[2], -place[0], -labels.yaws[row] - 0.5 * np.pi])
    return face_depths(world_from_target(rectangle(length, width), pose), rig)


def called_free(
    free_space: FreeSpace, index: int, obstacles: np.ndarray, rig: Rig, within: float
) -> np.ndarray:
    """Columns (W,) bool in which a true obstacle nearer than `within` m is called free.

    In the `index`-th frame the found obstacle is more than `ELSEWHERE` m behind the true one of
    `true_obstacles`, and no part of the column is unknown: later stages take a column with an
    unknown part as unknown.
    """
    disparity = free_space.disparity[index].astype(np.float64)
    found = np.where(np.isnan(disparity), np.inf, rig.depth_from_disparity(disparity))
    known = free_space.unknown_row[index] < 0
    with np.errstate(invalid="ignore"):
        return (obstacles < within) & (found > obstacles + ELSEWHERE) & known
