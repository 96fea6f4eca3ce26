import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.evaluation.contour_errors import intersections_over_unions

SQUARE = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], float)


@pytest.mark.parametrize(
    ("true", "estimated", "score"),
    [
        (SQUARE, SQUARE, 1.0),
        (SQUARE, SQUARE[::-1], 1.0),
        (SQUARE, np.add(SQUARE, [1, 0]), 1.0 / 3.0),
        (SQUARE, np.add(SQUARE, [1, 1]), 1.0 / 7.0),
        (SQUARE, SQUARE * 0.5, 0.25),
        (SQUARE, np.add(SQUARE, [5, 0]), 0.0),
        (SQUARE, np.add(SQUARE, [2, 0]), 0.0),
        (SQUARE, SQUARE * 0.0, 0.0),
        (SQUARE, SQUARE * np.nan, 0.0),
        # A bow tie is two triangles of area 1.
        (SQUARE, SQUARE[[0, 1, 3, 2]], 0.5),
        # An L of area 3.
        (np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float), SQUARE, 0.75),
    ],
)
def test_iou_of_known_polygons(true, estimated, score):
    found = intersections_over_unions(estimated[None], true[None])
    np.testing.assert_allclose(found, [score], rtol=0, atol=1e-12)


def test_iou_does_not_depend_on_the_scale():
    """A pedestrian's area is well below 1 m²."""
    for scale in (0.01, 0.3, 50.0):
        found = intersections_over_unions(scale * SQUARE[None] + scale, scale * SQUARE[None])
        np.testing.assert_allclose(found, [1.0 / 7.0], rtol=0, atol=1e-12)


def test_iou_repairs_self_intersecting_polygons():
    estimated = np.array([SQUARE, SQUARE[[0, 1, 3, 2]], SQUARE * np.nan, np.add(SQUARE, [1, 0])])
    found = intersections_over_unions(estimated, np.array([SQUARE] * 4))
    np.testing.assert_allclose(found, [1.0, 0.5, 0.0, 1.0 / 3.0], rtol=0, atol=1e-12)


@given(seed=st.integers(0, 2**31), angle=st.floats(-4, 4), shift=st.floats(-100, 100))
def test_iou_is_invariant_to_rigid_motions(seed, angle, shift):
    random = np.random.default_rng(seed)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    first, second = random.uniform(-1, 1, (2, 1, 7, 2))
    plain = intersections_over_unions(first, second)
    moved = intersections_over_unions(first @ turn.T + shift, second @ turn.T + shift)
    np.testing.assert_allclose(moved, plain, atol=1e-9)
    np.testing.assert_allclose(intersections_over_unions(second, first), plain, atol=1e-12)
    assert 0.0 <= plain[0] <= 1.0
