"""The schema of a whole configuration, from the parameters of all packages.

The fields are the groups of `conf/`. No field has a default: the values are only in `conf/`, so a
configuration with a missing or an unknown key is invalid.
"""

import math
from functools import cache
from typing import Annotated

from annotated_types import Ge, Le, Len
from pydantic import Field, TypeAdapter

from stixel_cli.engine.parameters import CacheParameters, Executor
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.fabricated import FabricatedParameters
from stixel_cli.measurements.file import FileParameters
from stixel_cli.measurements.lidar import LidarParameters
from stixel_cli.measurements.own import OwnMeasurement
from stixel_cli.measurements.stixels import StixelsParameters
from stixel_cli.own_code import OwnCode
from stixel_cli.parameters import parameters
from stixel_cli.recordings.parameters import Source
from stixel_cli.rendering.filament_parameters import FilamentParameters
from stixel_cli.rendering.raycast_parameters import RaycastParameters
from stixel_cli.rendering.sensor_noise import Sensor
from stixel_cli.results.pictures import PicturesParameters
from stixel_cli.scene.ego import Ego
from stixel_cli.scene.path_parameters import Path
from stixel_cli.scene.road_user_parameters import RoadUser
from stixel_cli.scene.world_parameters import World
from stixel_cli.stereo.bm import BmParameters
from stixel_cli.stereo.sgm import SgmParameters
from stixel_cli.stixels.extraction_parameters import ExtractionParameters, HeightParameters
from stixel_cli.stixels.free_space_parameters import (
    FreeSpaceParameters,
    OccupancyParameters,
    RoadParameters,
)
from stixel_cli.tracking.baselines.box import BoxParameters
from stixel_cli.tracking.baselines.point import PointParameters
from stixel_cli.tracking.baselines.pyrecest_parameters import PyRecEstParameters
from stixel_cli.tracking.baselines.random_matrix import RandomMatrixParameters
from stixel_cli.tracking.baselines.rectangle import RectangleParameters
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.gp_ekf import GpEkfParameters
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.start import TruthStart
from stixel_cli.tracking.start_scans import ScansStart

Renderer = RaycastParameters | FilamentParameters
StereoParameters = SgmParameters | BmParameters
MeasurementParameters = StixelsParameters | FabricatedParameters | LidarParameters | FileParameters
Start = TruthStart | ScansStart
Tracker = (
    BoxParameters
    | ContourParameters
    | GpEkfParameters
    | PointParameters
    | PyRecEstParameters
    | RandomMatrixParameters
    | RectangleParameters
)

_BY_KIND = Field(discriminator="kind")


@parameters
class Configuration:
    """The configuration of one run; equal configurations give equal results.

    Attributes:
        seed: of all random numbers.
        metrics: further metrics, each a function of the user's own as "module:function".
        code_folders: folders of the user's own modules. Their content matters, not their names.
        source: images: rendered, or recorded by a real camera.
        road_user: the target; for your own mesh (triangles; metres, x forward, z up) set
            road_user.mesh.
        prior: what the trackers know about the class: size, shape, noise.
        path: the target's path.
        ego: motion of the ego car.
        rig: stereo cameras: image size, focal length, baseline.
        world: the street around the target.
        renderer: ray caster, or Open3D's Filament.
        sensor: noise of the rendered images.
        stereo: semi-global or block matching.
        road: road plane from the rig's pose, or estimated from the disparity.
        occupancy: coordinates of the occupancy grid.
        free_space: path through the occupancy grid, to the nearest obstacle of each column.
        height: heights of obstacles above the free space.
        extraction: stixels from free space and height.
        measurement: source of the scans.
        start: initial state of the tracker.
        tracker: the tracker of pose and shape.
        pictures: frames that get pictures.
        executor: where stages run; no result depends on it.
        cache: where results are cached; no result depends on it.
    """

    seed: Annotated[int, Ge(0), Le(2**63 - 1)]
    source: Annotated[Source, _BY_KIND]
    road_user: RoadUser
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
    measurement: Annotated[MeasurementParameters | OwnMeasurement, _BY_KIND]
    start: Annotated[Start, _BY_KIND]
    tracker: Annotated[Tracker | OwnCode, _BY_KIND]
    pictures: PicturesParameters
    metrics: Annotated[tuple[str, ...], Len(0, 64)]
    code_folders: Annotated[tuple[str, ...], Len(0, 64)]
    executor: Annotated[Executor, _BY_KIND]
    cache: CacheParameters

    @property
    def field_of_view(self) -> tuple[float, float] | None:
        """Bearings of the sensor's right and left border, rad; None if they are unknown."""
        scanner = getattr(self.measurement, "scanner", self.measurement)
        own = getattr(scanner, "horizontal_fov", None)
        if own is None:
            return None if isinstance(self.measurement, FileParameters) else self.rig.field_of_view
        return -math.radians(0.5 * own), math.radians(0.5 * own)

    @property
    def true_class(self) -> str | None:
        """The class of the road user; None if its shape is not one of ours, or is recorded."""
        ours = self.source.kind == "rendered" and self.road_user.mesh is None
        if not ours or isinstance(self.measurement, FileParameters):
            return None
        return self.road_user.kind

    @property
    def range_max(self) -> float | None:
        """The sensor's greatest range, m; None if it is unknown."""
        return getattr(self.measurement, "range_max", None)


@cache
def adapter() -> TypeAdapter:
    """The validator of `Configuration`, built once per process."""
    return TypeAdapter(Configuration)
