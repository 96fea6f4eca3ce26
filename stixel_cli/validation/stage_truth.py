"""The result of a perfect stereo camera and perfect stixels in a frame, from the rendered truth.

Depths run along the level frame's z axis, parallel to the road, like those of the stixels.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import ROAD_ID, SKY_ID, TARGET_ID
from stixel_cli.stixels.parameters import FreeSpaceParameters, OccupancyParameters, RoadParameters


@dataclass(frozen=True)
class FrameTruth:
    """Truth of one frame of the left camera.

    Attributes:
        disparity: (H, W) px, f B / z of the image; 0 where there is nothing.
        depth: (H, W) m along the road; inf without a surface.
        ids: (H, W) uint8, as in `RenderedFrames`.
        nearest_depth: (W,) m along the road, of each column's nearest obstacle; NaN where free.
        nearest_lateral: (W,) m to the right of the camera, of the same point.
        of_target: (W,) bool, whether that obstacle is the target.
    """

    disparity: np.ndarray
    depth: np.ndarray
    ids: np.ndarray
    nearest_depth: np.ndarray
    nearest_lateral: np.ndarray
    of_target: np.ndarray

    @cached_property
    def on_target(self) -> np.ndarray:
        """Which pixels (H, W) show the target."""
        return self.ids == TARGET_ID


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
    rows, found = nearest_rows(
        np.where(obstacle, depth, np.inf),
        rig.focal_v * free_space.obstacle_height,
        free_space.obstacle_pixels,
    )
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
