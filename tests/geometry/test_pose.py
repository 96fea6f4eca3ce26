import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stixel_cli.geometry.pose import (
    STRAIGHT_AHEAD,
    ego_from_world,
    rotate_covariances,
    rotation,
    target_from_world,
    world_from_ego,
    world_from_target,
    wrap_angle,
)

poses = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-7, 7)).map(np.array)
POINTS = np.array([[1.0, 0.0], [0.0, 1.0], [-2.0, 3.5]])


def test_target_x_axis_points_along_heading():
    moved = world_from_target(POINTS[:2], np.array([5.0, 6.0, np.pi / 2]))
    np.testing.assert_allclose(moved, [[5, 7], [4, 6]], atol=1e-12)


def test_ego_y_axis_points_along_heading():
    np.testing.assert_allclose(
        world_from_ego(POINTS, np.array([0.0, 0.0, STRAIGHT_AHEAD])), POINTS, atol=1e-12
    )
    moved = world_from_ego(POINTS[:2], np.array([5.0, 6.0, np.pi]))
    np.testing.assert_allclose(moved, [[5, 7], [4, 6]], atol=1e-12)


@given(poses)
def test_frame_transforms_are_inverse(pose):
    for there, back in ((world_from_target, target_from_world), (world_from_ego, ego_from_world)):
        np.testing.assert_allclose(back(there(POINTS, pose), pose), POINTS, atol=1e-11)
        assert np.isclose(np.linalg.norm(np.diff(there(POINTS, pose), axis=0), axis=1),
                          np.linalg.norm(np.diff(POINTS, axis=0), axis=1)).all()  # fmt: skip


@given(st.floats(-7, 7))
def test_rotated_covariances_match_rotated_vectors(angle):
    spread = np.array([[2.0, 0.3], [0.3, 0.5]])
    turned = rotate_covariances(np.stack([spread, np.eye(2)]), angle)
    np.testing.assert_allclose(turned[0], rotation(angle) @ spread @ rotation(angle).T, atol=1e-12)
    np.testing.assert_allclose(turned[1], np.eye(2), atol=1e-12)
    np.testing.assert_allclose(np.linalg.eigvalsh(turned[0]), np.linalg.eigvalsh(spread))


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (np.pi, np.pi), (-np.pi, np.pi), (3 * np.pi, np.pi), (1.5 * np.pi, -0.5 * np.pi)],
)
def test_wrap_angle_returns_known_values(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped)


@given(st.floats(-1e3, 1e3))
def test_wrapped_angles_keep_their_direction(angle):
    wrapped = float(wrap_angle(angle))
    assert -np.pi < wrapped <= np.pi
    assert np.cos(wrapped) == pytest.approx(np.cos(angle), abs=1e-9)
    assert np.sin(wrapped) == pytest.approx(np.sin(angle), abs=1e-9)


def test_wrap_angle_accepts_any_shape():
    assert wrap_angle(np.zeros((2, 3))).shape == (2, 3)
