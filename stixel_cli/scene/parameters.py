"""Classes of road users, and parameters of the groups `road_user`, `world` and `path`.

Positions are in the world frame: the ego car's ground plane at k = 0, x right, y forward, m.
Headings are typed in degrees, counter-clockwise from +x: 90 drives away from the camera.
"""

import math
import os.path
import re
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, get_args

import numpy as np
from annotated_types import Ge, Gt, Le, Len

from stixel_cli.parameters import parameters

RoadUserClass = Literal["car", "cyclist", "pedestrian"]


@dataclass(frozen=True)
class ClassRow:
    """Names of a class in other formats, and its speed."""

    kitti_types: tuple[str, ...]
    """Types of KITTI's labels that are of this class; exported labels have the first."""
    stx1_type: str
    """Type of pyStixel-lib's segmentation."""
    speed: float
    """Root mean square speed, m/s."""
    reverse_speed: float
    """It drives or walks backwards no faster, m/s."""
    argoverse_category: str | None = None
    """Of Argoverse's labels; None without one: its BICYCLIST is only the rider, and the BICYCLE has
    a label of its own."""


CLASS_ROWS: dict[RoadUserClass, ClassRow] = {
    "car": ClassRow(("Car", "Van"), "TYPE_CAR", 12.0, 3.0, "REGULAR_VEHICLE"),
    "cyclist": ClassRow(("Cyclist",), "TYPE_BICYCLIST", 5.0, 0.3),
    "pedestrian": ClassRow(
        ("Pedestrian", "Person_sitting"), "TYPE_PEDESTRIAN", 1.2, 0.3, "PEDESTRIAN"
    ),
}

ROAD_USER_CLASSES: tuple[RoadUserClass, ...] = get_args(RoadUserClass)

CLASS_OF_KITTI_TYPE = {kitti: name for name, row in CLASS_ROWS.items() for kitti in row.kitti_types}
"""The class of road user of each type of KITTI's labels that has one."""


@parameters
class RoadUser:
    """The target.

    Attributes:
        kind: the class of road user.
        length: of the mesh's bounding box along the heading, m; a pedestrian's is the stride. Not
            read for a mesh of your own or a drawn shape: they keep their size.
        width: of the mesh's bounding box across the heading, m; a pedestrian's goes over shoulders
            and arms. Not read for a mesh of your own or a drawn shape.
        height: of the mesh's bounding box, m. Not read for a mesh of your own or a drawn shape.
        contrast: how strong the texture of paint and cloth is, 0 (plain) … 1; stereo fails on 0.
        shape_seed: seed that draws a body and its size within the class, or null for the standard
            shape.
        mesh: file with a mesh of your own (.glb, .gltf, .obj, .off, .ply or .stl; m) or null.
        mesh_scale: factor on the mesh's coordinates: 0.001 for a file in millimetres.
        mesh_forward: axis of the mesh's file that points forward.
        mesh_up: axis of the mesh's file that points up: y in all .glb and .gltf, and many .obj.
    """

    kind: RoadUserClass
    length: Annotated[float, Ge(0.1), Le(30)]
    width: Annotated[float, Ge(0.1), Le(10)]
    height: Annotated[float, Ge(0.1), Le(10)]
    contrast: Annotated[float, Ge(0), Le(1)]
    shape_seed: Annotated[int, Ge(0), Le(2**63 - 1)] | None
    mesh: str | None
    mesh_scale: Annotated[float, Gt(0), Le(1000)]
    mesh_forward: Literal["x", "-x", "y", "-y", "z", "-z"]
    mesh_up: Literal["z", "y"] = "z"

    def check(self) -> None:
        """Raise ValueError if the shape has two sources, or a mesh is not a file or not given.

        The content of the file is checked on reading.
        """
        seed = self.shape_seed
        if self.mesh is not None and seed is not None:
            raise ValueError(f"road_user.shape_seed: must be null with road_user.mesh, got {seed}")
        if self.mesh is not None and not os.path.isfile(self.mesh):
            raise ValueError(f"road_user.mesh: file not found: {self.mesh!r}")
        if self.mesh_forward.endswith(self.mesh_up):
            raise ValueError(
                f"road_user.mesh_forward: must be another axis than road_user.mesh_up, "
                f"{self.mesh_up}"
            )
        given = (self.mesh_scale, self.mesh_forward, self.mesh_up)
        if self.mesh is None and given != (1.0, "x", "z"):
            raise ValueError(
                "road_user.mesh_scale, road_user.mesh_forward, road_user.mesh_up: only for a mesh "
                "of your own; give road_user.mesh=FILE, too"
            )


