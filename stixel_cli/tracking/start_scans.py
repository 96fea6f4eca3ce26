"""Initialisation of a tracker from the first scans alone: a cluster of points that is followed."""

from collections.abc import Iterator, Sequence
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.contour.class_size import SIZES, possible_sizes
from stixel_cli.tracking.followed import SLACK, Followed, line, state_of
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState

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
        duration: the cluster is followed for this time, s.
        position: standard deviation of x and of y, m; the others are standard deviations too.
        heading: rad.
        velocity: of the rates of x and of y, m/s.
        heading_rate: rad/s.
    """

    kind: Literal["scans"]
    bearing: tuple[Degrees, Degrees] | None
    range: tuple[Metres, Metres] | None
    motion: Literal["scans", "sensor"]
    duration: Annotated[float, Gt(0), Le(60)]
    position: Annotated[float, Gt(0), Le(100)]
    heading: Annotated[float, Gt(0), Le(3.2)]
    velocity: Annotated[float, Gt(0), Le(100)]
    heading_rate: Annotated[float, Gt(0), Le(10)]

    cluster_points: ClassVar[int] = 2
    """Least number of points of a cluster."""
    cluster_distance: ClassVar[float] = 0.8
    """DBSCAN's least radius, m: less than the gap between two road users."""

    @property
    def std(self) -> tuple[float, ...]:
        """Standard deviations (6,) of the state."""
        return (*[self.position] * 2, self.heading, *[self.velocity] * 2, self.heading_rate)

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


FASTEST, FASTEST_CHANGE = 16.0, 10.0
"""Speed of a target, and from the second link on change of its speed, m/s: a cluster is not linked
over a longer distance."""

RAYS_APART, WIDEST = 2.0, 3.0
"""DBSCAN's radius is this many distances of neighbouring rays, at most `WIDEST` m: a sparse lidar's
rays are far apart on a distant target, and farther where they graze it."""

SLOWEST = 0.3
"""A cluster moves if it is faster, m/s, and by `CERTAIN` standard errors of its speed."""

CERTAIN = 6.0

LEAST_SCANS = 3
"""Scans of a cluster from which a motion can be seen."""

LARGEST = 1.6
"""A cluster of the target is at most this many times the class's diagonal long."""


def start_from_scans(scans: Scans, start: ScansStart, prior: PriorShape) -> InitialState:
    """State one sample before the first scan: the class's rectangle on a cluster, and its motion.

    The cluster gives a line of centres over time, whose place, direction and speed are the state in
    the middle of its scans; it is moved back in time at constant velocity. The tracker then uses
    these scans a second time. If no cluster has the size of the prior's class, it may be a road
    user of another class: the start is then that of an unknown class.

    Raises:
        ValueError: if no cluster fits.
    """
    sizes = possible_sizes(prior)
    try:
        followed = _followed(scans, start, sizes)
    except ValueError:
        sizes = SIZES
        followed = _followed(scans, start, sizes)
    return state_of(scans, followed, sizes, start.std, start.motion)


def _followed(scans: Scans, start: ScansStart, sizes: np.ndarray) -> Followed:
    """The target's cluster over time, of one of the `sizes` (n, 2) m."""
    apart = _angle_of_rays(scans)
    clusters = [_clusters(scans, k, apart, start, sizes) for k in range(len(scans))]
    if start.bearing is None and start.range is None:
        return _moving(scans, clusters, start)
    return _chosen(scans, clusters, start)


def _angle_of_rays(scans: Scans) -> float:
    """Median angle between neighbouring points of a scan, seen from the sensor, rad; 0 if none."""
    steps = []
    for k in range(len(scans)):
        away = scans.points_world[scans.rows(k)] - scans.sensor_poses_world[k, :2]
        bearings = np.arctan2(away[:, 1], away[:, 0]) - scans.sensor_poses_world[k, 2]
        steps.append(np.diff(np.sort(wrap_angle(bearings))))
    together = np.concatenate(steps)
    return float(np.median(together)) if len(together) else 0.0


def _clusters(
    scans: Scans, k: int, apart: float, start: ScansStart, sizes: np.ndarray
) -> list[np.ndarray]:
    """The clusters (n, 2) m of scan `k`, without those too large for the `sizes`.

    `apart` is the angle between neighbouring rays, rad.
    """
    points = scans.points_world[scans.rows(k)]
    if len(points) == 0:
        return []
    away = np.median(np.hypot(*(points - scans.sensor_poses_world[k, :2]).T))
    radius = max(start.cluster_distance, min(RAYS_APART * apart * float(away), WIDEST))
    # It takes a second to import, and every command imports this module.
    from sklearn.cluster import DBSCAN

    labels = DBSCAN(eps=radius, min_samples=start.cluster_points).fit_predict(points)
    found = [points[labels == label] for label in range(labels.max() + 1)]
    longest = LARGEST * float(np.hypot(*sizes.T).max()) + 2.0 * SLACK
    return [one for one in found if np.hypot(*np.ptp(one, axis=0)) <= longest]


