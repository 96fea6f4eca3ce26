"""The schema of a whole configuration: the rooms' parameters put together.

The fields are the groups of `conf/`. No field of any of them has a default: the values stand in
`conf/` alone, so a configuration that lacks a key, or has one more, is wrong.
"""

from dataclasses import dataclass
from functools import cache
from typing import Annotated

from annotated_types import Ge, Le
from pydantic import Field, TypeAdapter

from stixel_cli.engine.parameters import CacheParameters, Executor
from stixel_cli.geometry.rig import STRICT, Rig
from stixel_cli.measurements.parameters import MeasurementParameters
from stixel_cli.report.parameters import PicturesParameters
from stixel_cli.scene.parameters import Ego, Pace, Path, RoadUser, World
from stixel_cli.scene.renderer_parameters import Renderer, Sensor
from stixel_cli.stereo.parameters import StereoParameters
from stixel_cli.stixels.parameters import (
    ExtractionParameters,
    FreeSpaceParameters,
    HeightParameters,
    OccupancyParameters,
    RoadParameters,
)
from stixel_cli.tracking.parameters import PriorShape, StartParameters, Tracker

_BY_KIND = Field(discriminator="kind")


@dataclass(frozen=True)
class Configuration:
    """All that an experiment depends on; two equal configurations give the same results.

    Attributes:
        seed: of everything that is drawn at random.
        executor, cache: where it runs and where results are kept. No result depends on them.
        others: the parameters of one group each, see the class of each.
    """

    __pydantic_config__ = STRICT

    seed: Annotated[int, Ge(0), Le(2**63 - 1)]
    road_user: RoadUser
    pace: Pace
    prior: PriorShape
    path: Annotated[Path, _BY_KIND]
    ego: Annotated[Ego, _BY_KIND]
    rig: Rig
    world: World
    renderer: Annotated[Renderer, _BY_KIND]
    sensor: Sensor
    stereo: Annotated[StereoParameters, _BY_KIND]
    road: Annotated[RoadParameters, _BY_KIND]
    occupancy: Annotated[OccupancyParameters, _BY_KIND]
    free_space: FreeSpaceParameters
    height: HeightParameters
    extraction: ExtractionParameters
    measurement: Annotated[MeasurementParameters, _BY_KIND]
    start: StartParameters
    tracker: Annotated[Tracker, _BY_KIND]
    pictures: PicturesParameters
    executor: Annotated[Executor, _BY_KIND]
    cache: CacheParameters


@cache
def adapter() -> TypeAdapter:
    """The validator of `Configuration`, built once a process."""
    return TypeAdapter(Configuration)
