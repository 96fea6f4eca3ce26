"""Clusters that are followed over the scans, and the state of a road user from one of them.

Bar-Shalom, Li 1995, *Multitarget-Multisensor Tracking*: constant velocity, chi-square gates,
global nearest neighbour. What another value of a constant does, here and in `several`, was seen on
ten clips of tuning data and on starts from real lidar scans.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.clusters import LARGEST, clusters_of
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.scene.parameters import CLASS_ROWS
from stixel_cli.tracking import motion
from stixel_cli.tracking.association import gate
from stixel_cli.tracking.kalman import CENTROID_STD, PLACE, correct, mixture
from stixel_cli.tracking.track import InitialState

BEGIN = 3
"""A road user moves if so many scans in a row show it: with 2 there are three false tracks, with 4
a car is not found."""

ACCELERATION = 3.0
"""Process noise, m/s^1.5, as of `tracker=point`. With 1 there are two false tracks."""

OF_SENSOR = 0.05
"""A road user is faster than `LEAST_SPEED` plus this share of the sensor's speed: the error of the
sensor's motion, of which stereo odometry has a few percent, moves all that stands still."""

CERTAIN = 12.0
"""A road user's speed is so many times its standard error. With 6 there are five false tracks."""

LEAST_SCANS = 2 * BEGIN
"""A road user that moves is in so many scans, or more: from the first half it has a speed. A start
is from so many, and a track ends after so many without its cluster: with 3 starts are worse."""

STDS = np.array([0.4, 0.4, 0.2, 1.0, 1.0, 0.4])
"""Standard deviations of a start: x, y, heading and their rates; m, rad, s. Of the velocity where
the scans show it."""

UNKNOWN_SPEED = max(row.speed for row in CLASS_ROWS.values())
"""Standard deviation of a velocity that the scans do not show, m/s: of any class."""

Degrees = Annotated[float, Ge(-180), Le(180)]
Metres = Annotated[float, Ge(0), Le(1000)]


@parameters
class ScansStart:
    """A start from the scans and the class prior; it sees no truth.

    With `bearing` or `range` the target is the cluster inside them that is nearest to their middle,
    in the first scan that has one. With neither it is the cluster that moves, or the only one.

    Attributes:
        bearing: [lowest, highest] direction from the sensor, degrees, 0 ahead, positive to the
            left; null: any.
        range: [lowest, highest] distance from the sensor, m; null: any.
        motion: `scans`: heading and velocity are those of the cluster over time; `sensor`: those of
            the sensor, as of a car that drives ahead of it.
    """

    kind: Literal["scans"]
    bearing: tuple[Degrees, Degrees] | None
    range: tuple[Metres, Metres] | None
    motion: Literal["scans", "sensor"]

    def check(self) -> None:
        """Raise ValueError for bounds that are not in order."""
        if self.motion == "sensor" and self.bearing is None and self.range is None:
            raise ValueError("start.bearing: start.motion=sensor needs a bearing or a range")
        for name in ("bearing", "range"):
            bounds = getattr(self, name)
            if bounds is not None and bounds[1] <= bounds[0]:
                raise ValueError(
                    f"start.{name}: the second must be greater than the first, got {list(bounds)}"
                )


