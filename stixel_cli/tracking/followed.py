"""Clusters that are followed over the scans, and the state of a road user from one of them.

Bar-Shalom, Li 1995, *Multitarget-Multisensor Tracking*: constant velocity, chi-square gates,
global nearest neighbour, begin by M of N.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, ego_from_world, rotate_covariances, rotation
from stixel_cli.measurements.clusters import GAP, cluster
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.kalman import mixture, update
from stixel_cli.tracking.motion import intervals, predict_place, transition
from stixel_cli.tracking.track import InitialState

RAYS_APART, WIDEST = 2.0, 3.0
"""Points of one object are this many distances of neighbouring rays apart, at most `WIDEST` m: a
sparse lidar's rays are far apart on a distant target, and farther where they graze it."""

GATE = 9.21
"""Squared distance of a cluster to a prediction: 99 % of a chi-square with two degrees."""

BEGIN, WINDOW = 3, 4
"""A track begins if so many of so many scans in a row have its cluster."""

END = 5
"""A track ends after so many scans in a row without its cluster."""

PAIR = 1e3
"""More than the costs of any assignment."""

PLACE = 0.3
"""Standard deviation of a cluster's centroid from scan to scan, m: another part is seen."""

ACCELERATION = 3.0
"""Process noise, m/s^1.5."""

LARGEST = 1.6
"""A cluster of a road user is at most this many times the class's diagonal long."""

HEADED = 0.5
"""The heading is the velocity's direction above this speed, m/s."""

SEEN = 0.8
"""A side is seen whole if the points extend over this share of it."""

SLACK = 0.2
"""Least standard deviation of a cluster's place in one scan, m."""

UNKNOWN_HEADING, UNKNOWN_SPEED = 1.5, 10.0
"""Standard deviations of what the scans do not show: rad and m/s."""


SLOWEST, OF_SENSOR = 0.3, 0.05
"""A road user is faster than this, m/s, plus this share of the sensor's speed: the error of the
sensor's motion moves all that stands still."""

LEAST_SCANS = 6
"""A road user that moves is in so many scans, or more."""


def least_speed(of_sensor: float) -> float:
    """The speed, m/s, of the slowest road user that moves, given that of the sensor."""
    return SLOWEST + OF_SENSOR * of_sensor


@dataclass
class OpenTrack:
    """A cluster over time, while it is followed."""

    rows: dict[int, np.ndarray]
    """Of each scan that has the cluster, ascending, the rows (n_k,) of the scans' arrays."""
    mean: np.ndarray
    covariance: np.ndarray
    """`mean`, `covariance`: (4,), (4, 4) of place and velocity, m and m/s, at the last scan."""
    missed: int = 0
    """Scans in a row without the cluster."""
    begun: bool = False
    """Whether it has passed M of N."""
    ended: bool = False
    """Whether it gets no more clusters."""
    number: int | None = None
    """Of the road user, where tracks are numbered."""

    def within(self, scans: Scans, first: int, duration: float) -> "OpenTrack":
        """The track in scan `first` and those of the next `duration` s."""
        until = scans.times[first] + duration + 1e-9
        inside = [k for k in self.rows if k >= first and scans.times[k] <= until]
        return replace(self, rows={k: self.rows[k] for k in inside})

    def velocity(self, scans: Scans) -> tuple[np.ndarray, float]:
        """The velocity (2,) m/s of the middles of its points, and its error, see `line`."""
        places = [scans.points_world[rows].mean(axis=0) for rows in self.rows.values()]
        return line(scans.times[[*self.rows]], np.array(places))[1:]


def clusters_of(scans: Scans, k: int, longest: float, apart: float = 0.0) -> list[np.ndarray]:
    """Rows (n,) of the scans' arrays of each cluster of scan k that is at most `longest` m long.

    `apart`, rad, is the angle between the rays of a sparse sensor.
    """
    rows, pose = scans.rows(k), scans.sensor_poses_world[k]
    points = ego_from_world(scans.points_world[rows], pose)
    covariances = rotate_covariances(scans.covariances_world[rows], STRAIGHT_AHEAD - pose[2])
    gap = RAYS_APART * apart * float(np.median(np.hypot(*points.T))) if len(points) else 0.0
    labels = cluster(points, covariances, max(GAP, min(gap, WIDEST)))
    found = [np.flatnonzero(labels == one) for one in range(labels.max(initial=-1) + 1)]
    return [own + rows.start for own in found if np.hypot(*np.ptp(points[own], axis=0)) <= longest]


