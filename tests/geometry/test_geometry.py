"""Poses, rigs and polygons."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from projection import project, unproject

from stixel_cli.geometry.kernel import first_hits
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
from stixel_cli.geometry.rig import Rig

poses = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-7, 7)).map(np.array)
POINTS = np.array([[1.0, 0.0], [0.0, 1.0], [-2.0, 3.5]])


def test_axes_point_along_the_heading():
    moved = world_from_target(POINTS[:2], np.array([5.0, 6.0, np.pi / 2]))
    np.testing.assert_allclose(moved, [[5, 7], [4, 6]], atol=1e-12)
    same = world_from_ego(POINTS, np.array([0.0, 0.0, STRAIGHT_AHEAD]))
    np.testing.assert_allclose(same, POINTS, atol=1e-12)
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


RIG = Rig(640, 480, 60.0, None, None, None, 0.3, 1.2, 1.0, None)


def test_fields_of_view_give_the_focal_lengths_and_include_the_outermost_pixels():
    assert RIG.focal == pytest.approx(320.0 / np.tan(np.radians(30.0)))
    assert RIG.field_of_view == pytest.approx(np.radians([-30.0, 30.0]))
    same = replace(RIG, horizontal_fov=None, focal_length=RIG.focal)
    assert same.field_of_view == pytest.approx(RIG.field_of_view)
    assert RIG.focal_v == RIG.focal
    tall = replace(RIG, vertical_fov=40.0)
    assert tall.focal == RIG.focal
    assert tall.focal_v == pytest.approx(240.0 / np.tan(np.radians(20.0)))
    border = project(tall, [[0.0, np.tan(np.radians(20.0)), 1.0]])
    np.testing.assert_allclose(border[0, 1], 479.5)
    rig = replace(RIG, principal_u=200.0)
    right, left = rig.field_of_view
    points = [[-np.tan(left), 0.0, 1.0], [-np.tan(right), 0.0, 1.0]]
    np.testing.assert_allclose(project(rig, points)[:, 0], [-0.5, 639.5])


def test_principal_point_defaults_to_the_image_centre_and_depth_is_inverted():
    assert (RIG.u0, RIG.v0) == (319.5, 239.5)
    given_point = replace(RIG, principal_u=300.0, principal_v=0.0)
    assert (given_point.u0, given_point.v0) == (300.0, 0.0)
    assert RIG.depth_from_disparity(RIG.disparity_from_depth(17.0)) == pytest.approx(17.0)


@given(st.floats(-20, 20), st.floats(-5, 5), st.floats(0.5, 80))
def test_unproject_inverts_project(x, y, z):
    point = np.array([[x, y, z]])
    u, v, disparity = project(RIG, point)[0]
    assert disparity == pytest.approx(RIG.focal * RIG.baseline / z)
    assert u == pytest.approx(RIG.u0 + RIG.focal * x / z)
    assert v == pytest.approx(RIG.v0 + RIG.focal * y / z)
    np.testing.assert_allclose(unproject(RIG, np.array([[u, v, disparity]])), point, atol=1e-9)
    right = project(RIG, point - [RIG.baseline, 0.0, 0.0])[0]
    assert u - right[0] == pytest.approx(disparity)


def test_positive_pitch_points_the_camera_at_the_road():
    """The optical axis of a camera pitched down by 1 degree meets the road at h / tan(1 deg)."""
    transform = RIG.world_from_camera(np.array([0.0, 0.0, np.pi / 2]))
    reach = RIG.camera_height / np.sin(np.radians(1.0))
    foot = transform @ [0.0, 0.0, reach, 1.0]
    np.testing.assert_allclose(foot[[0, 2]], 0.0, atol=1e-9)
    assert foot[1] == pytest.approx(RIG.camera_height / np.tan(np.radians(1.0)))


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-7, 7), st.floats(-30, 30))
def test_world_from_camera_is_rigid_and_located_at_the_ego_pose(x, y, heading, pitch):
    transform = replace(RIG, pitch=pitch).world_from_camera(np.array([x, y, heading]))
    turn = transform[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    np.testing.assert_allclose(transform[:3, 3], [x, y, RIG.camera_height])
    ahead, right = turn[:, 2], turn[:, 0]
    flat = np.cos(np.radians(pitch)) * np.array([np.cos(heading), np.sin(heading)])
    np.testing.assert_allclose(ahead[:2], flat, atol=1e-12)
    np.testing.assert_allclose(right, [np.sin(heading), -np.cos(heading), 0.0], atol=1e-12)


SQUARE = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])


@given(seed=st.integers(0, 2**31))
def test_hits_are_those_of_another_program(seed):
    """Of a star with arms: where a long line first crosses its area."""
    random = np.random.default_rng(seed)
    angles = np.linspace(0.0, 2.0 * np.pi, 14, endpoint=False)
    polygon = random.uniform(0.4, 2.0, 14)[:, None] * np.stack([np.cos(angles), np.sin(angles)], 1)
    area = shapely.Polygon(polygon)
    origin = 9.0 * np.array([np.cos(seed), np.sin(seed)])
    towards = np.arctan2(*-origin[::-1]) + random.uniform(-0.3, 0.3, 20)
    directions = np.stack([np.cos(towards), np.sin(towards)], axis=-1)
    found = first_hits(polygon, np.tile(origin, (20, 1)), directions)
    for direction, hit in zip(directions, found, strict=True):
        crossed = area.intersection(shapely.LineString([origin, origin + 30.0 * direction]))
        if crossed.is_empty:
            assert np.isinf(hit)
        else:
            assert hit == pytest.approx(crossed.distance(shapely.Point(origin)), abs=1e-9)


def test_a_ray_along_an_edge_or_through_a_corner_meets_it_and_one_behind_does_not():
    origins = np.array([[3.0, 1.0], [3.0, 3.0], [3.0, 0.0], [3.0, 1.1]])
    directions = np.array([[-1.0, 0.0], [-np.sqrt(0.5), -np.sqrt(0.5)], [1.0, 0.0], [-1.0, 0.0]])
    found = first_hits(SQUARE, origins, directions)
    np.testing.assert_allclose(found, [2.0, 2.0 * np.sqrt(2.0), np.inf, np.inf], atol=1e-12)
