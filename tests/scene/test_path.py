from dataclasses import replace

import numpy as np
import pytest
import scene_presets
from constants import with_constants
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

from stixel_cli.geometry.pose import rectangle, world_from_target
from stixel_cli.scene.ego import Parked, ego_motion
from stixel_cli.scene.parameters import Waypoints
from stixel_cli.scene.path import driven, path_poses, waypoint_spline
from stixel_cli.scene.shapes import monotone

S_CURVE = scene_presets.path("s_curve", "car")
EVERY = [(kind, path) for kind in scene_presets.ROAD_USERS for path in scene_presets.PATHS]
WAYPOINTS = st.lists(st.tuples(st.floats(-30, 30), st.floats(1, 60)), min_size=2, max_size=7)


def preset_run(kind, name):
    path = scene_presets.path(name, kind)
    times = ego_motion(Parked("parked"), path.duration, path.sample_time).times
    return path, times, *path_poses(path, times)


@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_headings_are_tangential_and_rates_are_the_derivatives_of_the_poses(kind, name):
    path, times, poses, rates = preset_run(kind, name)
    assert np.isfinite(poses).all() and np.isfinite(rates).all()
    speed = np.hypot(rates[:, 0], rates[:, 1])
    assert (speed <= path.speed * (1 + 1e-9)).all()
    if name != "stop_and_go":
        np.testing.assert_allclose(speed, path.speed, rtol=1e-6)
    np.testing.assert_allclose(speed * np.cos(poses[:, 2]), rates[:, 0], atol=1e-12)
    np.testing.assert_allclose(speed * np.sin(poses[:, 2]), rates[:, 1], atol=1e-12)
    assert np.abs(np.diff(poses[:, 2])).max() < 0.5
    step = 1e-5
    times, rates = times[1:], rates[1:]
    numeric = (path_poses(path, times + step)[0] - path_poses(path, times - step)[0]) / (2 * step)
    # At a kink of the speed the central difference is off by half the acceleration's step.
    tolerance = 1e-4 if name == "stop_and_go" else 2e-7 * path.speed
    np.testing.assert_allclose(rates, numeric, atol=tolerance)


@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_preset_paths_stay_in_view_at_realistic_speeds_and_accelerations(kind, name):
    rig = scene_presets.rig("default")
    path, _, poses, rates = preset_run(kind, name)
    x, y = poses[:, 0], poses[:, 1]
    assert (y > 0.0).all()
    assert np.hypot(x, y).min() > 6.0 and np.hypot(x, y).max() < 36.0
    in_view = np.abs(x) < 0.95 * np.tan(rig.field_of_view[1]) * y
    assert in_view.mean() >= 0.9
    road_user = scene_presets.road_user(kind)
    corners = rectangle(road_user.length, road_user.width)
    assert all(np.hypot(*world_from_target(corners, pose).T).min() > 3.0 for pose in poses)
    # Speeds of a town, and sideways acceleration below what is felt as violent.
    fastest = {"cyclist": 8.0, "pedestrian": 2.0}.get(kind, 14.0)
    assert 0.5 < path.speed < fastest
    sideways = np.abs(rates[:, 2]) * np.hypot(rates[:, 0], rates[:, 1])
    assert sideways.max() < 4.0


def test_default_run_shows_the_whole_car_from_several_sides():
    rig = scene_presets.rig("default")
    path, times, poses, _ = preset_run("car", "turn")
    assert len(times) == 100 and path.sample_time == 0.1
    for pose in poses:
        points = world_from_target(rectangle(4.5, 1.8), pose)
        assert (np.abs(points[:, 0]) < np.tan(rig.field_of_view[1]) * points[:, 1]).all()
    ranges = np.hypot(poses[:, 0], poses[:, 1])
    assert 20.0 < ranges[0] < 25.0 and 9.0 < ranges.min() < 12.0 and ranges.max() < 25.0
    assert np.ptp(poses[:, 2]) > np.radians(120.0)


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
def test_preset_circle_closes_within_its_duration(kind):
    path = scene_presets.path("circle", kind)
    for one in (path, replace(path, speed=2.0 * path.speed)):
        poses, _ = path_poses(one, np.array([0.0, path.duration]))
        np.testing.assert_allclose(poses[1] - poses[0], [0.0, 0.0, 2.0 * np.pi], atol=1e-9)


def test_circle_follows_given_side_and_radius():
    given = {"start": (0.0, 20.0), "heading": 0.0, "side": "right", "radius": 5.0, "speed": 2.0}
    path = replace(scene_presets.path("circle", "car"), **given)
    poses, rates = path_poses(path, np.linspace(0.0, 10.0, 33))
    np.testing.assert_allclose(np.hypot(poses[:, 0], poses[:, 1] - 15.0), 5.0)
    np.testing.assert_allclose(rates[:, 2], -0.4)


RANGES = [(-180, 180), (-90, 90), (2, 100), (0.5, 30), (0.01, 9)]


@settings(max_examples=15)
@given(*(st.floats(*ends) for ends in RANGES))
def test_s_curve_positions_integrate_its_heading(heading, swing, wavelength, speed, time):
    given = {"heading": heading, "swing": swing, "wavelength": wavelength, "speed": speed}
    path = replace(S_CURVE, start=(1.0, 50.0), **given)
    pose = path_poses(path, np.array([time]))[0][0]

    def heading_at(t):
        return np.radians(heading + swing * np.sin(2 * np.pi * speed * t / wavelength))

    for at, start, along in zip(pose, (1.0, 50.0), (np.cos, np.sin), strict=False):
        way = quad(lambda t, along=along: speed * along(heading_at(t)), 0.0, time, limit=500)[0]
        assert at == pytest.approx(start + way, abs=1e-6)
    assert pose[2] == pytest.approx(heading_at(time), abs=1e-9)


