"""The stages and their truth: perfect inputs give no errors, injected ones come back."""

from dataclasses import replace

import numpy as np
import pytest
from constants import with_constants
from made_stixels import made_stixels

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import BACKGROUND_ID, ROAD_ID, SKY_ID, TARGET_ID, RenderedFrames
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.parameters import FreeSpaceParameters, OccupancyParameters, RigRoad
from stixel_cli.stixels.road import base_rows, road_line
from stixel_cli.stixels.types import FreeSpace
from stixel_cli.validation.stage_errors import (
    STIXEL_COLUMNS,
    disparity_errors,
    frame_truth,
    inside_target,
    missed_columns,
    nearest_rows,
    stage_errors,
    stixel_errors,
)

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
    seen = [(wall, 4.0, BACKGROUND_ID, (0, rig.width)), (depth, height, TARGET_ID, columns)]
    for distance, top, object_id, span in seen:
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
    names = ("left", "right", "top", "base", "disparity", "depth", "height")
    *values, lateral = map(np.array, zip(*rows, strict=True))
    columns = dict(zip(names, values, strict=True))
    columns |= {name: columns[name].astype(np.int32) for name in names[:4]}
    columns["points_ego"] = np.stack([lateral, columns["depth"]], axis=1)
    columns["covariances_ego"] = np.tile(np.diag([0.01, 0.25]), (len(rows), 1, 1))
    return made_stixels(first, disparity_variance=np.full(len(rows), 0.01), **columns)


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
    base = np.zeros((1, rig.width), np.int32)
    obstacles = FreeSpace(first, found[None].astype(np.float32), base, line[None], base - 1)
    disparities = Disparities.from_raw(first, 64, [raw.astype(np.int16)])
    inputs = rendered, disparities, obstacles, perfect_stixels(rig, truth, first=first)
    errors = stage_errors(*inputs, rig, ROAD, GRID, PATH, range(first, first + 1))
    return rig, truth, errors


def columns_of(errors):
    values = np.array(errors).reshape(-1, len(STIXEL_COLUMNS)).T
    return dict(zip(STIXEL_COLUMNS, values, strict=True))


def test_perfect_inputs_give_no_errors():
    _, truth, errors = perfect_errors()
    assert errors.first == 4
    frame = {name: value for name, (value,) in errors.frames.items()}
    assert frame["depth"] == pytest.approx(truth.nearest_depth[truth.of_target].min())
    assert frame["pixels"] == frame["valid"] > 0 and frame["gross"] == 0
    # The depth is rendered to a quarter of a millimetre.
    assert abs(frame["total"]) < 1e-3 * frame["pixels"] and frame["squares"] < 1e-3
    assert frame["columns"] == truth.of_target.sum() and frame["missed"] == 0
    stixels = {**errors.stixels}
    assert len(stixels["depth"]) > 3 and (stixels.pop("sigma") == 0.5).all()
    assert stixels.pop("depth") == pytest.approx(truth.nearest_depth[48])
    for name, values in stixels.items():
        assert np.abs(values).max() < 1e-3, name


def test_stage_errors_use_the_frame_number_in_every_chunk():
    rig, _, alone = perfect_errors(5, first=6)
    depth, ids = scene(rig, rig.depth_from_disparity(DISPARITY))
    truth = truth_of(rig)
    black, nothing = np.zeros((*ids.shape, 3), np.uint8), np.zeros_like(ids)
    raw = np.where(np.isfinite(depth), np.rint(16.0 * truth.disparity) + 5, -1).astype(np.int16)
    found = (rig.disparity_from_depth(truth.nearest_depth) + 5 / 16).astype(np.float32)
    nan, line = np.full(rig.width, np.nan, np.float32), road_line(0.0, rig.camera_height, rig)
    one = perfect_stixels(rig, truth)
    # Chunks that begin one, two and three frames before, with nothing in those frames.
    before = black, black, np.full_like(depth, np.inf), nothing
    rows = np.zeros((4, rig.width), np.int32)
    inputs = (
        RenderedFrames.from_frames(5, [before, (black, black, depth, ids)]),
        Disparities.from_raw(4, 64, [np.full_like(raw, -1)] * 2 + [raw]),
        FreeSpace(3, np.stack([nan] * 3 + [found]), rows, np.stack([line] * 4), rows - 1),
        replace(one, first=5, offsets=np.array([0, 0, one.offsets[-1]])),
    )
    errors = stage_errors(*inputs, rig, ROAD, GRID, PATH, range(6, 7))
    assert errors.first == 6
    for ours, theirs in ((errors.frames, alone.frames), (errors.stixels, alone.stixels)):
        for name in theirs:
            np.testing.assert_array_equal(ours[name], theirs[name], err_msg=name)