@dataclass
class ClusterTrack:
    """A cluster of points over time."""

    rows: dict[int, np.ndarray]
    """Of each scan that has the cluster, ascending, the rows (n_k,) of the scans' arrays."""
    mean: np.ndarray
    covariance: np.ndarray
    """`mean`, `covariance`: (4,), (4, 4) of place and velocity, m and m/s, at the last scan."""
    number: int | None = None
    """Of the road user, where tracks are numbered."""
    confirmed: int | None = None
    """The scan up to which it was followed until it was clear that it moves."""
    initial: InitialState | None = None
    """The state one sample before the first of its scans, where it is tracked."""

    def is_alive(self, k: int) -> bool:
        """Whether it may have a cluster in scan `k`, later than those that it has."""
        return k - max(self.rows) <= (LEAST_SCANS if len(self.rows) >= BEGIN else 1)

    def at(self, ks: Sequence[int]) -> "ClusterTrack":
        """The track in the scans `ks`."""
        return replace(self, rows={k: self.rows[k] for k in ks})

    def since(self, first: int) -> "ClusterTrack":
        """The track in `LEAST_SCANS` of its scans, from `first` on."""
        return self.at([k for k in self.rows if k >= first][:LEAST_SCANS])

    def join(self, other: "ClusterTrack") -> None:
        """Add the clusters of another part of the same road user."""
        for k, more in other.rows.items():
            own = self.rows.get(k, np.zeros(0, np.int64))
            self.rows[k] = np.sort(np.concatenate([own, more]))
        self.rows = dict(sorted(self.rows.items()))
        self.confirmed = min(self.confirmed, other.confirmed)

    def velocity(self, scans: Scans) -> tuple[np.ndarray, float]:
        """The velocity (2,) m/s of the middles of its points, and its error, see `line`."""
        places = [scans.points_world[rows].mean(axis=0) for rows in self.rows.values()]
        return line(scans.times[[*self.rows]], np.array(places))[1:]

    def is_fast(self, scans: Scans) -> bool:
        """Whether it is faster than a static object with errors."""
        ks, (velocity, error) = [*self.rows], self.velocity(scans)
        of_sensor = line(scans.times[ks], scans.sensor_poses_world[ks, :2])[1]
        least = max(least_speed(float(np.hypot(*of_sensor))), CERTAIN * error)
        return float(np.hypot(*velocity)) >= least


def least_speed(of_sensor: float) -> float:
    """The speed, m/s, of the slowest road user that moves, given that of the sensor."""
    return motion.LEAST_SPEED + OF_SENSOR * of_sensor


def follow(scans: Scans, sizes: np.ndarray) -> list[ClusterTrack]:
    """All tracks, begun or not, in the order of their first scans; `sizes` as of `follow_scan`."""
    tracks: list[ClusterTrack] = []
    for k in range(len(scans)):
        follow_scan(tracks, scans, k, sizes)
    return tracks


def follow_scan(tracks: list[ClusterTrack], scans: Scans, k: int, sizes: np.ndarray) -> None:
    """Change `tracks` by scan k; add those that it begins.

    `sizes` (n, 2) m are those of the class, or of each possible class.
    """
    clusters = clusters_of(scans, k, LARGEST * float(np.hypot(*sizes.T).max()))
    places = [scans.points_world[rows].mean(axis=0) for rows in clusters]
    noise = [
        CENTROID_STD**2 * np.eye(2) + scans.covariances_world[rows].mean(axis=0) / len(rows)
        for rows in clusters
    ]
    alive, interval = [one for one in tracks if one.is_alive(k)], motion.intervals(scans.times)[k]
    for one in alive:
        before = one.mean, one.covariance
        one.mean, one.covariance = motion.predict_place(*before, interval, ACCELERATION)
    pairs = assign([(one.mean, one.covariance) for one in alive], places, noise)
    for i, j in pairs.items():
        one, innovation = alive[i], places[j] - alive[i].mean[:2]
        correction, one.covariance, _ = correct(one.covariance, PLACE, noise[j], innovation)
        one.mean = one.mean + correction
        one.rows[k] = clusters[j]
    for j in {*range(len(clusters))} - {*pairs.values()}:
        covariance = np.diag([0.0, 0.0, UNKNOWN_SPEED**2, UNKNOWN_SPEED**2])
        covariance[:2, :2] = noise[j]
        tracks.append(ClusterTrack({k: clusters[j]}, np.array([*places[j], 0.0, 0.0]), covariance))


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

    means, covariances = (np.array(part) for part in zip(*states, strict=True))
    spread = covariances[:, None, :2, :2] + np.array(noise)
    away = np.array(places) - means[:, None, :2]
    squared = np.sum(away * np.linalg.solve(spread, away[..., None])[..., 0], axis=2)
    # A pair is worth more than all that pairs cost.
    costs = np.where(squared <= gate(), squared + np.log(np.linalg.det(spread)) - 1e3, 0.0)
    found = zip(*linear_sum_assignment(costs), strict=True)
    return {int(i): int(j) for i, j in found if costs[i, j] < 0.0}


