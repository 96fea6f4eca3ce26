"""Analytic disparities of a flat road, boxes on it and a wall; an ego car that does not move."""

import numpy as np
from constants import with_constants

from stixel_cli.scene.scenario import EgoMotion
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.free_space import find_free_space
from stixel_cli.stixels.parameters import (
    EstimatedRoad,
    ExtractionParameters,
    FreeSpaceParameters,
    HeightParameters,
    OccupancyParameters,
    RigRoad,
)

BOXES = [(-2.0, 9.0, 1.6, 1.5), (2.5, 16.0, 2.0, 1.7)]
"""x, depth, width, height, m."""

ROAD = RigRoad(kind="rig")
ESTIMATED_ROAD = with_constants(EstimatedRoad(kind="estimated", pitch_range=2.0), column_step=2)
OWN = {"polar": {}, "column_disparity": {"disparity_step": 0.25}, "cartesian": {"half_width": 30.0}}
GRIDS = [OccupancyParameters(kind=kind, nearest=3.0, farthest=50.0) for kind in OWN]
OCCUPANCIES = {grid.kind: with_constants(grid, **OWN[grid.kind]) for grid in GRIDS}
FREE_SPACE = with_constants(FreeSpaceParameters(0.3, 0.2, temporal_cost=0.1), spatial_limit=5.0)
TOPS = with_constants(HeightParameters(depth_margin=3.0, hidden_rows=0), smoothness=3.0)
STDS = {"least_std": 0.1, "edge_std": 0.1, "surface_std": 0.05}
EXTRACTION = ExtractionParameters(width=5, front_margin=0.3, refinement=0.0)
EXTRACTION = with_constants(EXTRACTION, smoothing=0.35, **STDS)


def columns_of(rig, box):
    """First and last column of a box, px."""
    at, distance, width, _ = box
    return rig.u0 + rig.focal * (at + np.array([-0.5, 0.5]) * width) / distance


def parked(count):
    return EgoMotion(np.arange(count) * 0.1, np.tile([0.0, 0.0, np.pi / 2], (count, 1)))


def render(rig, boxes=(), wall=None):
    """Raw disparities (H, W) int16 of a road, boxes (x, depth, width, height) and a wall's depth.

    Where nothing is met within 200 m there is no disparity.
    """
    v, u = np.mgrid[: rig.height, : rig.width].astype(np.float64)
    rays = np.stack([(u - rig.u0) / rig.focal, (v - rig.v0) / rig.focal, np.ones_like(u)], axis=-1)
    x, y, z = np.moveaxis(rays @ rig.level_from_camera.T, -1, 0)
    with np.errstate(divide="ignore"):
        depth = np.where(y > 0, rig.camera_height / y, np.inf)
    if wall is not None:
        depth = np.minimum(depth, wall / z)
    for at, distance, width, height in boxes:
        t = distance / z
        above = rig.camera_height - t * y
        hit = (np.abs(t * x - at) <= 0.5 * width) & (above >= 0) & (above <= height)
        depth = np.where(hit, np.minimum(depth, t), depth)
    raw = np.rint(16.0 * rig.focal * rig.baseline / depth)
    return np.where(depth < 200.0, raw, -1).astype(np.int16)


def as_disparities(*raw, first=0):
    """Raw images as the noun that stereo matching gives."""
    return Disparities.from_raw(first, 64, raw)


def find(disparities, rig, ego_motion=None, previous=None, **changed):
    """Their free space, by the parameters above but for what is `changed`."""
    frames = range(disparities.first, disparities.first + len(disparities))
    given = {"road": ROAD, "occupancy": OCCUPANCIES["polar"], "free_space": FREE_SPACE}
    given |= {"frames": frames, "previous": previous} | changed
    return find_free_space(disparities, ego_motion or parked(frames.stop), rig, **given)
