"""Errors of the stages: perfect inputs give none, injected ones come back, sums are plain sums."""

from dataclasses import replace

import numpy as np
import pytest
from constants import with_constants
from stage_scene import (
    DISPARITY,
    GRID,
    PATH,
    ROAD,
    make_rig,
    perfect_errors,
    perfect_stixels,
    scene,
    truth_of,
)
from stage_summaries import (
    column_summary,
    coverage_summary,
    disparity_summary,
    phase_bias,
    pooled,
    stixel_summary,
)

from stixel_cli.rendering.frames import TARGET_ID, RenderedFrames
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stixels.occupancy import layout
from stixel_cli.stixels.road import road_line
from stixel_cli.stixels.types import FreeSpace
from stixel_cli.validation.stage_errors import (
    GROSS,
    ZONES,
    column_errors,
    disparity_errors,
    grid_choice,
    has_surface,
    stage_errors,
    zones,
)


def test_perfect_inputs_give_no_errors():
    rig, truth, errors = perfect_errors()
    frames = np.array([True])
    assert errors.first == 4
    assert errors.target_depth == pytest.approx(truth.nearest_depth[truth.of_target].min())
    assert errors.target_pixels[0] == np.sum(truth.ids == TARGET_ID)
    for zone in range(2):
        of = disparity_summary(errors.disparity, frames, zone)
        assert of["pixels"] > 0 and of["density"] == 1.0 and of["gross"] == 0.0
        # The depth is rendered to a quarter of a millimetre.
        assert abs(of["bias"]) < 1e-3 and of["rms"] < 1e-3
    of = errors.columns
    assert of.path_there.all()
    columns = column_summary(of.true, of.path, of.path_there, rig)
    assert columns["columns"] == rig.width
    assert columns["missed"] == columns["below_threshold"] == columns["false_positive"] == 0.0
    assert columns["rms"] < 1e-3 and columns["rms_m"] < 1e-3
    stixels = stixel_summary(errors.stixels)
    assert stixels.pop("stixels") == np.diff(errors.stixels.offsets)[0] > 3
    assert stixels.pop("sigma") == 0.5
    assert stixels.pop("within_1") == stixels.pop("within_2") == 1.0
    # The target is one square face.
    assert np.isnan([stixels.pop("slanted_bias"), stixels.pop("slanted_rms")]).all()
    assert all(abs(value) < 1e-3 for value in stixels.values()), stixels
    cover = coverage_summary(errors.stixels, frames)
    assert cover["columns"] == truth.of_target.sum() and cover["elsewhere"] == 0.0
    assert cover["overhang"] == cover["hanging"] == 0.0


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
    errors = stage_errors(
        RenderedFrames.from_frames(
            5,
            [
                (black, black, np.full_like(depth, np.inf), nothing),
                (black, black, depth, ids),
            ],
        ),
        Disparities.from_raw(4, 64, [np.full_like(raw, -1)] * 2 + [raw]),
        FreeSpace(
            3,
            np.stack([nan] * 3 + [found]),
            np.zeros((4, rig.width), np.int32),
            np.stack([line] * 4),
        ),
        replace(one, first=5, offsets=np.array([0, 0, one.offsets[-1]])),
        rig,
        ROAD,
        GRID,
        PATH,
        range(6, 7),
    )
    assert errors.first == 6
    for name in ("disparity", "columns", "stixels"):
        ours, theirs = vars(getattr(errors, name)), vars(getattr(alone, name))
        for field in ours:
            np.testing.assert_array_equal(ours[field], theirs[field], err_msg=f"{name}.{field}")


@pytest.mark.parametrize("shift", [-8, 5])
def test_disparity_offset_is_measured_as_bias(shift):
    rig, _, errors = perfect_errors(shift)
    of = disparity_summary(errors.disparity, np.array([True]), 0)
    assert of["bias"] == pytest.approx(shift / 16, abs=1e-3)
    assert of["rms"] == pytest.approx(abs(shift) / 16, abs=1e-3)
    assert of["median"] == pytest.approx(shift / 16, abs=1 / 32)
    of = errors.columns
    columns = column_summary(of.true, of.path, of.path_there, rig)
    assert columns["bias"] == pytest.approx(shift / 16, abs=1e-3)
    metres = rig.depth_from_disparity(DISPARITY + shift / 16) - rig.depth_from_disparity(DISPARITY)
    chosen = (one[of.of_target] for one in (of.true, of.path, of.path_there))
    target = column_summary(*chosen, rig)
    assert target["bias_m"] == pytest.approx(metres, abs=1e-3)


def test_gross_errors_are_counted_and_excluded_from_bias_and_rms():
    rig = make_rig()
    truth = truth_of(rig)
    found = truth.disparity.copy()
    inside = np.argwhere(zones(truth.ids) == 0)
    for (v, u), error in zip(inside, (0.5, -0.25, 1.5, -3.0, np.nan), strict=False):
        found[v, u] += error
    record = disparity_errors(found, truth)
    assert record.valid[0] == len(inside) - 1 and record.gross[0] == 2
    assert record.total[0] == pytest.approx(0.25)
    assert record.squares[0] == pytest.approx(0.25 + 0.0625)
    assert record.histogram[0].sum() == record.valid[0]
    assert record.phase_count[0].sum() == record.valid[0] - 2
    assert record.phase_total[0].sum() == pytest.approx(0.25)