@parameters
class World:
    """Road and background.

    Attributes:
        kind: `street` leads off a town square, with houses, trees, poles and parked cars;
            `roadside` has such objects along the ego car's way, and leaves the way and the view of
            the target free; `fenced` is the same with fences and hedges along the way, whose ends
            and gaps a stereo camera may take for moving objects.
        seed: of the layout and its textures (not the run's seed).
        contrast: how strong the textures of road and background are, 0 (plain) … 1.
        occluder: what stands between the camera and the target and hides it for a part of the way;
            `seed` draws its place and its size.
    """

    kind: Literal["street", "roadside", "fenced"]
    seed: Annotated[int, Ge(0), Le(1_000_000)]
    contrast: Annotated[float, Ge(0), Le(1)]
    occluder: Literal["none", "parked_car", "post", "hedge"] = "none"


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


@parameters(kw_only=True)
class _Driven:
    """Parameters of every path: speed, duration and sample time.

    Attributes:
        kind: which path it is.
        speed: m/s.
        duration: s.
        sample_time: time from one scan to the next, s.
    """

    kind: str
    speed: Speed
    duration: Duration
    sample_time: SampleTime

    def check(self) -> None:
        """Raise ValueError if the values contradict each other."""
        duration, step = f"{self.duration:g} s", f"{self.sample_time:g} s"
        if self.sample_time > self.duration:
            raise ValueError(f"path.sample_time: must be <= path.duration ({duration}), got {step}")
        if self.duration / self.sample_time > MOST_SCANS:
            raise ValueError(
                f"path.duration: {self.duration:g} s with path.sample_time={self.sample_time:g} s "
                f"gives more than {MOST_SCANS} scans"
            )
        drawn = isinstance(self, Waypoints)
        key, (x, y) = ("points", self.points[0]) if drawn else ("start", self.start)
        if y <= 0.0:
            raise ValueError(
                f"path.{key}: the path starts behind the camera, at ({x:g}, {y:g}); "
                "the second coordinate (forward) must be above 0"
            )


@dataclass(frozen=True, kw_only=True)
class _FromStart(_Driven):
    """Further parameters of the paths that are not a list of points.

    Attributes:
        start: first position, m.
        heading: first heading, degrees.
    """

    start: Point
    heading: Degrees


@dataclass(frozen=True, kw_only=True)
class Line(_FromStart):
    """A straight line: towards the camera, away from it, or across from left to right."""

    kind: Literal["approach", "depart", "crossing"]

    def check(self) -> None:
        """Raise ValueError if the values contradict each other."""
        super().check()
        heading = math.radians(self.heading)
        away = self.start[0] * math.cos(heading) + self.start[1] * math.sin(heading)
        fits, way = {
            "approach": (away < 0.0, "from path.start towards the camera (-90: straight)"),
            "depart": (away > 0.0, "from path.start away from the camera (90: straight)"),
            "crossing": (math.cos(heading) > 0.0, "from left to right (0: straight across)"),
        }[self.kind]
        if not fits:
            must = f"path={self.kind} must lead {way}"
            raise ValueError(f"path.heading: {must}, got {self.heading:g} degrees")


@dataclass(frozen=True, kw_only=True)
class Arc(_FromStart):
    """A constant turn, or a circle: every side of the road user is seen.

    Attributes:
        side: where it turns to.
        radius: m; null is the radius with which a circle closes in `duration`; it must be in
            the same bounds.
    """

    kind: Literal["turn", "circle"]
    side: Side
    radius: Radius | None

    @property
    def closing_radius(self) -> float:
        """Radius in m with which the circle closes in `duration`."""
        return self.speed * self.duration / (2.0 * math.pi)

    def check(self) -> None:
        """Raise ValueError if the values contradict each other."""
        super().check()
        if self.radius is None and not LEAST_RADIUS <= self.closing_radius <= GREATEST_RADIUS:
            raise ValueError(
                f"path.duration: {self.duration:g} s with path.speed={self.speed:g} m/s closes a "
                f"circle of radius {self.closing_radius:.2g} m; it must be {LEAST_RADIUS:g} to "
                f"{GREATEST_RADIUS:g} m, or set path.radius"
            )


