"""Schemas of the groups `road_user`, `pace`, `path`, `ego` and `world`; defaults are in conf/."""

import os.path
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Le

from stixel_cli.geometry.rig import STRICT
from stixel_cli.scene.pace_parameters import Pace, Stretch
from stixel_cli.scene.path_parameters import (
    Approach,
    Circle,
    Crossing,
    Depart,
    Path,
    SCurve,
    StopAndGo,
    Turn,
    Waypoints,
)

__all__ = [
    "Approach",
    "Circle",
    "Crossing",
    "Depart",
    "Ego",
    "Pace",
    "Parked",
    "Path",
    "RoadUser",
    "SCurve",
    "StopAndGo",
    "Straight",
    "Stretch",
    "Turn",
    "Turning",
    "Waypoints",
    "World",
]


@dataclass(frozen=True)
class RoadUser:
    """The target.

    Attributes:
        kind: the class of road user.
        length, width, height: size of the mesh's bounding box, m: along the heading, across it and
            upwards. A pedestrian's length is the stride, the width goes over shoulders and arms.
            A user's own mesh brings its size along, and these three are not read.
        contrast: how strong the texture of paint and cloth is, 0 (plain) … 1; stereo fails on 0.
        mesh: file with the user's own mesh (whatever Open3D reads; m, x forward, z up) or null.
    """

    __pydantic_config__ = STRICT

    kind: Literal["car", "cyclist", "pedestrian"]
    length: Annotated[float, Ge(0.1), Le(30)]
    width: Annotated[float, Ge(0.1), Le(10)]
    height: Annotated[float, Ge(0.1), Le(10)]
    contrast: Annotated[float, Ge(0), Le(1)]
    mesh: str | None

    def check(self) -> None:
        """Raise ValueError where the user's mesh is no file; what is in it is seen on reading."""
        if self.mesh is not None and not os.path.isfile(self.mesh):
            raise ValueError(f"road_user.mesh: there is no file {self.mesh!r}")


@dataclass(frozen=True)
class Parked:
    """The ego car stands."""

    __pydantic_config__ = STRICT

    kind: Literal["parked"]


@dataclass(frozen=True)
class Straight:
    """The ego car drives straight ahead.

    Attributes:
        speed: m/s.
    """

    __pydantic_config__ = STRICT

    kind: Literal["straight"]
    speed: Annotated[float, Ge(0), Le(60)]


@dataclass(frozen=True)
class Turning:
    """The ego car drives along an arc.

    Attributes:
        speed: m/s.
        yaw_rate: degrees/s, positive to the left.
    """

    __pydantic_config__ = STRICT

    kind: Literal["turning"]
    speed: Annotated[float, Ge(0), Le(60)]
    yaw_rate: Annotated[float, Ge(-90), Le(90)]


Ego = Parked | Straight | Turning


@dataclass(frozen=True)
class World:
    """Road and background.

    Attributes:
        kind: a street that leads off a town square, with houses, trees, poles and parked cars.
        seed: of the layout and its textures (not the experiment's seed).
        contrast: how strong the textures of road and background are, 0 (plain) … 1.
    """

    __pydantic_config__ = STRICT

    kind: Literal["street"]
    seed: Annotated[int, Ge(0), Le(1_000_000)]
    contrast: Annotated[float, Ge(0), Le(1)]