def test_sums_match_a_plain_loop_over_the_pixels():
    rng = np.random.default_rng(5)
    rig = make_rig()
    truth = truth_of(rig)
    truth = replace(truth, disparity=truth.disparity + rng.random(truth.disparity.shape))
    found = truth.disparity + rng.normal(0.0, 0.8, truth.disparity.shape)
    found[rng.random(found.shape) < 0.2] = np.nan
    record, zone = disparity_errors(found, truth), zones(truth.ids)
    count = np.zeros((len(ZONES), 10))
    total = np.zeros((len(ZONES), 10))
    gross = np.zeros(len(ZONES))
    for v, u in np.argwhere((zone >= 0) & np.isfinite(found)):
        error = found[v, u] - truth.disparity[v, u]
        if abs(error) > GROSS:
            gross[zone[v, u]] += 1
            continue
        phase = int(10 * (truth.disparity[v, u] % 1.0))
        count[zone[v, u], phase] += 1
        total[zone[v, u], phase] += error
    assert np.array_equal(record.gross, gross)
    assert np.array_equal(record.phase_count, count)
    assert record.phase_total == pytest.approx(total)


def test_choice_of_the_grid_ignores_smoothness_and_time():
    rig = make_rig()
    line = road_line(0.0, rig.camera_height, rig)
    raw = np.full((rig.height, rig.width), -1, np.int16)
    raw[25:40, :] = 16 * 8
    # One column has an obstacle of its own far in front: ties cost more than this cell.
    raw[25:40, 50] = 16 * 20
    grid = layout(GRID, rig, 64)
    tied = replace(PATH, spatial_cost=5.0)
    alone = grid_choice(raw, line, ROAD, grid, tied)
    assert alone[50] == pytest.approx(20.0, abs=0.3)
    assert np.delete(alone, 50) == pytest.approx(8.0, abs=0.3)


def test_columns_below_the_threshold_and_false_positives_are_counted():
    rig = make_rig()
    depth = rig.depth_from_disparity(DISPARITY)
    # 0.35 m high: within the height gate it is less than the least obstacle of 0.3 m.
    truth = truth_of(rig, depth=depth, height=0.35, wall=80.0)
    shows = (truth.ids == TARGET_ID).any(axis=0)
    assert shows.any() and np.isnan(truth.nearest_depth).all()
    found = np.full(rig.width, DISPARITY)
    of = column_errors(found, found + 1.5, truth, rig, ROAD)
    assert np.array_equal(of.grid_there, shows) and not of.path_there.any()
    columns = column_summary(of.true, of.grid, of.grid_there, rig)
    assert (
        columns["below_threshold"] == shows.mean()
        and columns["false_positive"] == 1.0 - shows.mean()
    )
    # Of the wall, beyond the grid's range, there is something too; of the road and above there is
    # nothing that stands.
    found[:] = rig.disparity_from_depth(np.float64(80.0))
    assert has_surface(found, truth, rig, ROAD).all()
    assert not has_surface(np.full(rig.width, np.nan), truth, rig, ROAD).any()
    low = with_constants(ROAD, least_height=-2.0, greatest_height=-1.0)
    assert not has_surface(found, truth, rig, low).any()


def test_columns_are_classified_as_missed_below_threshold_or_false_positive():
    nan = np.nan
    true = np.array([10.0, 10.0, 10.0, 10.0, nan, nan, 10.0, 10.0, 10.0])
    found = np.array([10.5, nan, 8.0, 12.0, nan, 5.0, 9.5, 7.0, 8.5])
    there = np.array([True, False, True, False, False, True, True, True, False])
    of = column_summary(true, found, there, make_rig())
    assert of["missed"] == pytest.approx(4 / 7)
    assert of["false_positive"] == of["below_threshold"] == pytest.approx(1 / 9)
    assert of["bias"] == 0.0 and of["rms"] == pytest.approx(0.5)
    empty = column_summary(np.zeros(0), np.zeros(0), np.zeros(0, bool), make_rig())
    assert all(np.isnan(value) for name, value in empty.items() if name != "columns")


def test_pooling_adds_frames_and_duplicates_do_not_change_means():
    _, _, errors = perfect_errors(5)
    twice = pooled([errors, errors])
    assert len(twice.target_depth) == 2 and len(twice.stixels.offsets) == 3
    one = disparity_summary(errors.disparity, np.array([True]), 2)
    both = disparity_summary(twice.disparity, np.array([True, True]), 2)
    assert both.pop("pixels") == 2 * one.pop("pixels") and both == pytest.approx(one)
    of_one, of_both = stixel_summary(errors.stixels), stixel_summary(twice.stixels)
    assert of_both.pop("stixels") == 2 * of_one.pop("stixels")
    assert of_both == pytest.approx(of_one, nan_ok=True)
    assert stixel_summary(twice.stixels, 20.0, 30.0)["stixels"] == 0.0
    centres, mean, count = phase_bias(twice.disparity, 0)
    assert centres[0] == pytest.approx(0.05) and count.sum() > 0
    assert mean[count > 0] == pytest.approx(5 / 16, abs=1e-3)
    with pytest.raises(ValueError, match="no record"):
        pooled([])
    narrow = replace(errors, columns=replace(errors.columns, true=errors.columns.true[:, :9]))
    with pytest.raises(ValueError, match="different widths"):
        pooled([errors, narrow])