@pytest.mark.parametrize("shift", [-8, 5])
def test_disparity_offset_is_measured_as_bias(shift):
    _, _, errors = perfect_errors(shift)
    fine = errors.frames["valid"] - errors.frames["gross"]
    assert errors.frames["total"] / fine == pytest.approx(shift / 16, abs=1e-3)
    assert np.sqrt(errors.frames["squares"] / fine) == pytest.approx(abs(shift) / 16, abs=1e-3)


def test_gross_errors_are_counted_and_not_summed():
    truth = truth_of(make_rig())
    found = truth.disparity.copy()
    inside = np.argwhere(inside_target(truth))
    for (v, u), error in zip(inside, (0.5, -0.25, 1.5, -3.0, np.nan), strict=False):
        found[v, u] += error
    record = disparity_errors(found, truth)
    assert record["pixels"] == len(inside) == record["valid"] + 1 and record["gross"] == 2
    assert record["total"] == pytest.approx(0.25)
    assert record["squares"] == pytest.approx(0.25 + 0.0625)


def test_columns_are_missed_without_an_obstacle_or_with_a_farther_one():
    rig = make_rig()
    truth = truth_of(rig)
    path = np.full(rig.width, np.nan)
    path[40:45] = DISPARITY + np.array([0.5, -2.0, 2.0, -0.5, -1.5])
    assert np.flatnonzero(missed_columns(path, truth, rig)).tolist() == [41, 44, *range(45, 58)]