def stop_and_go(**times):
    given = {"start": (0.0, 30.0), "heading": -90.0, "speed": 4.0, "duration": 20.0}
    path = replace(scene_presets.path("stop_and_go", "car"), **given)
    return with_constants(path, **times) if times else path


def test_stop_and_go_stops_keeps_its_heading_and_accepts_times_of_zero():
    path = stop_and_go()
    times = np.linspace(0.0, 20.0, 2001)
    length, speed = driven(path, times)
    standing = (times % 6.0 > 2.5) & (times % 6.0 < 4.5)
    assert (speed[standing] == 0.0).all() and (speed[~standing] >= 0.0).all()
    assert speed.max() == 4.0
    # A round drives 1 s at full speed and brakes and pulls away at half of it on the mean.
    np.testing.assert_allclose(driven(path, np.array([6.0, 12.0]))[0], [10.0, 20.0])
    np.testing.assert_allclose(np.gradient(length, times)[1:-1], speed[1:-1], atol=0.02)
    poses, rates = path_poses(path, times)
    assert (poses[:, 2] == np.radians(-90.0)).all()
    assert (rates[standing] == 0.0).all()
    path = stop_and_go(drive_time=0.0, ramp_time=1.0, stand_time=0.0)
    length, speed = driven(path, np.array([0.0, 0.5, 1.0, 1.5, 2.0]))
    np.testing.assert_allclose(speed, [4, 2, 0, 2, 4], atol=1e-12)
    np.testing.assert_allclose(length, [0, 1.5, 2, 2.5, 4], atol=1e-12)


def waypoints(points, **changes):
    path = Waypoints(kind="waypoints", points=points, speed=3.0, duration=20.0, sample_time=0.1)
    return replace(path, **changes)


def test_spline_passes_through_the_waypoints_and_continues_straight():
    points = ((-5.0, 25.0), (-2.0, 18.0), (3.0, 14.0), (6.0, 20.0))
    poses, _ = path_poses(waypoints(points, speed=1.0), np.linspace(0.0, 30.0, 30001))
    for point in points:
        assert np.hypot(*(poses[:, :2] - point).T).min() < 1e-3
    np.testing.assert_allclose(poses[0, :2], points[0])
    points = ((-5.0, 25.0), (-2.0, 18.0), (3.0, 14.0))
    path = waypoints(points)
    poses, rates = path_poses(path, np.linspace(0.0, 20.0, 2001))
    last = np.argmin(np.hypot(*(poses[:, :2] - points[-1]).T)) + 2
    assert last < 1000
    np.testing.assert_allclose(poses[last:, 2], poses[last, 2], atol=1e-12)
    assert (rates[last:, 2] == 0.0).all()
    np.testing.assert_allclose(np.hypot(rates[:, 0], rates[:, 1]), 3.0)
    steps = np.hypot(*np.diff(poses[last:, :2], axis=0).T)
    np.testing.assert_allclose(steps, 0.03, rtol=1e-9)


@settings(max_examples=15)
@given(WAYPOINTS, st.floats(0.0, 20.0))
def test_waypoint_path_has_constant_speed(points, time):
    path = waypoints(tuple(points))
    try:
        path.check()
    except ValueError:
        return
    spline = waypoint_spline(np.array(points))
    poses, rates = path_poses(path, np.array([0.0, time, time + 1e-6]))
    assert np.isfinite(poses).all() and np.isfinite(rates).all()
    np.testing.assert_allclose(np.hypot(rates[:, 0], rates[:, 1]), 3.0)
    length = quad(lambda u: np.hypot(*spline(u, 1)), 0.0, spline.x[-1], limit=500)[0]
    end = path_poses(path, np.array([length / 3.0]))[0][0]
    np.testing.assert_allclose(end[:2], points[-1], atol=1e-3)


@pytest.mark.parametrize("kind", scene_presets.ROAD_USERS)
@pytest.mark.parametrize("name", scene_presets.PATHS)
def test_path_rejects_a_start_behind_the_camera(kind, name):
    path = scene_presets.path(name, kind)
    if name == "waypoints":
        behind, key = replace(path, points=((0.0, -5.0), (0.0, 10.0))), r"path\.points"
    else:
        behind, key = replace(path, start=(1.0, -4.0)), r"path\.start"
    with pytest.raises(ValueError, match=key + ": the path starts behind the camera"):
        behind.check()
    with pytest.raises(ValueError, match="behind the camera"):
        path_poses(behind, np.zeros(1))


POINTS = {
    "rising": ([0.0, 1.0, 1.5, 4.0], [0.0, 0.1, 2.0, 2.1]),
    "with extremes": ([-2.0, -1.0, 0.0, 0.5, 3.0, 3.1], [1.0, 3.0, 3.0, -1.0, 0.0, 0.0]),
    "ends that are bent back": ([0.0, 1.0, 1.1, 5.0, 5.1, 9.0], [0.0, 1.0, 9.0, 8.0, 1.0, 0.9]),
    "three": ([0.0, 1.0, 3.0], [2.0, 1.0, 1.0]),
}


@pytest.mark.parametrize("name", POINTS)
def test_values_are_those_of_scipy_to_the_bit(name):
    x, y = POINTS[name]
    at = np.concatenate([np.linspace(x[0] - 0.3, x[-1] + 0.3, 997), x]).reshape(-1, 1)
    assert np.array_equal(monotone((x, y), at), PchipInterpolator(x, y)(at))
