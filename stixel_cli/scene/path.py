"""The scenario, and the paths of its target: poses and their exact derivatives at any times.

The heading is tangent to the path and continuous (not wrapped). Every path is a function of the
length driven, s; only stop-and-go drives at a speed that changes.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.scene.contours import road_user_contours
from stixel_cli.scene.parameters import Arc, Line, Path, RoadUser, SCurve, StopAndGo, Waypoints
from stixel_cli.scene.road_user import limb_poses
from stixel_cli.scene.scenario import EgoMotion, Scenario

if TYPE_CHECKING:  # see `waypoint_spline`
    from scipy.interpolate import CubicSpline

GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(12)


def build_scenario(ego_motion: EgoMotion, road_user: RoadUser, path: Path) -> Scenario:
    """Ground truth at the ego motion's times: poses, their rates, and the target's true contour.

    ValueError if the path's values contradict each other, or the mesh cannot be read.
    """
    poses, rates = path_poses(path, ego_motion.times)
    travelled, _ = driven(path, ego_motion.times)
    ego = ego_motion.times, ego_motion.poses_world
    target = poses, rates, road_user_contours(road_user), limb_poses(road_user, travelled)
    return Scenario(*ego, *target)


def path_poses(path: Path, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses (K, 3) x m, y m, heading rad of a target on `path`, and their derivatives (K, 3).

    The `times` (K,) s are 0 at the start. ValueError where `path.check()` does.
    """
    path.check()
    length, speed = driven(path, times)
    poses, curvature = _FUNCTIONS[type(path)](path, length)
    heading = poses[:, 2]
    rates = np.stack([speed * np.cos(heading), speed * np.sin(heading), speed * curvature], axis=1)
    return poses, rates