def _chosen(scans: Scans, clusters: Sequence[list[np.ndarray]], start: ScansStart) -> Followed:
    """The cluster nearest to the middle of the bounds, from the first scan that has one inside."""
    for k in range(len(scans)):
        best = None
        for points in clusters[k]:
            distance = _from_middle(points.mean(axis=0), scans.sensor_poses_world[k], start)
            if distance is not None and (best is None or distance < best[0]):
                best = (distance, points)
        if best is not None:
            return _follow(scans, clusters, k, best[1], start)
    bounds = [
        f"{name} {list(value)} {unit}"
        for name, value, unit in (
            ("bearing", start.bearing, "degrees"),
            ("range", start.range, "m"),
        )
        if value is not None
    ]
    raise ValueError(
        f"no scan has a cluster of the class's size in {' and '.join(bounds)}: widen them"
    )


def _from_middle(
    place_world: np.ndarray, sensor_pose_world: np.ndarray, start: ScansStart
) -> float | None:
    """Distance from the middle of the bounds; None outside. Only the order of the values counts."""
    offset = place_world - sensor_pose_world[:2]
    distance = float(np.hypot(*offset))
    bearing = np.degrees(wrap_angle(np.arctan2(offset[1], offset[0]) - sensor_pose_world[2]))
    for value, bounds in ((bearing, start.bearing), (distance, start.range)):
        if bounds is not None and not bounds[0] <= value <= bounds[1]:
            return None
    middle_bearing = bearing if start.bearing is None else 0.5 * sum(start.bearing)
    middle_range = distance if start.range is None else 0.5 * sum(start.range)
    return float(
        np.abs(
            distance * np.exp(1j * np.radians(bearing))
            - middle_range * np.exp(1j * np.radians(middle_bearing))
        )
    )


def _moving(scans: Scans, clusters: Sequence[list[np.ndarray]], start: ScansStart) -> Followed:
    """The cluster that moves with the least doubt, from the first scan that has a moving one.

    A cluster that is alone in its scans may move with any doubt: nothing else can be the target.
    """
    alone = all(len(found) <= 1 for found in clusters)
    for k in range(len(scans)):
        best = None
        for followed in (_follow(scans, clusters, k, points, start) for points in clusters[k]):
            if len(followed.scans) < LEAST_SCANS:
                continue
            places = np.array([points.mean(axis=0) for points in followed.points])
            _, velocity, error = line(scans.times[list(followed.scans)], places)
            speed = float(np.hypot(*velocity))
            moves = speed >= (SLOWEST if alone else max(SLOWEST, CERTAIN * error))
            if moves and (best is None or speed / error > best[0]):
                best = (speed / error, followed)
        if best is not None:
            return best[1]
    raise ValueError(
        "no cluster of the class's size moves: give start.bearing=[LO,HI] (degrees) and "
        "start.range=[LO,HI] (m)"
    )


def _follow(
    scans: Scans,
    clusters: Sequence[list[np.ndarray]],
    first: int,
    points: np.ndarray,
    start: ScansStart,
) -> Followed:
    """The cluster `points` of scan `first` in the scans of the next `duration` s."""
    chain = [(first, points)]
    for k in _until(scans.times, first, start.duration):
        last, before = chain[-1][0], chain[-1][1].mean(axis=0)
        elapsed = scans.times[k] - scans.times[last]
        expected, reach = before, FASTEST * elapsed
        if len(chain) > 1:
            # Of the last links, so that noise of a single one does not decide.
            other = chain[-min(len(chain), 4)]
            rate = (before - other[1].mean(axis=0)) / (scans.times[last] - scans.times[other[0]])
            expected, reach = before + elapsed * rate, FASTEST_CHANGE * elapsed
        near = [
            (float(np.hypot(*(one.mean(axis=0) - expected))), i)
            for i, one in enumerate(clusters[k])
        ]
        if near and min(near)[0] <= reach:
            chain.append((k, clusters[k][min(near)[1]]))
    return Followed(tuple(k for k, _ in chain), tuple(points for _, points in chain))


def _until(times: np.ndarray, first: int, duration: float) -> Iterator[int]:
    k = first + 1
    while k < len(times) and times[k] <= times[first] + duration + 1e-9:
        yield k
        k += 1
