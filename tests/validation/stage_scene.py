"""A target before a wall, as its truth and as each stage would find it without error."""

import numpy as np
from made_stixels import made_stixels

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import BACKGROUND_ID, ROAD_ID, SKY_ID, TARGET_ID, RenderedFrames
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.parameters import FreeSpaceParameters, OccupancyParameters, RigRoad
from stixel_cli.stixels.road import base_rows, road_line
from stixel_cli.stixels.types import FreeSpace
from stixel_cli.validation.stage_errors import frame_truth, stage_errors

ROAD = RigRoad(kind="rig")
GRID = OccupancyParameters(kind="polar", nearest=3.0, farthest=50.0)
PATH = FreeSpaceParameters(0.3, spatial_cost=0.2, temporal_cost=0.0)
DISPARITY = 10.0
"""Pitch-compensated, of the target: a whole number, so the stored disparities are exact."""


def make_rig(pitch=0.0):
    return Rig(96, 72, None, 80.0, None, None, 1.5, 1.2, pitch, None)


def scene(rig, depth, columns=(40, 58), height=1.5, wall=25.0):
    """Depth along the optical axis and ids: an upright target at `depth` m before an upright wall.

    Where the road would be beyond the wall there is the wall, up to 4 m; above it the sky.
    """
    v, u = np.mgrid[: rig.height, : rig.width].astype(np.float64)
    rays = np.stack([(u - rig.u0) / rig.focal, (v - rig.v0) / rig.focal, np.ones_like(u)], axis=-1)
    _, y, z = np.moveaxis(rays @ rig.level_from_camera.T, -1, 0)
    with np.errstate(divide="ignore"):
        t = np.where(y > 0, rig.camera_height / y, np.inf)
    ids = np.where(np.isfinite(t), ROAD_ID, SKY_ID)
    for distance, top, object_id, span in (
        (wall, 4.0, BACKGROUND_ID, (0, rig.width)),
        (depth, height, TARGET_ID, columns),
    ):
        at = distance / z
        above = rig.camera_height - at * y
        hit = (at < t) & (above >= 0) & (above <= top) & (u >= span[0]) & (u < span[1])
        t, ids = np.where(hit, at, t), np.where(hit, object_id, ids)
    return t, ids.astype(np.uint8)


def truth_of(rig, **options):
    options.setdefault("depth", rig.depth_from_disparity(DISPARITY))
    return frame_truth(*scene(rig, **options), rig, ROAD, GRID, PATH)


def perfect_stixels(rig, truth, width=3, first=0):
    """Stixels of the true nearest obstacles, of the groups of columns that show the target."""
    line = road_line(rig.pitch_radians, rig.camera_height, rig)
    rows = []
    for left in range(0, rig.width, width):
        u = np.arange(left, left + width)
        if not truth.of_target[u].all():
            continue
        depth = truth.nearest_depth[left]
        d = rig.disparity_from_depth(depth)
        top = np.argmax((truth.ids == TARGET_ID)[:, left])
        down = (top - 0.5 - rig.v0) / rig.focal
        p = rig.pitch_radians
        below = (np.cos(p) * down + np.sin(p)) / (np.cos(p) - np.sin(p) * down)
        base = int(np.rint(base_rows(np.float64(d), line, rig)))
        lateral = truth.nearest_lateral[u].mean()
        rows.append((left, left + width, top, base, d, depth, 1.2 - below * depth, lateral))
    left, right, top, base, d, depth, height, lateral = (
        np.array(c) for c in zip(*rows, strict=True)
    )
    n = len(rows)
    areas = {"left": left, "right": right, "top": top, "base": base}
    return made_stixels(
        first,
        **{name: value.astype(np.int32) for name, value in areas.items()},
        disparity=d,
        disparity_variance=np.full(n, 0.01),
        depth=depth,
        height=height,
        points_ego=np.stack([lateral, depth], axis=1),
        covariances_ego=np.tile(np.diag([0.01, 0.25]), (n, 1, 1)),
    )


def perfect_errors(shift=0, first=4):
    """`stage_errors` of a frame whose disparities are the truth, `shift` sixteenths of a px off."""
    rig = make_rig()
    depth, ids = scene(rig, rig.depth_from_disparity(DISPARITY))
    truth = truth_of(rig)
    black = np.zeros((*ids.shape, 3), np.uint8)
    rendered = RenderedFrames.from_frames(first, [(black, black, depth, ids)])
    exact = np.where(np.isfinite(depth), 16.0 * truth.disparity, -1)
    raw = np.where(np.isfinite(depth), np.rint(exact).astype(np.int16) + shift, -1)
    found = rig.disparity_from_depth(truth.nearest_depth) + shift / 16.0
    line = road_line(0.0, rig.camera_height, rig)
    obstacles = FreeSpace(
        first, found[None].astype(np.float32), np.zeros((1, rig.width), np.int32), line[None]
    )
    errors = stage_errors(
        rendered,
        Disparities.from_raw(first, 64, [raw.astype(np.int16)]),
        obstacles,
        perfect_stixels(rig, truth, first=first),
        rig,
        ROAD,
        GRID,
        PATH,
        range(first, first + 1),
    )
    return rig, truth, errors
