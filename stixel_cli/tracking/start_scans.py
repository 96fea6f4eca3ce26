"""Initialisation of a tracker from the first scans alone: a cluster of points that is followed."""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from stixel_cli.geometry.pose import wrap_angle
from stixel_cli.measurements.scans import Scans
from stixel_cli.parameters import parameters
from stixel_cli.tracking.contour.class_size import SIZES, possible_sizes
from stixel_cli.tracking.followed import LARGEST, SLACK, SLOWEST, OpenTrack, follow, state_of
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


CERTAIN = 6.0
"""A cluster moves if it is faster than `SLOWEST`, and by so many standard errors of its speed."""

LEAST_SCANS = 3
"""Scans of a cluster from which a motion can be seen."""


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
        target = _target(scans, start, sizes)
    except ValueError:
        sizes = SIZES
        target = _target(scans, start, sizes)
    return state_of(scans, target, sizes, start.std, start.motion)


def _target(scans: Scans, start: ScansStart, sizes: np.ndarray) -> OpenTrack:
    """The target's cluster over time, of one of the `sizes` (n, 2) m.

    From the first scan that has one: of several, the one with the least value.
    """
    longest = LARGEST * float(np.hypot(*sizes.T).max()) + 2.0 * SLACK
    tracks = follow(scans, longest, _angle_of_rays(scans))
    # A cluster that is alone in its scans may move with any doubt: nothing else can be the target.
    alone = sum(len(one.rows) for one in tracks) == len({k for one in tracks for k in one.rows})
    chosen = start.bearing is not None or start.range is not None
    for k in range(len(scans)):
        here = [one.within(scans, k, start.duration) for one in tracks if k in one.rows]
        values = [
            _from_middle(scans, one, start) if chosen else _doubt(scans, one, alone) for one in here
        ]
        possible = [i for i, value in enumerate(values) if value is not None]
        if possible:
            return here[min(possible, key=values.__getitem__)]
    if not chosen:
        raise ValueError(
            "no cluster of the class's size moves: give start.bearing=[LO,HI] (degrees) and "
            "start.range=[LO,HI] (m)"
        )
    units = (("bearing", start.bearing, "degrees"), ("range", start.range, "m"))
    bounds = " and ".join(f"{name} {list(one)} {unit}" for name, one, unit in units if one)
    raise ValueError(f"no scan has a cluster of the class's size in {bounds}: widen them")


def _angle_of_rays(scans: Scans) -> float:
    """Median angle between neighbouring points of a scan, seen from the sensor, rad; 0 if none."""
    steps = []
    for k in range(len(scans)):
        away = scans.points_world[scans.rows(k)] - scans.sensor_poses_world[k, :2]
        bearings = np.arctan2(away[:, 1], away[:, 0]) - scans.sensor_poses_world[k, 2]
        steps.append(np.diff(np.sort(wrap_angle(bearings))))
    together = np.concatenate(steps)
    return float(np.median(together)) if len(together) else 0.0


def _from_middle(scans: Scans, one: OpenTrack, start: ScansStart) -> float | None:
    """Distance of the first cluster, m, from the middle of the bounds; None outside of them."""
    k, rows = next(iter(one.rows.items()))
    pose, bounds = scans.sensor_poses_world[k], (start.bearing, start.range)
    offset = scans.points_world[rows].mean(axis=0) - pose[:2]
    bearing = float(np.degrees(wrap_angle(np.arctan2(offset[1], offset[0]) - pose[2])))
    place = bearing, float(np.hypot(*offset))
    for value, limits in zip(place, bounds, strict=True):
        if limits is not None and not limits[0] <= value <= limits[1]:
            return None
    middle = [
        0.5 * sum(limits or (value, value)) for value, limits in zip(place, bounds, strict=True)
    ]
    here, there = (distance * np.exp(1j * np.radians(angle)) for angle, distance in (place, middle))
    return float(np.abs(here - there))


def _doubt(scans: Scans, one: OpenTrack, alone: bool) -> float | None:
    """The standard error of a cluster's speed as a share of it; None if it may stand still."""
    if len(one.rows) < LEAST_SCANS:
        return None
    velocity, error = one.velocity(scans)
    speed = float(np.hypot(*velocity))
    return error / speed if speed >= (SLOWEST if alone else max(SLOWEST, CERTAIN * error)) else None