def follow(scans: Scans, longest: float, apart: float = 0.0) -> list[OpenTrack]:
    """All tracks, begun or not, in the order of their first scans.

    Of clusters at most `longest` m long; `apart` as of `clusters_of`.
    """
    tracks: list[OpenTrack] = []
    for k, interval in enumerate(intervals(scans.times)):
        follow_scan(tracks, scans, k, interval, longest, apart)
    return tracks


def follow_scan(
    tracks: list[OpenTrack],
    scans: Scans,
    k: int,
    interval: float,
    longest: float,
    apart: float = 0.0,
) -> None:
    """Change `tracks` by scan k, an `interval` in s after the one before; add those that it begins.

    Clusters are at most `longest` m long; `apart` as of `clusters_of`.
    """
    clusters = clusters_of(scans, k, longest, apart)
    places = [scans.points_world[rows].mean(axis=0) for rows in clusters]
    noise = [
        PLACE**2 * np.eye(2) + scans.covariances_world[rows].mean(axis=0) / len(rows)
        for rows in clusters
    ]
    alive = [one for one in tracks if not one.ended]
    for one in alive:
        one.mean, one.covariance = predict_place(one.mean, one.covariance, interval, ACCELERATION)
    pairs = assign([(one.mean, one.covariance) for one in alive], places, noise)
    for i, one in enumerate(alive):
        j = pairs.get(i)
        if j is None:
            one.missed += 1
            too_late = not one.begun and k - min(one.rows) + 1 >= WINDOW
            one.ended = too_late or one.missed >= END
        else:
            innovation = places[j] - one.mean[:2]
            one.mean, one.covariance, _ = update(one.mean, one.covariance, innovation, noise[j])
            one.rows[k] = clusters[j]
            one.begun |= sum(scan > k - WINDOW for scan in one.rows) >= BEGIN
            one.missed = 0
    taken = set(pairs.values())
    for j, rows in enumerate(clusters):
        if j not in taken:
            covariance = np.diag([0.0, 0.0, UNKNOWN_SPEED**2, UNKNOWN_SPEED**2])
            covariance[:2, :2] = noise[j]
            mean = np.array([*places[j], 0.0, 0.0])
            tracks.append(OpenTrack({k: rows}, mean, covariance))


def assign(
    states: Sequence[tuple[np.ndarray, np.ndarray]],
    places: Sequence[np.ndarray],
    noise: Sequence[np.ndarray],
) -> dict[int, int]:
    """The place of each state, by index: the global nearest neighbours inside the gates.

    The most pairs, and of these the least sum of costs: the squared Mahalanobis distance and
    log |S|, as in the density, so that an uncertain state does not win.

    Args:
        states: means (4,) and covariances (4, 4), predicted.
        places: (2,) m, and noise (2, 2) m², of each cluster.
    """
    if not states or not places:
        return {}
    from scipy.optimize import linear_sum_assignment

    costs = np.zeros((len(states), len(places)))
    for row, (mean, covariance) in zip(costs, states, strict=True):
        spread = covariance[:2, :2] + np.array(noise)
        away = np.array(places) - mean[:2]
        squared = np.sum(away * np.linalg.solve(spread, away[..., None])[..., 0], axis=1)
        near = squared <= GATE
        row[near] = squared[near] + np.log(np.linalg.det(spread[near])) - PAIR
    found = zip(*linear_sum_assignment(costs), strict=True)
    return {int(i): int(j) for i, j in found if costs[i, j] < 0.0}


def state_of(
    scans: Scans, one: OpenTrack, sizes: np.ndarray, std: tuple[float, ...], motion: str
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
    means, covariances = (np.stack(part) for part in zip(*states, strict=True))
    return InitialState(*mixture(np.full(len(sizes), 1.0 / len(sizes)), means, covariances))


def _state_of(
    scans: Scans, one: OpenTrack, size: np.ndarray, std: tuple[float, ...], motion: str
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (6,) and covariance (6, 6) with one `size` (2,) m."""
    of_sensor, sensors, stds = motion == "sensor", scans.sensor_poses_world, np.array(std)
    ks = [*one.rows][: 1 if of_sensor else None]
    points = [scans.points_world[one.rows[k]] for k in ks]
    times, near = scans.times[ks], slice(max(ks[0] - 1, 0), ks[0] + 2)
    if of_sensor:
        heading, velocity = sensors[ks[0], 2], line(scans.times[near], sensors[near, :2])[1]
    else:
        velocity, _ = one.velocity(scans)
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
    return back @ [*centre, heading, *velocity, 0.0], back @ np.diag(stds**2) @ back.T


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
