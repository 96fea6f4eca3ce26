"""Points whose heights are known: those of a real lidar, which sees bonnet, windscreen and roof."""

from functools import cache

import numpy as np
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.measurements.disturbance import CLUTTER_HEIGHT, disturb_scans
from stixel_cli.measurements.file import read_scans
from stixel_cli.measurements.lidar import lidar_scans
from stixel_cli.measurements.lidar_casting import cast_lidar
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.tracking import gp_ekf
from stixel_cli.tracking.baselines import rectangle
from stixel_cli.tracking.contour import contour
from stixel_cli.tracking.contour.class_shape import HEIGHTS
from stixel_cli.tracking.contour.contour_rays import FACES, at_heights, rays_of
from stixel_cli.tracking.contour.ray_table import outline_table
from stixel_cli.tracking.start import noisy_start


def configured(*overrides):
    return compose(["measurement=lidar_64", "path.duration=0.5", *overrides]).configuration


@cache
def cast():
    """The motion of the sensor, the ground truth and the beams of the 64-layer lidar on a car."""
    p = configured()
    motion = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(motion, p.road_user, p.path)
    field = p.rig.field_of_view
    scanner = p.measurement.scanner
    return motion, scenario, cast_lidar(scenario, p.road_user, p.world, scanner, field)


def seen(returns, *overrides):
    """Configuration, ground truth and scans of the beams."""
    p, (motion, scenario, beams) = configured(f"measurement.returns={returns}", *overrides), cast()
    return p, scenario, lidar_scans(beams, motion, p.measurement, p.rig.field_of_view, seed=0)


@pytest.mark.parametrize("tracker", ["contour", "gp_ekf", "rectangle"])
def test_of_all_returns_a_tracker_takes_the_nearest_of_each_bearing(tracker):
    (p, scenario, every), (_, _, nearest) = (
        seen(returns, f"tracker={tracker}") for returns in ("all", "nearest")
    )
    module = {"contour": contour, "gp_ekf": gp_ekf, "rectangle": rectangle}[tracker]
    initial = noisy_start(scenario, p.start, 0)
    of_all, of_nearest = (
        module.track(one, initial, p.prior, p.tracker) for one in (every, nearest)
    )
    np.testing.assert_allclose(of_all.means, of_nearest.means, atol=0.02)
    used, expected = (
        {tuple(one) for one in scans.points_world[track.used_points].round(9)}
        for scans, track in ((every, of_all), (nearest, of_nearest))
    )
    # A high point may fit before it is moved, and not after.
    assert len(used & expected) > 0.99 * len(used | expected)


def test_the_heights_are_those_of_the_returns_and_the_nearest_have_none():
    _, _, scans = seen("all")
    assert len(scans.heights) == len(scans.points_world)
    p, _, nearest = seen("nearest")
    assert nearest.heights is None
    assert p.measurement.height_min <= scans.heights.min()
    assert scans.heights.max() <= p.measurement.height_max
    assert np.ptp(scans.heights) > 0.8
    found, rows = scans.nearest_returns()
    np.testing.assert_array_equal(found.heights, scans.heights[rows])
    kept = {tuple(one) for one in found.points_world.round(9)}
    assert {tuple(one) for one in nearest.points_world.round(9)} <= kept
    assert len(kept) < 0.2 * len(scans.points_world)
    assert nearest.nearest_returns()[0] is nearest


def over_a_hedge():
    """A hedge 8 m ahead, and behind it the roof of a car from 12 to 13 m, at 21 bearings."""
    bearings = np.pi / 2.0 + np.radians(np.arange(-10.0, 11.0))
    ranges = np.repeat([[12.0, 8.0, 13.0, 8.3]], 21, axis=0)
    heights = np.repeat([[1.3, 0.5, 1.4, 1.0]], 21, axis=0)
    along = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    points = (ranges[..., None] * along[:, None]).reshape(-1, 2)
    scan = points, np.tile(0.02**2 * np.eye(2), (len(points), 1, 1))
    return Scans.of_each([0.0], [[0.0, 0.0, np.pi / 2.0]], [scan], heights=[heights.ravel()])


def test_of_each_object_in_a_bearing_the_nearest_return_is_taken():
    found, rows = over_a_hedge().nearest_returns()
    np.testing.assert_allclose(np.hypot(*found.points_world.T), 21 * [12.0, 8.0])
    np.testing.assert_array_equal(rows, np.arange(84).reshape(-1, 4)[:, :2].ravel())


