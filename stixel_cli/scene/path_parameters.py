"""Schemas of the group `path`.

Positions are in the world frame: the ego car's ground plane at k = 0, x right, y forward, m.
Headings are typed in degrees, counter-clockwise from +x: 90 drives away from the camera.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Len

from stixel_cli.geometry.rig import STRICT

MOST_SCANS = 100_000

Coordinate = Annotated[float, Ge(-1000), Le(1000)]
Point = tuple[Coordinate, Coordinate]
Degrees = Annotated[float, Ge(-360), Le(360)]
Speed = Annotated[float, Gt(0), Le(60)]
Duration = Annotated[float, Gt(0), Le(3600)]
SampleTime = Annotated[float, Ge(0.001), Le(10)]
LEAST_RADIUS, GREATEST_RADIUS = 0.5, 1000.0
Radius = Annotated[float, Ge(LEAST_RADIUS), Le(GREATEST_RADIUS)]
Side = Literal["left", "right"]


def _check_times(duration: float, sample_time: float) -> None:
    if duration / sample_time > MOST_SCANS:
        raise ValueError(
            f"path.duration: {duration:g} s at path.sample_time {sample_time:g} s are more than "
            f"{MOST_SCANS} scans"
        )


def _check_start(start: Point, key: str) -> None:
    if start[1] <= 0.0:
        raise ValueError(
            f"{key}: the path starts behind the camera, at ({start[0]:g}, {start[1]:g}); "
            "the second coordinate (forward) must be above 0"
        )


def _direction(heading: float) -> tuple[float, float]:
    return math.cos(math.radians(heading)), math.sin(math.radians(heading))


@dataclass(frozen=True)
class Approach:
    """Straight towards the camera.

    Attributes:
        start: first position, m. heading: degrees. speed: m/s. duration, sample_time: s.
    """

    __pydantic_config__ = STRICT

    kind: Literal["approach"]
    start: Point
    heading: Degrees
    speed: Speed
    duration: Duration
    sample_time: SampleTime

    def check(self) -> None:
        """Raise ValueError where the values do not go together."""
        _check_times(self.duration, self.sample_time)
        _check_start(self.start, "path.start")
        along_x, along_y = _direction(self.heading)
        if self.start[0] * along_x + self.start[1] * along_y >= 0.0:
            raise ValueError(
                f"path.heading: {self.heading:g} degrees from path.start comes no nearer to the "
                "camera; an approach must (-90 is straight towards it)"
            )


@dataclass(frozen=True)
class Depart:
    """Straight away from the camera.

    Attributes:
        start: first position, m. heading: degrees. speed: m/s. duration, sample_time: s.
    """

    __pydantic_config__ = STRICT

    kind: Literal["depart"]
    start: Point
    heading: Degrees
    speed: Speed
    duration: Duration
    sample_time: SampleTime

    def check(self) -> None:
        """Raise ValueError where the values do not go together."""
        _check_times(self.duration, self.sample_time)
        _check_start(self.start, "path.start")
        along_x, along_y = _direction(self.heading)
        if self.start[0] * along_x + self.start[1] * along_y <= 0.0:
            raise ValueError(
                f"path.heading: {self.heading:g} degrees from path.start comes nearer to the "
                "camera; a departure must not (90 is straight away from it)"
            )


@dataclass(frozen=True)
class Crossing:
    """Straight across, from left to right.

    Attributes:
        start: first position, m. heading: degrees. speed: m/s. duration, sample_time: s.
    """

    __pydantic_config__ = STRICT

    kind: Literal["crossing"]
    start: Point
    heading: Degrees
    speed: Speed
    duration: Duration
    sample_time: SampleTime

    def check(self) -> None:
        """Raise ValueError where the values do not go together."""
        _check_times(self.duration, self.sample_time)
        _check_start(self.start, "path.start")
        if _direction(self.heading)[0] <= 0.0:
            raise ValueError(
                f"path.heading: {self.heading:g} degrees does not go from left to right; "
                "a crossing must (0 is straight across)"
            )


@dataclass(frozen=True)
class Turn:
    """A constant turn.

    Attributes:
        start: first position, m. heading: first heading, degrees. side: where it turns to.
        radius: m. speed: m/s. duration, sample_time: s.
    """

    __pydantic_config__ = STRICT

    kind: Literal["turn"]
    start: Point
    heading: Degrees
    side: Side
    radius: Radius
    speed: Speed
    duration: Duration
    sample_time: SampleTime

    def check(self) -> None:
        """Raise ValueError where the values do not go together."""
        _check_times(self.duration, self.sample_time)
        _check_start(self.start, "path.start")


@dataclass(frozen=True)
class SCurve:
    """Swings to the left and to the right of a straight line: heading + swing sin(2π s / λ).

    Attributes:
        start: first position, m. heading: mean heading, degrees.
        swing: greatest deviation from it, degrees; negative swings to the right first.
        wavelength: λ, length along the path of one swing to both sides, m.
        speed: m/s. duration, sample_time: s.
    """

    __pydantic_config__ = STRICT

    kind: Literal["s_curve"]
    start: Point
    heading: Degrees
    swing: Annotated[float, Ge(-90), Le(90)]
    wavelength: Annotated[float, Ge(1), Le(1000)]
    speed: Speed
    duration: Duration
    sample_time: SampleTime

    def check(self) -> None:
        """Raise ValueError where the values do not go together."""
        _check_times(self.duration, self.sample_time)
        _check_start(self.start, "path.start")


@dataclass(frozen=True)
class StopAndGo:
    """A straight line on which the road user drives, brakes, stands, and pulls away, in turn.

    Attributes:
        start: first position, m. heading: degrees. speed: of driving, m/s.
        drive_time, ramp_time, stand_time: how long it drives, brakes (and pulls away: the same
            time, constant acceleration) and stands, s.
        duration, sample_time: s.
    """

    __pydantic_config__ = STRICT

    kind: Literal["stop_and_go"]
    start: Point
    heading: Degrees
    speed: Speed
    drive_time: Annotated[float, Ge(0), Le(3600)]
    ramp_time: Annotated[float, Ge(0.1), Le(60)]
    stand_time: Annotated[float, Ge(0), Le(3600)]
    duration: Duration
    sample_time: SampleTime

    def check(self) -> None:
        """Raise ValueError where the values do not go together."""
        _check_times(self.duration, self.sample_time)
        _check_start(self.start, "path.start")


@dataclass(frozen=True)
class Circle:
    """A circle: every side of the road user is seen.

    Attributes:
        start: first position, m. heading: first heading, degrees. side: where it turns to.
        radius: m; null is the radius with which the circle closes in `duration`, which must then
            be one that could be given.
        speed: m/s. duration, sample_time: s.
    """

    __pydantic_config__ = STRICT

    kind: Literal["circle"]
    start: Point
    heading: Degrees
    side: Side
    radius: Radius | None
    speed: Speed
    duration: Duration
    sample_time: SampleTime

    @property
    def closing_radius(self) -> float:
        """Radius in m with which the circle closes in `duration`."""
        return self.speed * self.duration / (2.0 * math.pi)

    def check(self) -> None:
        """Raise ValueError where the values do not go together."""
        _check_times(self.duration, self.sample_time)
        _check_start(self.start, "path.start")
        if self.radius is None and not LEAST_RADIUS <= self.closing_radius <= GREATEST_RADIUS:
            raise ValueError(
                f"path.duration: {self.duration:g} s at path.speed {self.speed:g} m/s closes a "
                f"circle of radius {self.closing_radius:.2g} m: must be {LEAST_RADIUS:g} to "
                f"{GREATEST_RADIUS:g} m; or give path.radius"
            )


@dataclass(frozen=True)
class Waypoints:
    """A cubic spline through the user's points at constant speed, then straight on.

    Attributes:
        points: at least two positions, m; the path starts at the first.
        speed: m/s. duration, sample_time: s.
    """

    __pydantic_config__ = STRICT

    kind: Literal["waypoints"]
    points: Annotated[tuple[Point, ...], Len(0, 1000)]
    speed: Speed
    duration: Duration
    sample_time: SampleTime

    def check(self) -> None:
        """Raise ValueError where the values do not go together."""
        _check_times(self.duration, self.sample_time)
        if len(self.points) < 2:
            raise ValueError(f"path.points: two points at least, not {len(self.points)}")
        if not all(math.isfinite(value) for point in self.points for value in point):
            raise ValueError("path.points: every coordinate must be finite")
        _check_start(self.points[0], "path.points")
        chords = [
            (b[0] - a[0], b[1] - a[1]) for a, b in zip(self.points, self.points[1:], strict=False)
        ]
        lengths = [math.hypot(*chord) for chord in chords]
        for i, length in enumerate(lengths):
            if length < 0.01:
                raise ValueError(f"path.points: points {i} and {i + 1} are the same")
        for i in range(1, len(chords)):
            dot = chords[i - 1][0] * chords[i][0] + chords[i - 1][1] * chords[i][1]
            if dot < -0.98 * lengths[i - 1] * lengths[i]:
                raise ValueError(f"path.points: the path turns back on itself at point {i}")


Path = Approach | Depart | Crossing | Turn | SCurve | StopAndGo | Circle | Waypoints
