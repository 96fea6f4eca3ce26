"""Errors of stixels against the rendered truth."""

from dataclasses import replace

import numpy as np
import pytest
from stage_scene import (
    DISPARITY,
    GRID,
    PATH,
    ROAD,
    make_rig,
    perfect_stixels,
    scene,
    truth_of,
)
from stage_summaries import stixel_summary

from stixel_cli.rendering.frames import TARGET_ID
from stixel_cli.validation.stage_errors import (
    GROSS,
)
from stixel_cli.validation.stage_stixels import overhang, stixel_errors
from stixel_cli.validation.stage_truth import frame_truth


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
        "disparity_bias": 0.25,
        "depth_bias": -0.5,
        "depth_rms": 0.5,
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
    assert stixel_summary(errors)["gross"] == 1.0 and np.isnan(stixel_summary(errors)["depth_rms"])
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