def test_points_over_a_hedge_are_one_segment_and_the_hedge_is_another():
    found, _ = over_a_hedge().nearest_returns()
    rays = rays_of(found.points_world, found.covariances_world, np.zeros(3), heights=found.heights)
    hedge = np.hypot(*found.points_world.T) < 10.0
    labels = rays.labels
    assert len({*labels[hedge]}) == len({*labels[~hedge]}) == 1
    assert labels[hedge][0] != labels[~hedge][0]


LOW, HIGH = 0.4, 1.05
BOX = outline_table(np.array([[2.0, -0.9], [2.0, 0.9], [-2.0, 0.9], [-2.0, -0.9]]))
INSETS = np.zeros((3, 2, len(HEIGHTS)))
INSETS[0, :, HEIGHTS > 0.9] = 0.8, 0.2
INSETS[2, :, HEIGHTS > 0.9] = 0.1, 0.05
"""A rear window, 0.8 ± 0.2 m inside the rear, between sides that lean in; the front is upright."""


@pytest.mark.parametrize("heading", [0.0, 0.4, -2.5])
@pytest.mark.parametrize(
    ("sensor", "points", "inside"),
    [
        ([-12.0, 0.5], [[-2.0, 0.0], [-1.2, 0.3]], (0, 0.8, 0.2)),
        ([-12.0, 5.0], [[-2.0, 0.0], [-1.2, 0.3]], (0, 0.8, 0.2)),
        # It is already behind what the sensor sees of the outline: by 0.2 m.
        ([-12.0, 0.0], [[-2.0, 0.0], [-1.8, 0.0]], (0, 0.8, 0.2)),
        ([0.0, -12.0], [[0.5, -0.9], [-0.5, -0.8]], (1, 0.1, 0.05)),
        ([12.0, 0.0], [[2.0, 0.0], [2.0, 0.3]], (0, 0.0, 0.0)),
    ],
    ids=["behind", "oblique", "wrong place", "side", "front"],
)
def test_a_high_point_counts_as_a_low_one(heading, sensor, points, inside):
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    pose = np.array([3.0, 7.0, heading, 0.0, 0.0])
    points, sensor = (np.array(one) @ turn + pose[:2] for one in (points, sensor))
    noise, (axis, inset, std) = np.tile(0.01**2 * np.eye(2), (2, 1, 1)), inside
    rays = rays_of(points, noise, np.append(sensor, 0.0), heights=np.array([LOW, HIGH]))
    moved = at_heights(rays, pose, BOX, INSETS)
    ahead = moved.directions @ turn.T
    expected = rays.points_world - pose[:2]
    expected[1] -= inset / abs(ahead[1, axis]) * rays.directions[1]
    np.testing.assert_allclose(moved.points_world - pose[:2], expected, atol=1e-6)
    stds = [0.01, np.hypot(0.01, std / abs(ahead[1, axis]))]
    np.testing.assert_allclose(moved.stds, stds, atol=1e-9)
    # What the target's own faces are off moves them inwards: a range along one, an end by both.
    shared = np.zeros((2, FACES, 2))
    shared[1] = np.diag(np.sign(ahead[1]) * [0.2 * (ahead[1, 0] > 0.0), 0.05])
    np.testing.assert_allclose(turn @ moved.shared, shared, atol=1e-9)
    assert at_heights(rays, pose, BOX, None) is rays
    without = at_heights(rays_of(points, noise, np.append(sensor, 0.0)), pose, BOX, INSETS)
    assert without.stds[1] < 0.011


def test_dropout_and_clutter_keep_the_heights_of_the_points():
    _, _, scans = seen("all")
    disturbed = disturb_scans(scans, (1.0, 2.0), 5.0, None, 0)
    rows = disturbed.rows(0)
    own = np.diff(scans.offsets)[0]
    np.testing.assert_array_equal(disturbed.heights[rows][:own], scans.heights[:own])
    assert (disturbed.heights[rows][own:] == CLUTTER_HEIGHT).all()
    assert len(disturbed.heights) == len(disturbed.points_world)


def test_a_table_has_heights_if_the_road_is_stated(tmp_path):
    table = tmp_path / "scans.csv"
    table.write_text("k,t,x,y,z\n0,0.0,1,9,-1.5\n0,0.0,1,9.5,-0.7\n")
    assert read_scans(str(table), None, 0.1).heights is None
    scans = read_scans(str(table), None, 0.1, road_z=-1.7)
    np.testing.assert_allclose(scans.heights, [0.2, 1.0])
    table.write_text("k,t,x,y\n0,0.0,1,9\n")
    with pytest.raises(Exception, match="z"):
        read_scans(str(table), None, 0.1, road_z=-1.7)
