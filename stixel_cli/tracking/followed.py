"""The state of a road user from a cluster of points that is followed over several scans."""

from dataclasses import dataclass

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.motion import intervals, transition
from stixel_cli.tracking.track import InitialState

HEADED = 0.5
"""The heading is the velocity's direction above this speed, m/s."""

SEEN = 0.8
"""A side is seen whole if the points extend over this share of it."""

SLACK = 0.2
"""Least standard deviation of a cluster's place in one scan, m."""

UNKNOWN_HEADING, UNKNOWN_SPEED = 1.5, 10.0
"""Standard deviations of what the scans do not show: rad and m/s."""


@dataclass(frozen=True)
class Followed:
    """A cluster over several scans: the scans' indices, and the points (n, 2) m of each."""

    scans: tuple[int, ...]
    points: tuple[np.ndarray, ...]


def state_of(
    scans: Scans, followed: Followed, sizes: np.ndarray, std: tuple[float, ...], motion: str
) -> InitialState:
    """State one sample before the first of `scans`: the class's rectangle on a cluster.

    With several `sizes` it has the mean and the covariance of an even mixture of their states.

    The line of centres over time gives place, direction and speed in the middle of the cluster's
    scans; the state is moved back in time at constant velocity.

    Args:
        scans: of the whole run.
        followed: the cluster.
        sizes: (n, 2) m, length and width of the class, or of each possible class.
        std: (6,) of the state; those of heading and rates are greater where the scans do not show
            them.
        motion: `scans`: heading and velocity are those of the cluster; `sensor`: the sensor's.
    """
    states = [_state_of(scans, followed, size, std, motion) for size in sizes]
    if len(states) == 1:
        return states[0]
    means = np.array([state.mean for state in states])
    mean = means.mean(axis=0)
    spread = (means - mean).T @ (means - mean) / len(means)
    return InitialState(mean, np.mean([state.covariance for state in states], axis=0) + spread)


def _state_of(
    scans: Scans, followed: Followed, size: np.ndarray, std: tuple[float, ...], motion: str
) -> InitialState:
    """The state with one `size` (2,) m."""
    if motion == "sensor":
        return _like_the_sensor(scans, followed, size, std)
    times = scans.times[list(followed.scans)]
    _, velocity, _ = line(times, np.array([points.mean(axis=0) for points in followed.points]))
    headed = float(np.hypot(*velocity)) >= HEADED
    heading = float(np.arctan2(velocity[1], velocity[0])) if headed else _longest(followed)
    centres = np.array(
        [
            _centre(points, scans.sensor_poses_world[k, :2], heading, size)
            for k, points in zip(followed.scans, followed.points, strict=True)
        ]
    )
    centre, velocity, error = line(times, centres)
    stds = np.array(std)
    if not headed:
        stds[2] = max(stds[2], UNKNOWN_HEADING)
    stds[3:5] = min(float(np.hypot(stds[3], error)), max(stds[3], UNKNOWN_SPEED))
    back = transition(scans.times[0] - intervals(scans.times)[0] - times.mean())
    mean = back @ np.array([*centre, heading, *velocity, 0.0])
    return InitialState(mean=mean, covariance=back @ np.diag(stds**2) @ back.T)


def _like_the_sensor(
    scans: Scans, followed: Followed, size: np.ndarray, std: tuple[float, ...]
) -> InitialState:
    """The class's rectangle on the first scan of the cluster, with the sensor's motion there."""
    k = followed.scans[0]
    poses, times = scans.sensor_poses_world, scans.times
    other = k + 1 if k + 1 < len(times) else k - 1
    rates = (poses[other] - poses[k]) / (times[other] - times[k]) if len(times) > 1 else np.zeros(3)
    heading = poses[k, 2]
    centre = _centre(followed.points[0], poses[k, :2], heading, size)
    back = transition(times[0] - intervals(times)[0] - times[k])
    mean = back @ np.array([*centre, heading, *rates[:2], 0.0])
    return InitialState(mean=mean, covariance=back @ np.diag(np.square(std)) @ back.T)


def line(times: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Place (2,) at the mean of `times` (n,), velocity (2,) of a straight line, and its error.

    The error is the standard error of the velocity along each axis, m/s; `inf` for one scan.
    """
    offsets = times - times.mean()
    spread = float(offsets @ offsets)
    centre = places.mean(axis=0)
    if spread == 0.0:
        return centre, np.zeros(2), np.inf
    velocity = offsets @ places / spread
    residuals = places - centre - offsets[:, None] * velocity
    variance = np.sum(residuals**2) / max(1, 2 * (len(times) - 2))
    return centre, velocity, float(np.sqrt(max(variance, SLACK**2 / 10.0) / spread))


def _longest(followed: Followed) -> float:
    """Direction of the longest axis of the points, rad."""
    points = np.concatenate([points - points.mean(axis=0) for points in followed.points])
    _, axes = np.linalg.eigh(points.T @ points)
    return float(np.arctan2(axes[1, 1], axes[0, 1]))


def _centre(
    points_world: np.ndarray, sensor_world: np.ndarray, heading: float, size: np.ndarray
) -> np.ndarray:
    """Centre (2,) m of a rectangle of `size` (2,) m whose sides to the sensor have the points.

    Along each axis of the rectangle: in the middle of the points if they extend over the side, or
    if the sensor is between them; else half a side behind the nearest points.
    """
    turn = rotation(heading)
    points, sensor = points_world @ turn, sensor_world @ turn
    low, high = np.quantile(points, [0.1, 0.9], axis=0)
    whole = high - low >= SEEN * size
    nearest_high, nearest_low = ~whole & (sensor > high), ~whole & (sensor < low)
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    centre = np.where(nearest_high, high - 0.5 * size, centre)
    return turn @ np.where(nearest_low, low + 0.5 * size, centre)
