"""Errors of the stages: perfect inputs give none, injected ones come back, sums are plain sums."""

from dataclasses import replace

import numpy as np
import pytest
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
from stage_summaries import column_summary, coverage_summary

from stixel_cli.rendering.frames import BACKGROUND_ID, ROAD_ID, SKY_ID, TARGET_ID, RenderedFrames
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
from stixel_cli.validation.stage_stixels import overhang, stixel_errors
from stixel_cli.validation.stage_summary import (
    disparity_summary,
    histogram_median,
    phase_bias,
    pooled,
    stixel_summary,
)
from stixel_cli.validation.stage_truth import frame_truth, nearest_rows


@pytest.mark.parametrize("pitch", [0.0, 2.0])
def test_stage_truth_matches_the_scene_at_any_pitch(pitch):
    rig = make_rig(pitch)
    truth = truth_of(rig)
    assert np.array_equal(np.flatnonzero(truth.of_target), np.arange(40, 58))
    assert truth.nearest_depth[40:58] == pytest.approx(rig.depth_from_disparity(DISPARITY))
    assert truth.nearest_depth[:40] == pytest.approx(25.0)
    on_target = truth.ids == TARGET_ID
    assert truth.height[on_target].min() >= -1e-9 and truth.height[on_target].max() <= 1.5 + 1e-9
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
    high = frame_truth(depth, ids, rig, replace(ROAD, least_height=2.9), GRID, PATH)
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
        expected = None
        for n, v in enumerate(sorted(range(14), key=lambda v: depth[v, u]), start=1):
            z = depth[v, u]
            if np.isfinite(z) and n >= 3.0 and n >= 40.0 / z:
                expected = v
                break
        assert found[u] == (expected is not None)
        assert expected is None or rows[u] == expected
    assert not nearest_rows(np.full((4, 3), np.inf), 40.0, 3.0)[1].any()


def test_zones_depend_on_the_distance_to_another_object():
    ids = np.full((20, 20), ROAD_ID, np.uint8)
    ids[4:16, 2:10], ids[4:16, 10:18], ids[:4] = TARGET_ID, BACKGROUND_ID, SKY_ID
    zone = zones(ids)
    for v in range(20):
        for u in range(20):
            window = ids[max(v - 2, 0) : v + 3, max(u - 2, 0) : u + 3]
            inside = (window == ids[v, u]).all()
            expected = -1
            if ids[v, u] == TARGET_ID:
                expected = 0 if inside else 1
            elif ids[v, u] == BACKGROUND_ID and inside:
                expected = 2
            assert zone[v, u] == expected


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


def test_injected_stixel_errors_are_measured():
    rig = make_rig()
    truth = truth_of(rig)
    good = perfect_stixels(rig, truth)
    bad = replace(
        good,
        top=good.top - 2,
        base=good.base + 1,
        disparity=good.disparity + 0.25,
        depth=good.depth - 0.5,
        height=good.height + 0.125,
        points_ego=good.points_ego + np.array([0.0625, -0.5]),
    )
    of = stixel_summary(stixel_errors(bad, 0, truth, rig, GROSS))
    expected = {
        "bias_px": 0.25,
        "bias": -0.5,
        "rms": 0.5,
        "spread": 0.0,
        "square_bias": -0.5,
        "nees": 1.0,
        "lateral_bias": 0.0625,
        "top_bias": -2.0,
        "base_bias": 1.0,
        "height_bias": 0.125,
        "gross": 0.0,
    }
    assert {name: of[name] for name in expected} == pytest.approx(expected, abs=1e-9)
    gone = replace(good, disparity=good.disparity - 1.5)
    errors = stixel_errors(gone, 0, truth, rig, GROSS)
    assert stixel_summary(errors)["gross"] == 1.0 and np.isnan(stixel_summary(errors)["rms"])
    assert errors.matched[0] == 0 and errors.covered[0] > 0


