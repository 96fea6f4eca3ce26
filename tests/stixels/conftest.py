"""Analytic disparity images: a flat road, boxes on it and a wall, with no image behind them."""

import numpy as np
import pytest
from boxed_road import parked
from constants import with_constants

from stixel_cli.geometry.rig import Rig
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


def disparity_image(rig, boxes=(), wall=None):
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


@pytest.fixture(scope="session")
def render():
    return disparity_image


@pytest.fixture
def rig():
    return Rig(320, 160, None, 300.0, None, None, 0.5, 1.4, 0.0, None)


@pytest.fixture
def as_disparities():
    """Raw images as the noun that stereo matching gives."""

    return lambda *raw, first=0: Disparities.from_raw(first, 64, raw)


@pytest.fixture(scope="session")
def road():
    return RigRoad(kind="rig")


@pytest.fixture(scope="session")
def estimated_road():
    return with_constants(EstimatedRoad(kind="estimated", pitch_range=2.0), column_step=2)


@pytest.fixture(scope="session")
def occupancies():
    own = {"column_disparity": {"disparity_step": 0.25}, "cartesian": {"half_width": 30.0}}
    ends = {"nearest": 3.0, "farthest": 50.0}
    grids = [OccupancyParameters(kind=kind, **ends) for kind in ("polar", *own)]
    return {grid.kind: with_constants(grid, **own.get(grid.kind, {})) for grid in grids}


@pytest.fixture(scope="session")
def free_space():
    return with_constants(FreeSpaceParameters(0.3, 0.2, temporal_cost=0.1), spatial_limit=5.0)


@pytest.fixture
def find(road, occupancies, free_space):
    def run(disparities, rig, ego_motion=None, previous=None, **changed):
        frames = range(disparities.first, disparities.first + len(disparities))
        given = {"road": road, "occupancy": occupancies["polar"], "free_space": free_space}
        given |= {"frames": frames, "previous": previous} | changed
        return find_free_space(disparities, ego_motion or parked(frames.stop), rig, **given)

    return run


@pytest.fixture(scope="session")
def height():
    return with_constants(HeightParameters(depth_margin=3.0, hidden_rows=0), smoothness=3.0)


@pytest.fixture(scope="session")
def extraction():
    plain = ExtractionParameters(width=5, front_margin=0.3, refinement=0.0)
    stds = {"least_std": 0.1, "edge_std": 0.1, "surface_std": 0.05}
    return with_constants(plain, smoothing=0.35, **stds)
