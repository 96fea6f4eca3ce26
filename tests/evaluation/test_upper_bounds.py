from dataclasses import replace

import numpy as np
import pytest

from stixel_cli import compose
from stixel_cli.evaluation.upper_bounds import (
    best_star_convex_iou,
    between_heights,
    find_upper_bounds,
)
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.scene.scenario import is_star_convex

SQUARE = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]], float)


def test_a_star_convex_contour_has_no_upper_bound():
    assert best_star_convex_iou(SQUARE) == pytest.approx(1.0, abs=1e-12)
    assert best_star_convex_iou(SQUARE[:, ::-1] * [3.0, 1.0]) == pytest.approx(1.0, abs=1e-12)


def test_the_best_star_convex_contour_fills_a_small_gap_and_leaves_out_a_far_part():
    """A bar along +x from a unit square; a slot cuts it, and its far part is kept or given up.

    Filling the slot, of area g, wins the far part, of area f: (A) / (A + g) against (A - f) / A.
    """
    bar = np.array([[0.5, -0.1], [4.0, -0.1], [4.0, 0.1], [0.5, 0.1]])
    for slot, kept in ((0.02, True), (3.4, False)):
        # The slot is open at the top, and only a thread of 1e-6 m at the bottom joins the parts.
        cut = np.array(
            [bar[0], bar[1], bar[2], [0.55 + slot, 0.1], [0.55 + slot, -0.1 + 1e-6],
             [0.55, -0.1 + 1e-6], [0.55, 0.1], bar[3]]
        )  # fmt: skip
        shape = np.concatenate([[[0.5, -0.5]], cut, [[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]]])
        assert not is_star_convex(shape)
        near, far = 1.0 + 0.05 * 0.2, 0.2 * (4.0 - 0.55 - slot)
        filled = (near + far) / (near + far + 0.2 * slot)
        dropped = near / (near + far)
        assert (filled > dropped) == kept
        assert best_star_convex_iou(shape) == pytest.approx(max(filled, dropped), abs=0.02)


def test_triangles_are_cut_at_the_gated_heights():
    triangle = np.array([[[0, 0, 0], [4, 0, 0], [0, 0, 4]]], float)
    parts = between_heights(triangle, 1.0, 2.0)
    assert parts[..., 2].min() == 1.0 and parts[..., 2].max() == 2.0
    doubled = np.linalg.norm(np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0]), axis=1)
    assert doubled.sum() / 2.0 == pytest.approx(2.5)
    assert between_heights(triangle, 5.0, 6.0).shape == (0, 3, 3)
    np.testing.assert_array_equal(between_heights(triangle, 0.0, 4.0), triangle)


def test_upper_bounds_of_a_road_user():
    p = compose(["road_user=pedestrian", "path.duration=0.2"]).configuration
    scenario = build_scenario(ego_motion(p.ego, 0.2, 0.1), p.road_user, p.path)
    found = find_upper_bounds(scenario, p.road_user, p.measurement)
    assert np.isfinite(list(vars(found).values())).all()
    # The feet of a stride are below the gate.
    assert 0.5 < found.box_heights_upper_bound < 0.9 < found.star_convex_upper_bound < 1.0
    whole = replace(p.measurement, height_min=0.0)
    open_gate = find_upper_bounds(scenario, p.road_user, whole)
    assert open_gate.heights_upper_bound == pytest.approx(1.0, abs=1e-3)
    fabricated = compose(["measurement=fabricated"]).configuration.measurement
    without = find_upper_bounds(scenario, p.road_user, fabricated)
    assert without.star_convex_upper_bound == found.star_convex_upper_bound
    assert np.isnan([without.heights_upper_bound, without.box_heights_upper_bound]).all()