def test_stixel_errors_are_measured_on_square_faces_alone():
    rig = make_rig()
    truth = truth_of(rig)
    good = perfect_stixels(rig, truth)
    shift = np.array([0.0625, -0.5])
    moved = {"disparity": good.disparity + 0.25, "depth": good.depth - 0.5}
    moved |= {"height": good.height + 0.125, "points_ego": good.points_ego + shift}
    bad = replace(good, **moved)
    covered, errors = stixel_errors(bad, 0, truth, rig)
    assert covered.sum() == 3 * len(errors)
    expected = {"disparity": 0.25, "error": -0.5, "square": -0.5, "sigma": 0.5}
    expected |= {"lateral": 0.0625, "height": 0.125}
    for name, value in expected.items():
        assert columns_of(errors)[name] == pytest.approx(value, abs=1e-9), name
    assert columns_of(stixel_errors(good, 0, truth, rig)[1])["square"] == pytest.approx(0.0)
    # The lower third of the target is a metre nearer, as a bonnet is.
    rows = np.flatnonzero((truth.ids == TARGET_ID)[:, 48])
    depth = truth.depth.copy()
    depth[rows[-len(rows) // 3] :] -= 1.0
    errors = stixel_errors(good, 0, replace(truth, depth=depth), rig)[1]
    assert np.isnan(columns_of(errors)["square"]).all()
    # Columns 40 to 57 are the target's: of six columns two, three, and four are.
    names = ("top", "base", "disparity", "depth", "height", "points_ego", "covariances_ego")
    first = {name: getattr(good, name)[:1] for name in names}
    for shift, count in ((-4, 0), (-3, 1), (-2, 1)):
        columns = {"left": np.array([40 + shift]), "right": np.array([46 + shift])}
        one = replace(good, offsets=np.array([0, 1]), **columns, **first)
        assert len(stixel_errors(one, 0, truth, rig)[1]) == count


@pytest.mark.parametrize("pitch", [0.0, 2.0])
def test_stage_truth_matches_the_scene_at_any_pitch(pitch):
    rig = make_rig(pitch)
    truth = truth_of(rig)
    assert np.array_equal(np.flatnonzero(truth.of_target), np.arange(40, 58))
    assert truth.nearest_depth[40:58] == pytest.approx(rig.depth_from_disparity(DISPARITY))
    assert truth.nearest_depth[:40] == pytest.approx(25.0)
    on_target = truth.ids == TARGET_ID
    # Rendered depth is along the optical axis, in the column's nearest rows.
    depth = scene(rig, rig.depth_from_disparity(DISPARITY))[0][on_target]
    slope = (np.arange(40, 58) - rig.u0) / rig.focal
    assert np.all(truth.nearest_lateral[40:58] / slope >= depth.min() - 1e-9)
    assert np.all(truth.nearest_lateral[40:58] / slope <= depth.max() + 1e-9)
    if pitch:
        level = rig.depth_from_disparity(DISPARITY)
        assert np.all(np.abs(truth.nearest_lateral[40:58] / slope - level) > 1e-4)


def test_true_obstacles_exclude_low_small_and_far_objects_and_the_road():
    rig = make_rig()
    assert not truth_of(rig, height=0.2).of_target.any()
    assert np.isnan(truth_of(rig, wall=60.0).nearest_depth[:40]).all()
    assert truth_of(rig, depth=3.1).of_target.any()
    assert not truth_of(rig, depth=2.9).of_target.any()
    # What hangs higher than an obstacle may be is none, and the road is none at any height.
    depth, ids = scene(rig, 12.0, height=9.0)
    high = frame_truth(depth, ids, rig, with_constants(ROAD, least_height=2.9), GRID, PATH)
    assert not high.of_target.any()
    road = np.where(ids == TARGET_ID, ROAD_ID, ids)
    assert np.isnan(frame_truth(depth, road, rig, ROAD, GRID, PATH).nearest_depth[50])
    depth, ids = scene(rig, 12.0, columns=(0, 0))
    ids[30:34, 50] = TARGET_ID
    depth[30:34, 50] = 8.0
    # Four pixels are fewer than the five that free space asks for: the wall behind is the obstacle.
    assert not frame_truth(depth, ids, rig, ROAD, GRID, PATH).of_target.any()
    ids[34, 50], depth[34, 50] = TARGET_ID, 8.5
    found = frame_truth(depth, ids, rig, ROAD, GRID, PATH)
    assert found.of_target[50] and found.nearest_depth[50] == 8.5


def test_nearest_rows_match_a_plain_search():
    rng = np.random.default_rng(3)
    depth = np.where(rng.random((14, 30)) < 0.4, np.inf, rng.uniform(2.0, 30.0, (14, 30)))
    depth[:, 7] = np.inf
    rows, found = nearest_rows(depth, 40.0, 3.0)
    for u in range(30):
        order = np.argsort(depth[:, u])
        z, n = depth[order, u], np.arange(1, 15)
        expected = order[np.isfinite(z) & (n >= 3.0) & (n >= 40.0 / z)]
        assert found[u] == (len(expected) > 0)
        assert not len(expected) or rows[u] == expected[0]
    assert not nearest_rows(np.full((4, 3), np.inf), 40.0, 3.0)[1].any()


def test_inside_pixels_depend_on_the_distance_to_another_object():
    truth = truth_of(make_rig())
    inside = inside_target(truth)
    for v, u in np.ndindex(inside.shape):
        window = truth.on_target[max(v - 2, 0) : v + 3, max(u - 2, 0) : u + 3]
        assert inside[v, u] == window.all()
    assert inside.any()