def line(times: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Place (2,) at the mean of `times` (n,), velocity (2,) of a straight line, and its error.

    The error is the standard error of the velocity along each axis, m/s; `inf` of one or two scans.
    """
    offsets, centre, free = times - times.mean(), places.mean(axis=0), 2 * (len(times) - 2)
    velocity = offsets @ places / max(float(offsets @ offsets), 1e-12)
    if free <= 0:
        return centre, velocity, np.inf
    residuals = places - centre - offsets[:, None] * velocity
    return centre, velocity, float(np.sqrt(np.sum(residuals**2) / free / (offsets @ offsets)))


def state_of(
    scans: Scans, one: ClusterTrack, sizes: np.ndarray, start: ScansStart, first: int = 0
) -> InitialState:
    """State one sample before the scan `first`: the class's rectangle on a cluster.

    The line of centres over time gives place, direction and speed in the middle of the first scans
    of the track `one`, or of the first alone with `start.motion=sensor`; the state is moved back in
    time at constant velocity. With several `sizes` (n, 2) m, of each possible class, it has the
    mean and the covariance of an even mixture of their states. The standard deviations of heading
    and rates are greater than the `STDS` where the scans do not show them.
    """
    of_sensor, sensors = start.motion == "sensor", scans.sensor_poses_world
    ks, stds = [*one.rows][: 1 if of_sensor else LEAST_SCANS], STDS.copy()
    points = [scans.points_world[one.rows[k]] for k in ks]
    times, near = scans.times[ks], slice(max(ks[0] - 1, 0), ks[0] + 2)
    if of_sensor:
        heading, velocity = sensors[ks[0], 2], line(scans.times[near], sensors[near, :2])[1]
    else:
        velocity, _ = one.at(ks).velocity(scans)
        headed = float(np.hypot(*velocity)) >= motion.LEAST_SPEED
        heading = float(np.arctan2(velocity[1], velocity[0])) if headed else _longest(points)
        stds[2] = stds[2] if headed else np.sqrt(motion.GREATEST_VARIANCE)
    means, variances = np.zeros((len(sizes), 6)), np.tile(stds**2, (len(sizes), 1))
    for mean, variance, size in zip(means, variances, sizes, strict=True):
        seen = zip(points, sensors[ks, :2], strict=True)
        centres = np.array([_centre(each, sensor, heading, size) for each, sensor in seen])
        mean[:2], of_centres, error = line(times, centres)
        mean[2:5] = heading, *(velocity if of_sensor else of_centres)
        variance[3:5] = min(float(np.hypot(stds[3], error)), UNKNOWN_SPEED) ** 2
    covariances = variances[:, None] * np.eye(6)
    mean, covariance = mixture(np.full(len(sizes), 1.0 / len(sizes)), means, covariances)
    age = scans.times[first] - motion.intervals(scans.times)[first] - times.mean()
    back = motion.transition(age)
    return InitialState(back @ mean, back @ covariance @ back.T)


def _longest(points: Sequence[np.ndarray]) -> float:
    """Direction of the longest axis of the points (n, 2) m of each scan, rad."""
    offsets = np.concatenate([each - each.mean(axis=0) for each in points])
    _, axes = np.linalg.eigh(offsets.T @ offsets)
    return float(np.arctan2(axes[1, 1], axes[0, 1]))


def _centre(
    points_world: np.ndarray, sensor_world: np.ndarray, heading: float, size: np.ndarray
) -> np.ndarray:
    """Centre (2,) m of a rectangle of `size` (2,) m whose sides to the sensor have the points.

    Along each axis of the rectangle: half a side behind the nearest points, or in their middle if
    the sensor is between them.
    """
    turn = rotation(heading)
    points, sensor = points_world @ turn, sensor_world @ turn
    low, high = np.quantile(points, [0.1, 0.9], axis=0)
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    centre = np.where(sensor > high, high - 0.5 * size, centre)
    return turn @ np.where(sensor < low, low + 0.5 * size, centre)
