"""Initialisation of trackers from scans alone: of one that is chosen, or of all that moves."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.geometry.pose import rotation, wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.contour.class_size import SIZES, possible_sizes
from stixel_cli.tracking.followed import UNKNOWN_SPEED, OpenTrack, follow, line
from stixel_cli.tracking.kalman import mixture
from stixel_cli.tracking.motion import GREATEST_VARIANCE, LEAST_SPEED, intervals, transition
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.several.clusters import is_fast, moving
from stixel_cli.tracking.track import FoundTrack, InitialState

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


SEEN = 0.8
"""A side is seen whole if the points extend over this share of it."""


def start_from_scans(scans: Scans, start: ScansStart, prior: PriorShape) -> InitialState:
    """State one sample before the first scan: the class's rectangle on a cluster, and its motion.

    The tracker then uses these scans a second time. If no cluster has the size of the prior's
    class, it may be a road user of another class: the start is then that of an unknown class.

    Raises:
        ValueError: if no cluster fits.
    """
    units = (("bearing", start.bearing, "degrees"), ("range", start.range, "m"))
    bounds = " and ".join(f"{name} {list(one)} {unit}" for name, one, unit in units if one)
    for sizes in (possible_sizes(prior), SIZES):
        target = _target(scans, start, follow(scans, sizes))
        if target:
            return state_of(scans, target, sizes, start.std, motion=start.motion)
    if bounds:
        raise ValueError(f"no scan has a cluster of the class's size in {bounds}: widen them")
    raise ValueError(
        "no cluster of the class's size moves: give start.bearing=[LO,HI] (degrees) and "
        "start.range=[LO,HI] (m)"
    )


def _target(scans: Scans, start: ScansStart, tracks: Sequence[OpenTrack]) -> OpenTrack | None:
    """The target's track for `start.duration` from the first scan that has one.

    Of several the one with the least value.
    """
    chosen = start.bearing is not None or start.range is not None
    # A cluster that is alone in its scans may move with any doubt: nothing else can be the target.
    alone = sum(len(one.rows) for one in tracks) == len({k for one in tracks for k in one.rows})
    for k in range(len(scans)):
        here = [one.within(scans, k, start.duration) for one in tracks if k in one.rows]
        values = [
            _from_middle(scans, k, one.rows[k], start) if chosen else _doubt(scans, one, alone)
            for one in here
        ]
        if min(values, default=np.inf) < np.inf:
            return here[int(np.argmin(values))]
    return None


def _doubt(scans: Scans, one: OpenTrack, alone: bool) -> float:
    """The standard error of a cluster's speed as a share of it; inf if it may stand still."""
    velocity, error = one.velocity(scans)
    speed = float(np.hypot(*velocity))
    return error / speed if speed >= LEAST_SPEED and (alone or is_fast(scans, one)) else np.inf


def _from_middle(scans: Scans, k: int, rows: np.ndarray, start: ScansStart) -> float:
    """Distance of a cluster in scan `k`, m, from the middle of the bounds; inf outside of them."""
    pose, bounds = scans.sensor_poses_world[k], (start.bearing, start.range)
    offset = scans.points_world[rows].mean(axis=0) - pose[:2]
    bearing = float(np.degrees(wrap_angle(np.arctan2(offset[1], offset[0]) - pose[2])))
    place = bearing, float(np.hypot(*offset))
    limits = [given or (value, value) for value, given in zip(place, bounds, strict=True)]
    if any(not low <= value <= high for value, (low, high) in zip(place, limits, strict=True)):
        return np.inf
    middle = np.mean(limits, axis=1)
    here, there = (distance * np.exp(1j * np.radians(angle)) for angle, distance in (place, middle))
    return float(np.abs(here - there))


def find_tracks(
    scans: Scans, prior: PriorShape, std: tuple[float, ...], duration: float
) -> tuple[FoundTrack, ...]:
    """The road users of the class that move, in the order of their first scans.

    Args:
        scans: of any sensor.
        prior: of the class.
        std: (6,) of the initial states, see `state_of`.
        duration: as of `initial_state`.
    """
    sizes = possible_sizes(prior)
    return tuple(
        FoundTrack(one.rows, last, initial_state(scans, one, last, sizes, std, duration))
        for one, last in moving(scans, follow(scans, sizes), sizes)
    )


def initial_state(
    scans: Scans,
    one: OpenTrack,
    last: int,
    sizes: np.ndarray,
    std: tuple[float, ...],
    duration: float,
) -> InitialState:
    """State one sample before the first scan of a track, see `state_of`.

    From its first `duration`, s, of the scans up to the `last`, which confirmed it.
    """
    first = min(one.rows)
    used = one.within(scans, first, min(duration, scans.times[last] - scans.times[first]))
    return state_of(scans, used, sizes, std, first)


def state_of(
    scans: Scans,
    one: OpenTrack,
    sizes: np.ndarray,
    std: tuple[float, ...],
    first: int = 0,
    motion: str = "scans",
) -> InitialState:
    """State one sample before the scan `first`: the class's rectangle on a cluster.

    With several `sizes` it has the mean and the covariance of an even mixture of their states.

    The line of centres over time gives place, direction and speed in the middle of the cluster's
    scans; the state is moved back in time at constant velocity.

    Args:
        scans: of the whole run.
        one: the cluster over time.
        sizes: (n, 2) m, length and width of the class, or of each possible class.
        std: (6,) of the state; those of heading and rates are greater where the scans do not show
            them.
        first: number of a scan.
        motion: `scans`: heading and velocity are those of the cluster; `sensor`: the sensor's, at
            the first scan of the cluster, which alone gives the place.
    """
    states = [_state_of(scans, one, size, std, motion) for size in sizes]
    means, covariances, times = (np.stack(part) for part in zip(*states, strict=True))
    mean, covariance = mixture(np.full(len(sizes), 1.0 / len(sizes)), means, covariances)
    back = transition(scans.times[first] - intervals(scans.times)[first] - times[0])
    return InitialState(back @ mean, back @ covariance @ back.T)


def _state_of(
    scans: Scans, one: OpenTrack, size: np.ndarray, std: tuple[float, ...], motion: str
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean (6,) and covariance (6, 6) with one `size` (2,) m, and their time, s."""
    of_sensor, sensors, stds = motion == "sensor", scans.sensor_poses_world, np.array(std)
    ks = [*one.rows][: 1 if of_sensor else None]
    points = [scans.points_world[one.rows[k]] for k in ks]
    times, near = scans.times[ks], slice(max(ks[0] - 1, 0), ks[0] + 2)
    if of_sensor:
        heading, velocity = sensors[ks[0], 2], line(scans.times[near], sensors[near, :2])[1]
    else:
        velocity, _ = one.velocity(scans)
        headed = float(np.hypot(*velocity)) >= LEAST_SPEED
        heading = float(np.arctan2(velocity[1], velocity[0])) if headed else _longest(points)
        stds[2] = stds[2] if headed else np.sqrt(GREATEST_VARIANCE)
    centres = [
        _centre(each, sensors[k, :2], heading, size) for k, each in zip(ks, points, strict=True)
    ]
    centre, of_centres, error = line(times, np.array(centres))
    if not of_sensor:
        velocity = of_centres
        stds[3:5] = min(float(np.hypot(stds[3], error)), max(stds[3], UNKNOWN_SPEED))
    return np.array([*centre, heading, *velocity, 0.0]), np.diag(stds**2), float(times.mean())


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
