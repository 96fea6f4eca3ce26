"""Free space: how far every column can be driven, frame after frame."""

import cv2
import numpy as np

from stixel_cli.geometry.pose import ego_from_world, world_from_ego
from stixel_cli.geometry.rig import Rig
from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.nearest_obstacle import nearest_obstacle
from stixel_cli.stixels.occupancy import layout
from stixel_cli.stixels.parameters import (
    FreeSpaceParameters,
    OccupancyParameters,
    RoadParameters,
)
from stixel_cli.stixels.road import base_rows, find_road, pitch_factors
from stixel_cli.stixels.types import FreeSpace
from stixel_cli.stixels.unknown import unknown_rows


def find_free_space(
    disparities: Disparities,
    ego_motion: EgoMotion,
    rig: Rig,
    road: RoadParameters,
    occupancy: OccupancyParameters,
    free_space: FreeSpaceParameters,
    frames: range,
    previous: FreeSpace | None,
) -> FreeSpace:
    """Free space of `frames`, each with the solution before it moved by the ego motion.

    `previous` is the result for the frames before, whose last frame is read; None at the first.
    Disparities of the result are pitch-compensated, f B / depth along the road: with zero pitch
    they are the image's.
    """
    grid = layout(occupancy, rig, disparities.count)
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    unknown: list[np.ndarray] = []
    if previous is not None:
        last = (previous.disparity[-1], previous.base_row[-1], previous.road[-1])
    for k in frames:
        columns = cv2.transpose(disparities.raw(k - disparities.first))
        camera = (
            rig.pitch_radians + ego_motion.pitches[k],
            rig.camera_height + ego_motion.heights[k],
        )
        line = find_road(columns, disparities.count, rig, road, *camera)
        expected = None
        if found or previous is not None:
            before = found[-1] if found else last
            expected = expected_depth(*before, rig, *ego_motion.poses_world[[k - 1, k]])
        obstacle = nearest_obstacle(columns, line, expected, road, grid, free_space)
        base_row = obstacle_base(obstacle, line, rig)
        found.append((obstacle, base_row, line))
        unknown.append(unknown_rows(columns, base_row, line, road, grid, free_space))
    width = rig.width
    return FreeSpace(
        first=frames.start,
        disparity=np.array([f[0] for f in found], dtype=np.float32).reshape(-1, width),
        base_row=np.array([f[1] for f in found], dtype=np.int32).reshape(-1, width),
        road=np.array([f[2] for f in found], dtype=np.float64).reshape(-1, 2),
        unknown_row=np.array(unknown, dtype=np.int32).reshape(-1, width),
    )


def obstacle_base(obstacle: np.ndarray, line: np.ndarray, rig: Rig) -> np.ndarray:
    """Rows (W,) int32 of the feet of pitch-compensated obstacles (W,) px; -1 where free."""
    free = np.isnan(obstacle)
    rows = base_rows(np.where(free, 1.0, obstacle).astype(np.float64), line, rig)
    return np.where(free, -1, np.clip(np.rint(rows), 0, rig.height - 1)).astype(np.int32)


def expected_depth(
    obstacle: np.ndarray,
    base_row: np.ndarray,
    line: np.ndarray,
    rig: Rig,
    ego_before: np.ndarray,
    ego_now: np.ndarray,
) -> np.ndarray:
    """Depths (W,) in m of the last frame's obstacles now; NaN where no obstacle is expected.

    Args:
        obstacle, base_row, line: the last frame's solution, as `FreeSpace` has it.
        ego_before, ego_now: (3,) poses in the world of the last frame and of this one.
    """
    # Where the foot is hidden below the image its row is clipped; at that row depth is the same.
    factors = pitch_factors(line, rig).astype(np.float64)
    u = np.flatnonzero(base_row >= 0)
    depth = rig.focal * rig.baseline / obstacle[u].astype(np.float64)
    lateral = (u - rig.u0) * depth * factors[base_row[u]] / rig.focal
    points = np.stack([lateral, depth], axis=1)
    x, y = ego_from_world(world_from_ego(points, ego_before), ego_now).T
    ahead = y > 0.1
    x, y = x[ahead], y[ahead]
    rows = np.clip(np.rint(base_rows(rig.focal * rig.baseline / y, line, rig)), 0, rig.height - 1)
    column = rig.u0 + rig.focal * x / (y * factors[rows.astype(np.int64)])
    expected = np.full(rig.width, np.inf)
    # Columns spread when the car drives on: both neighbours take the point, the nearest counts.
    for neighbour in (np.floor(column), np.ceil(column)):
        inside = (neighbour >= 0) & (neighbour < rig.width)
        np.minimum.at(expected, neighbour[inside].astype(np.int64), y[inside])
    return np.where(np.isfinite(expected), expected, np.nan)
