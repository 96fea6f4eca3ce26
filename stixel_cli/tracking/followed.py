"""The state of a road user from a cluster of points that is followed over several scans."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.motion import intervals, transition
from stixel_cli.tracking.track import InitialState

if TYPE_CHECKING:
    from stixel_cli.tracking.several.clusters import OpenTrack

HEADED = 0.5
"""The heading is the velocity's direction above this speed, m/s."""

SEEN = 0.8
"""A side is seen whole if the points extend over this share of it."""

SLACK = 0.2
"""Least standard deviation of a cluster's place in one scan, m."""

UNKNOWN_HEADING, UNKNOWN_SPEED = 1.5, 10.0
"""Standard deviations of what the scans do not show: rad and m/s."""


def state_of(
    scans: Scans, one: "OpenTrack", sizes: np.ndarray, std: tuple[float, ...], motion: str
) -> InitialState:
    """State one sample before the first of `scans`: the class's rectangle on a cluster.

    With several `sizes` it has the mean and the covariance of an even mixture of their states.

    The line of centres over time gives place, direction and speed in the middle of the cluster's
    scans; the state is moved back in time at constant velocity.

    Args:
        scans: of the whole run.
        one: the cluster over time.
        sizes: (n, 2) m, length and width of the class, or of each possible class.
        std: (6,) of the state; those of heading and rates are greater where the scans do not show
            them.
        motion: `scans`: heading and velocity are those of the cluster; `sensor`: the sensor's, at
            the first scan of the cluster, which alone gives the place.
    """
    states = [_state_of(scans, one, size, std, motion) for size in sizes]
    if len(states) == 1:
        return states[0]
    means = np.array([state.mean for state in states])
    mean = means.mean(axis=0)
    spread = (means - mean).T @ (means - mean) / len(means)
    return InitialState(mean, np.mean([state.covariance for state in states], axis=0) + spread)


def _state_of(
    scans: Scans, one: "OpenTrack", size: np.ndarray, std: tuple[float, ...], motion: str
) -> InitialState:
    """The state with one `size` (2,) m."""
    of_sensor, sensors, stds = motion == "sensor", scans.sensor_poses_world, np.array(std)
    ks = one.scans[:1] if of_sensor else one.scans
    points = [scans.points_world[rows] for rows in one.rows[: len(ks)]]
    times, near = scans.times[ks], slice(max(ks[0] - 1, 0), ks[0] + 2)
    if of_sensor:
        heading, velocity = sensors[ks[0], 2], line(scans.times[near], sensors[near, :2])[1]
    else:
        _, velocity, _ = line(times, np.array([each.mean(axis=0) for each in points]))
        headed = float(np.hypot(*velocity)) >= HEADED
        heading = float(np.arctan2(velocity[1], velocity[0])) if headed else _longest(points)
        stds[2] = stds[2] if headed else max(stds[2], UNKNOWN_HEADING)
    centres = [
        _centre(each, sensors[k, :2], heading, size) for k, each in zip(ks, points, strict=True)
    ]
    centre, of_centres, error = line(times, np.array(centres))
    if not of_sensor:
        velocity = of_centres
        stds[3:5] = min(float(np.hypot(stds[3], error)), max(stds[3], UNKNOWN_SPEED))
    back = transition(scans.times[0] - intervals(scans.times)[0] - times.mean())
    mean = back @ np.array([*centre, heading, *velocity, 0.0])
    return InitialState(mean=mean, covariance=back @ np.diag(stds**2) @ back.T)


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


def _longest(points: Sequence[np.ndarray]) -> float:
    """Direction of the longest axis of the points (n, 2) m of each scan, rad."""
    offsets = np.concatenate([each - each.mean(axis=0) for each in points])
    _, axes = np.linalg.eigh(offsets.T @ offsets)
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