def driven(path: Path, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Length driven along the path (K,) m and speed (K,) m/s at `times` (K,) s.

    One round of stop-and-go is: drive, brake, wait, pull away. The speed is piecewise linear, the
    length its exact integral, piecewise quadratic.
    """
    times = np.asarray(times, dtype=np.float64)
    if not isinstance(path, StopAndGo):
        return path.speed * times, np.full_like(times, path.speed)
    phases = [path.drive_time, path.ramp_time, path.stand_time, path.ramp_time]
    knots = np.concatenate([[0.0], np.cumsum(phases)])
    speeds = path.speed * np.array([1.0, 1.0, 0.0, 0.0, 1.0])
    lengths = np.concatenate([[0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * phases)])
    rounds, within = np.divmod(times, knots[-1])
    phase = np.clip(np.searchsorted(knots, within, side="right") - 1, 0, 3)
    acceleration = path.speed / path.ramp_time * np.array([0.0, -1.0, 0.0, 1.0])[phase]
    since = within - knots[phase]
    # Braking to a halt ends at exactly zero, but for the last bit.
    speed = np.maximum(speeds[phase] + acceleration * since, 0.0)
    length = lengths[phase] + speeds[phase] * since + 0.5 * acceleration * since**2
    return rounds * lengths[-1] + length, speed


def _straight(path: Line | StopAndGo, length):
    heading = np.radians(path.heading)
    x = path.start[0] + length * np.cos(heading)
    y = path.start[1] + length * np.sin(heading)
    return np.stack([x, y, np.full_like(length, heading)], axis=1), np.zeros_like(length)


def _arc(path: Arc, length):
    radius = path.closing_radius if path.radius is None else path.radius
    curvature = (1.0 if path.side == "left" else -1.0) / radius
    first = np.radians(path.heading)
    heading = first + length * curvature
    x = path.start[0] + (np.sin(heading) - np.sin(first)) / curvature
    y = path.start[1] - (np.cos(heading) - np.cos(first)) / curvature
    return np.stack([x, y, heading], axis=1), np.full_like(length, curvature)


def _s_curve(path: SCurve, length):
    mean, swing = np.radians(path.heading), np.radians(path.swing)
    rate = 2.0 * np.pi / path.wavelength

    def direction(s):
        heading = mean + swing * np.sin(rate * s)
        return np.stack([np.cos(heading), np.sin(heading)], axis=-1)

    # Exact to rounding: panels of an eighth of a wavelength, and the rest of the last one.
    panel = path.wavelength / 8.0
    count = max(1, int(np.ceil(np.max(length, initial=0.0) / panel)))
    ends = panel * np.arange(count + 1)
    whole = np.cumsum(_integrals(direction, ends[:-1], ends[1:]), axis=0)
    last = np.clip((length / panel).astype(int), 0, count - 1)
    moved = np.concatenate([np.zeros((1, 2)), whole])[last]
    positions = np.array(path.start) + (moved + _integrals(direction, ends[last], length))
    poses = np.column_stack([positions, mean + swing * np.sin(rate * length)])
    return poses, swing * rate * np.cos(rate * length)


def _waypoints(path: Waypoints, length):
    spline = waypoint_spline(np.array(path.points, dtype=np.float64))
    parameter, past = _spline_parameter(spline, length)
    tangent, bend = spline(parameter, 1), spline(parameter, 2)
    pace = np.hypot(tangent[:, 0], tangent[:, 1])
    # Beyond the last point the path goes straight on along the last tangent.
    positions = spline(parameter) + past[:, None] * tangent / pace[:, None]
    curvature = (tangent[:, 0] * bend[:, 1] - tangent[:, 1] * bend[:, 0]) / pace**3
    curvature = np.where(past > 0.0, 0.0, curvature)
    # Continuous along the spline: in the turn of the heading that is unwrapped on a grid.
    grid = np.linspace(spline.x[0], spline.x[-1], 64 * (len(spline.x) - 1) + 1)
    reference = np.interp(parameter, grid, np.unwrap(np.arctan2(*spline(grid, 1).T[::-1])))
    heading = np.arctan2(tangent[:, 1], tangent[:, 0])
    heading += 2.0 * np.pi * np.rint((reference - heading) / (2.0 * np.pi))
    return np.column_stack([positions, heading]), curvature


def waypoint_spline(points: np.ndarray) -> "CubicSpline":
    """The natural cubic spline through `points` (n, 2) m, by chord length.

    No curvature at its ends, so a straight line joins on smoothly.
    """
    # Takes 0.4 s, which no other path needs.
    from scipy.interpolate import CubicSpline

    chords = np.hypot(*np.diff(points, axis=0).T)
    return CubicSpline(np.concatenate([[0.0], np.cumsum(chords)]), points, bc_type="natural")


def _spline_parameter(spline: "CubicSpline", length: np.ndarray):
    """The spline's parameter (K,) at each length (K,) driven along it, and the length past it."""
    panels = np.linspace(spline.x[:-1], spline.x[1:], 32, endpoint=False, axis=1)
    panels = np.append(panels, spline.x[-1])

    def pace(parameter):
        return np.linalg.norm(spline(parameter, 1), axis=-1)

    driven = np.concatenate([[0.0], np.cumsum(_integrals(pace, panels[:-1], panels[1:]))])
    past = np.maximum(length - driven[-1], 0.0)
    inside = np.clip(length, 0.0, driven[-1])
    panel = np.clip(np.searchsorted(driven, inside, side="right") - 1, 0, len(panels) - 2)
    low, high = panels[panel], panels[panel + 1]
    parameter = low + (inside - driven[panel]) / (driven[panel + 1] - driven[panel]) * (high - low)
    for _ in range(8):
        error = driven[panel] + _integrals(pace, low, parameter) - inside
        parameter = np.clip(parameter - error / pace(parameter), low, high)
    return parameter, past


def _integrals(function: Callable, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Gauss-Legendre integrals of `function` from `starts` to `ends` (n,), short panels."""
    half = 0.5 * (ends - starts)
    values = function(starts[:, None] + half[:, None] * (1.0 + GAUSS_NODES))
    if values.ndim == 2:
        return half * (values @ GAUSS_WEIGHTS)
    return half[:, None] * np.einsum("knd,n->kd", values, GAUSS_WEIGHTS)


_FUNCTIONS = dict.fromkeys((Line, StopAndGo), _straight)
_FUNCTIONS |= {Arc: _arc, SCurve: _s_curve, Waypoints: _waypoints}
"""Poses (K, 3) and curvatures (K,) 1/m on each path at lengths (K,) m driven along it."""
