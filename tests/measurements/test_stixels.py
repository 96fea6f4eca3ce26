"""Scans from stixels."""

import dataclasses

import numpy as np
import pytest
from made_stixels import made_stixels

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import FieldOfView
from stixel_cli.measurements.stixels import StixelsParameters, gather_scans
from stixel_cli.scene.scenario import EgoMotion

UNDISTURBED = {"dropout": None, "clutter_rate": 0.0}
HEIGHTS = {"height_min": 0.3, "height_max": 2.5}
GATES = StixelsParameters(kind="stixels", range_max=40.0, **UNDISTURBED, **HEIGHTS)
RIG = compose([]).configuration.rig


def stixels(first, per_frame, points, heights, covariances=None):
    if covariances is None:
        covariances = np.tile(np.diag([0.01, 0.25]), (len(points), 1, 1))
    columns = {"left": [0] * len(points), "right": [7] * len(points), "height": heights}
    columns |= {"points_ego": points, "covariances_ego": covariances}
    return made_stixels(first, np.cumsum([0, *per_frame]), **columns)


def ego(poses):
    return EgoMotion(0.1 * np.arange(len(poses)), np.array(poses, float))


def test_points_and_covariances_are_in_the_world_frame():
    poses = [[0, 0, np.pi / 2], [3, 4, np.pi / 2 + 0.4], [0, 0, 0.0]]
    first = stixels(0, [1, 2], [[1, 10], [2, 20], [0, 5]], [1, 1, 1])
    chunks = [first, stixels(2, [1], [[0, 5]], [1])]
    scans = gather_scans(iter(chunks), ego(poses), GATES, RIG)
    assert scans.offsets.tolist() == [0, 1, 3, 4]
    turn = rotation(0.4)
    expected = [[1, 10], [3, 4] + turn @ [2, 20], [3, 4] + turn @ [0, 5], [5, 0]]
    np.testing.assert_allclose(scans.points_world, expected, atol=1e-12)
    np.testing.assert_allclose(scans.covariances_world[1], turn @ np.diag([0.01, 0.25]) @ turn.T)
    # Ahead is now along x.
    np.testing.assert_allclose(scans.covariances_world[3], np.diag([0.25, 0.01]), atol=1e-12)


def test_scans_share_the_error_that_the_rig_states():
    """1 px at the right border and none elsewhere: a far point there moves by z² / (f B)."""
    right = (RIG.width - 1 - RIG.u0) / RIG.focal
    points = [[20.0 * right, 20.0], [0.0, 20.0]]
    moved = 400.0 / (RIG.focal * RIG.baseline)
    for std, expected in ((1.0, [[moved], [0.0]]), (0.0, np.zeros((2, 0)))):
        rig = dataclasses.replace(RIG, disparity_error_std=(0.0, 0.0, std))
        chunks = [stixels(0, [2], points, [1, 1])]
        scans = gather_scans(chunks, ego([[0, 0, np.pi / 2]]), GATES, rig)
        errors, pose = scans.shared_errors, scans.sensor_poses_world[0]
        found = errors.directions(scans.points_world, pose, np.zeros(3))
        np.testing.assert_allclose(np.abs(found[:, 1]), expected, rtol=1e-6, atol=1e-9)


def test_gates_use_only_height_and_range_and_drop_what_has_no_finite_position():
    points = [[0, 10]] * 4 + [[0, 0.9], [0, 1], [0, 40], [30, 30]]
    heights = [0.29, 0.3, 2.5, 2.51, 1, 1, 1, 1]
    chunks = [stixels(0, [8, 0], points, heights)]
    scans = gather_scans(chunks, ego([[0, 0, np.pi / 2]] * 2), GATES, RIG)
    assert scans.field_of_view == FieldOfView(*RIG.field_of_view, RIG.baseline)
    np.testing.assert_allclose(scans.points_world, [[0, 10], [0, 10], [0, 1], [0, 40]])
    assert scans.offsets.tolist() == [0, 4, 4]
    covariances = np.tile(np.eye(2), (3, 1, 1))
    covariances[1, 0, 0] = np.inf
    chunk = stixels(0, [3], [[0, 10], [0, 11], [np.nan, 12]], [1, 1, 1], covariances)
    scans = gather_scans([chunk], ego([[0, 0, np.pi / 2]]), GATES, RIG)
    np.testing.assert_allclose(scans.points_world, [[0, 10]])


@pytest.mark.parametrize("firsts", [(0,), (0, 2), (0, 1, 2)])
def test_frames_must_match_the_ego_motion(firsts):
    chunks = [stixels(first, [1], [[0, 10]], [1]) for first in firsts]
    with pytest.raises(ValueError, match=r"frame 1 expected, got 2|argument 2 is (short|long)er"):
        gather_scans(chunks, ego([[0, 0, np.pi / 2]] * 2), GATES, RIG)
