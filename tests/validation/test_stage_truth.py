"""The truth with which each stage is compared."""

import numpy as np
import pytest
from constants import with_constants
from stage_scene import DISPARITY, GRID, PATH, ROAD, make_rig, scene, truth_of

from stixel_cli.rendering.frames import ROAD_ID, TARGET_ID
from stixel_cli.validation.stage_errors import frame_truth, inside_target, nearest_rows


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
        expected = None
        for n, v in enumerate(sorted(range(14), key=lambda v: depth[v, u]), start=1):
            z = depth[v, u]
            if np.isfinite(z) and n >= 3.0 and n >= 40.0 / z:
                expected = v
                break
        assert found[u] == (expected is not None)
        assert expected is None or rows[u] == expected
    assert not nearest_rows(np.full((4, 3), np.inf), 40.0, 3.0)[1].any()


def test_inside_pixels_depend_on_the_distance_to_another_object():
    truth = truth_of(make_rig())
    inside = inside_target(truth)
    for v, u in np.ndindex(inside.shape):
        window = truth.on_target[max(v - 2, 0) : v + 3, max(u - 2, 0) : u + 3]
        assert inside[v, u] == window.all()
    assert inside.any()
