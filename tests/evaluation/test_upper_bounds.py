from dataclasses import replace

import numpy as np
import pytest

from stixel_cli import compose
from stixel_cli.evaluation.contour_errors import best_star_convex_iou, star_convex_upper_bound
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


def test_the_bound_of_a_road_user_is_that_of_its_outline():
    p = compose(["road_user=pedestrian", "path.duration=0.2"]).configuration
    scenario = build_scenario(ego_motion(p.ego, 0.2, 0.1), p.road_user, p.path)
    # A stride is not star-convex.
    assert 0.9 < star_convex_upper_bound(scenario) < 0.999
    assert np.isnan(star_convex_upper_bound(replace(scenario, only_box=True)))