def test_stixel_with_half_its_columns_on_the_target_belongs_to_it():
    rig = make_rig()
    truth = truth_of(rig)
    good = perfect_stixels(rig, truth)
    # Columns 40 to 57 are the target's: of six columns two, three, and four are.
    for shift, count in ((-4, 0), (-3, 1), (-2, 1)):
        first = {name: getattr(good, name)[:1] for name in ("top", "base", "disparity", "depth")}
        first |= {"height": good.height[:1], "points_ego": good.points_ego[:1]}
        one = replace(
            good,
            offsets=np.array([0, 1]),
            left=np.array([40 + shift]),
            right=np.array([46 + shift]),
            covariances_ego=good.covariances_ego[:1],
            **first,
        )
        assert np.diff(stixel_errors(one, 0, truth, rig, GROSS).offsets) == count
    # The lower third of the target is a metre nearer, as a bonnet is.
    rows = np.flatnonzero((truth.ids == TARGET_ID)[:, 48])
    depth = truth.depth.copy()
    depth[rows[-len(rows) // 3] :] -= 1.0
    stepped = stixel_errors(good, 0, replace(truth, depth=depth), rig, GROSS)
    assert stepped.own_depth == pytest.approx(0.0, abs=1e-9)
    # Its front face is the step, and the own pixels are on two depths: a face that is not square.
    assert stepped.own_spread == pytest.approx(1.0) and stepped.slanted.all()
    flat = stixel_errors(good, 0, truth, rig, GROSS)
    assert flat.own_spread == pytest.approx(0.0, abs=1e-9) and flat.square.all()
    assert np.isnan(stixel_summary(flat)["slanted_rms"])
    assert stixel_summary(stepped)["slanted_rms"] == pytest.approx(0.0, abs=1e-9)


def test_stixel_overhang_is_measured_on_its_side():
    rig = make_rig()
    truth = truth_of(rig)
    good = perfect_stixels(rig, truth)
    left, right = good.left.copy(), good.right.copy()
    left[0] = 36
    right[-1] += 1 + (58 - right[-1])
    errors = stixel_errors(replace(good, left=left, right=right), 0, truth, rig, GROSS)
    assert errors.overhang.tolist() == [[4, 1]] and errors.hanging[0] == 2


def test_overhang_ends_at_columns_with_their_own_disparity():
    true = np.array([9.5, np.nan, 2.0, 10.0, 10.0, 2.0])
    found = np.array([10.0, 10.0, 10.0, 10.0, 10.0, 2.0])
    of_target = np.array([False, False, False, True, True, False])
    # Column 0 has an obstacle of its own there; column 5 is what it should be.
    assert overhang(found, true, of_target, of_target, 1.0) == ([2, 1], [])
    assert overhang(found, true, np.zeros(6, bool), of_target, 1.0) == ([], [])
    # A wheel in column 2, too slight for an obstacle: it is the target that is seen there.
    shown = of_target | (np.arange(6) == 2)
    assert overhang(found, true, of_target, shown, 1.0) == ([1], [])


def test_wheel_below_the_obstacle_threshold_is_not_overhang():
    rig = make_rig()
    depth, ids = scene(rig, rig.depth_from_disparity(DISPARITY))
    # Four columns on the left in which two rows show the target.
    ids[44:46, 36:40], depth[44:46, 36:40] = TARGET_ID, rig.depth_from_disparity(DISPARITY)
    truth = frame_truth(depth, ids, rig, ROAD, GRID, PATH)
    assert not truth.of_target[36:40].any()
    good = perfect_stixels(rig, truth)
    left = good.left.copy()
    left[0] = 34
    errors = stixel_errors(replace(good, left=left), 0, truth, rig, GROSS)
    assert errors.overhang.tolist() == [[2, 0]] and errors.hanging[0] == 1


def test_width_that_no_stixel_covers_counts_thin_parts():
    rig = make_rig()
    depth, ids = scene(rig, rig.depth_from_disparity(DISPARITY))
    # Four columns on the left in which two rows show the target: a wheel.
    ids[44:46, 36:40], depth[44:46, 36:40] = TARGET_ID, rig.depth_from_disparity(DISPARITY)
    truth = frame_truth(depth, ids, rig, ROAD, GRID, PATH)
    good = perfect_stixels(rig, truth)
    covered = np.sum(good.right - good.left)
    errors = stixel_errors(good, 0, truth, rig, GROSS)
    assert errors.shown.tolist() == [22] and errors.unseen.tolist() == [22 - covered]
    # The first stixel also covers the wheel; then it has the disparity of what is behind.
    left, disparity = good.left.copy(), good.disparity.copy()
    left[0], gained = 36, good.left[0] - 36
    errors = stixel_errors(replace(good, left=left), 0, truth, rig, GROSS)
    assert errors.unseen.tolist() == [22 - covered - gained]
    disparity[0] -= 2.0
    errors = stixel_errors(replace(good, left=left, disparity=disparity), 0, truth, rig, GROSS)
    assert errors.unseen.tolist() == [22 - covered + good.right[0] - good.left[0]]


def test_choice_of_the_grid_ignores_smoothness_and_time():
    rig = make_rig()
    line = road_line(0.0, rig.camera_height, rig)
    raw = np.full((rig.height, rig.width), -1, np.int16)
    raw[25:40, :] = 16 * 8
    # One column has an obstacle of its own far in front: ties cost more than this cell.
    raw[25:40, 50] = 16 * 20
    grid = layout(GRID, rig, 64)
    tied = replace(PATH, spatial_cost=5.0)
    alone = grid_choice(raw, line, rig, ROAD, grid, GRID, tied)
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
    low = replace(ROAD, least_height=-2.0, greatest_height=-1.0)
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


def test_median_is_interpolated_within_a_bin():
    histogram = np.zeros(128, int)
    assert np.isnan(histogram_median(histogram))
    histogram[64] = 10
    assert histogram_median(histogram) == pytest.approx(1 / 64)
    histogram[65] = 30
    assert histogram_median(histogram) == pytest.approx(1 / 32 + 1 / 96)