@dataclass(frozen=True, kw_only=True)
class SCurve(_FromStart):
    """Swings to the left and to the right of a straight line: heading + swing sin(2π s / λ).

    Attributes:
        heading: mean heading, degrees, which is the first one too.
        swing: greatest angle to it, degrees; negative swings to the right first.
        wavelength: λ, length along the path of one swing to both sides, m.
    """

    kind: Literal["s_curve"]
    swing: Annotated[float, Ge(-90), Le(90)]
    wavelength: Annotated[float, Ge(1), Le(1000)]


@dataclass(frozen=True, kw_only=True)
class StopAndGo(_FromStart):
    """A straight line on which the road user drives, brakes, waits, and pulls away, in turn.

    Attributes:
        speed: of driving, m/s.
    """

    kind: Literal["stop_and_go"]

    drive_time: ClassVar[float] = 1.0
    """How long it drives, s."""
    ramp_time: ClassVar[float] = 1.5
    """How long it brakes, and pulls away, at constant acceleration, s."""
    stand_time: ClassVar[float] = 2.0
    """How long it waits, s."""


@dataclass(frozen=True, kw_only=True)
class Waypoints(_Driven):
    """A cubic spline through the user's points at constant speed, then straight on.

    Attributes:
        points: at least two positions, m; the path starts at the first.
    """

    kind: Literal["waypoints"]
    points: Annotated[tuple[Point, ...], Len(0, 1000)]

    def check(self) -> None:
        """Raise ValueError if the values contradict each other."""
        if len(self.points) < 2:
            raise ValueError(f"path.points: must have at least two points, got {len(self.points)}")
        super().check()
        chords = np.diff(self.points, axis=0)
        lengths = np.hypot(*chords.T)
        for i in np.flatnonzero(lengths < 0.01):
            raise ValueError(f"path.points: points {i} and {i + 1} are the same")
        cosines = np.sum(chords[1:] * chords[:-1], axis=1) / (lengths[1:] * lengths[:-1])
        for i in np.flatnonzero(cosines < -0.98) + 1:
            raise ValueError(f"path.points: the path turns back on itself at point {i}")


@parameters
class RecordedPath:
    """The target moves as in the recording; composed for it, so no option has this kind.

    Attributes:
        duration: of all frames, s.
        sample_time: time from one frame to the next, s.
    """

    kind: Literal["source"]
    duration: Duration
    sample_time: SampleTime


@parameters
class ReplayedPath:
    """The target and the ego car move as in a clip of KITTI tracking or a log of Argoverse 2.

    Images are not needed. Smoothing splines over time give the target's place and heading in the
    world. The poses of the ego car are not smoothed.

    Attributes:
        folder: with `label_02`, `oxts` (or `ego_poses`) and `calib`, or the one above its
            `training`; or the log's folder, with `annotations.feather`.
        sequence: number of KITTI's clip, such as 0005; null for a log.
        target: track id in the labels; track_uuid of a log.
        frames: numbers of the frames, `first:stop`; null for all of the track. Frames without a
            label are interpolated.
        smoothing: changes of this period keep half of their amplitude, faster ones less, s.
        duration: of all frames, s.
        sample_time: time from one frame to the next, s.
    """

    kind: Literal["recorded"]
    folder: str | None
    sequence: str | None
    target: Annotated[int, Ge(0)] | str | None
    frames: str | None
    smoothing: Annotated[float, Ge(0), Le(60)]
    duration: Duration
    sample_time: SampleTime

    def check(self) -> None:
        """Raise ValueError if a needed value is missing or not valid."""
        for name in ("folder", "target"):
            if getattr(self, name) in (None, ""):
                raise ValueError(f"path.{name}: is required with path={self.kind}")
        if self.sequence is not None and not re.fullmatch(r"\d{1,4}", self.sequence):
            raise ValueError(f"path.sequence: must be a number such as 0005, got {self.sequence!r}")


Path = Line | Arc | SCurve | StopAndGo | Waypoints | ReplayedPath | RecordedPath
