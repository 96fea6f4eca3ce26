"""The schema of a whole configuration, from the parameters of all packages.

The fields are the groups of `conf/`. No field has a default: the values are only in `conf/`, so a
configuration with a missing or an unknown key is invalid. Conditions between several keys and
groups are checked, too, before anything is computed.
"""

import dataclasses
import inspect
import math
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path as FilePath
from typing import Annotated

from annotated_types import Ge, Le, Len
from pydantic import Field

from stixel_cli.border.own_code import OwnCode
from stixel_cli.engine.parameters import CacheParameters, Executor
from stixel_cli.geometry.rig import Rig
from stixel_cli.measurements.fabricated import FabricatedParameters
from stixel_cli.measurements.file import FileParameters
from stixel_cli.measurements.lidar import LidarParameters
from stixel_cli.measurements.own import OwnMeasurement
from stixel_cli.measurements.parameters import check_dropout
from stixel_cli.measurements.stixels import StixelsParameters
from stixel_cli.parameters import parameters
from stixel_cli.recordings.parameters import Source
from stixel_cli.rendering.parameters import FilamentParameters, RaycastParameters
from stixel_cli.rendering.sensor_noise import Sensor
from stixel_cli.results.pictures import PicturesParameters
from stixel_cli.scene.ego import Ego
from stixel_cli.scene.parameters import ROAD_USER_CLASSES, Path, RoadUser, World
from stixel_cli.stereo.matching import StereoParameters
from stixel_cli.stixels import parameters as stixels
from stixel_cli.tracking.baselines.box import BoxParameters
from stixel_cli.tracking.baselines.gm_mem_ekf import GmMemEkfParameters
from stixel_cli.tracking.baselines.lidar_random_matrix import LidarRandomMatrixParameters
from stixel_cli.tracking.baselines.point import PointParameters
from stixel_cli.tracking.baselines.pyrecest import PyRecEstParameters
from stixel_cli.tracking.baselines.rectangle import RectangleParameters
from stixel_cli.tracking.contour.contour_parameters import ContourParameters
from stixel_cli.tracking.file import FileTrackParameters
from stixel_cli.tracking.followed import ScansStart
from stixel_cli.tracking.gp_ekf import GpEkfParameters
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.start import NO_TRUTH, TruthStart

Renderer = RaycastParameters | FilamentParameters
MeasurementParameters = StixelsParameters | FabricatedParameters | LidarParameters | FileParameters
Start = TruthStart | ScansStart
Tracker = (
    BoxParameters
    | ContourParameters
    | FileTrackParameters
    | GmMemEkfParameters
    | GpEkfParameters
    | LidarRandomMatrixParameters
    | PointParameters
    | PyRecEstParameters
    | RectangleParameters
)

_BY_KIND = Field(discriminator="kind")

SAME_SIZE = 0.02
"""The prior's length and width may differ by this share from a box of the user's file."""

_NEAREST_START = 1.0
"""Minimum distance between the camera and the target at its start, m."""


@parameters
class Configuration:
    """The configuration of one run; equal configurations give equal results.

    Attributes:
        seed: of all random numbers.
        metrics: further metrics, each a function of the user's own as "module:function".
        code_folders: folders of the user's own modules. Their content matters, not their names.
        source: images: rendered, or recorded by a real camera.
        road_user: the target; for your own mesh (metres, x forward, z up) set road_user.mesh.
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
    road: Annotated[stixels.RoadParameters, _BY_KIND]
    occupancy: stixels.OccupancyParameters
    free_space: stixels.FreeSpaceParameters
    height: stixels.HeightParameters
    extraction: stixels.ExtractionParameters
    measurement: Annotated[MeasurementParameters | OwnMeasurement, _BY_KIND]
    start: Annotated[Start, _BY_KIND]
    tracker: Annotated[Tracker | OwnCode, _BY_KIND]
    pictures: PicturesParameters
    metrics: Annotated[tuple[str, ...], Len(0, 64)]
    code_folders: Annotated[tuple[str, ...], Len(0, 64)]
    executor: Annotated[Executor, _BY_KIND]
    cache: CacheParameters

    def check(self) -> None:
        """Raise ValueError if keys that are valid one by one contradict each other."""
        for fault in _faults(self):
            raise ValueError(fault)

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


def _faults(configuration: Configuration) -> Iterator[str]:
    yield from _faults_of_source(configuration)
    for field in dataclasses.fields(configuration):
        part = getattr(configuration, field.name)
        if hasattr(part, "check"):
            others = _groups_of(type(part))
            part.check(**{group: getattr(configuration, group) for group in others})
    yield from _faults_of_prior(configuration)
    check_dropout(configuration.measurement)
    yield from _faults_of_start(configuration)


@cache
def _groups_of(part: type) -> tuple[str, ...]:
    """The other groups that the check of a part needs: the names of its arguments."""
    return tuple(inspect.signature(part.check).parameters)[1:]


def _faults_of_source(configuration: Configuration) -> Iterator[str]:
    """A recorded path with rendered images, and the other way round."""
    source, kind = configuration.source.kind, configuration.measurement.kind
    recorded = source != "rendered"
    if recorded and kind != "stixels":
        only = f"with source={source} only measurement=stixels"
        yield f"measurement: {kind} is of the rendered scene; {only}"
    for group in ("path", "ego"):
        kind = getattr(configuration, group).kind
        replayed = group == "ego" and configuration.path.kind == "recorded"
        if kind == "source" and not recorded and not replayed:
            yield f"{group}: source needs a recording, got source=rendered"
        if recorded and kind not in ("source", "parked"):
            yield f"{group}: {kind} is of the rendered scene; source={source} defines its {group}"


def _faults_of_prior(configuration: Configuration) -> Iterator[str]:
    """A class or an outline that is not in its file, or is not of the prior's size."""
    prior = configuration.prior
    if prior.class_file is not None:
        if not prior.class_file.endswith(".json"):
            known = ", ".join((*ROAD_USER_CLASSES, "unknown"))
            right = f"must be one of {known}, or the .json file of stixel new class"
            yield f"prior.road_user: {prior.class_file!r} is not known: {right}"
        from stixel_cli.tracking.contour.user_shape import read_class

        known = read_class(FilePath(prior.class_file))
        kind = getattr(configuration.tracker, "seen_by", None)
        sensor = kind if kind in ("stixels", "lidar") else "outline"
        if kind is not None and sensor not in known:
            fault = f"{prior.class_file} has no visible shape for tracker.seen_by={kind}"
            yield f"prior.road_user: {fault}: learn it, stixel new class --sensor {sensor}"
        yield from _faults_of_size("road_user", [0.001 * one for one in known["size"]], prior)
    if prior.outline is not None:
        from stixel_cli.tracking.contour.user_shape import read_outline

        if prior.road_user == "unknown":
            yield "prior.outline: needs a class: give prior.road_user, too"
        vertices = read_outline(FilePath(prior.outline))
        size = (vertices.max(axis=0) - vertices.min(axis=0)).tolist()
        yield from _faults_of_size("outline", size, prior)


def _faults_of_size(key: str, size: Sequence[float], prior: PriorShape) -> Iterator[str]:
    length, width = size
    if abs(length / prior.length - 1.0) > SAME_SIZE or abs(width / prior.width - 1.0) > SAME_SIZE:
        of_prior = f"the prior's {prior.length:.3g} × {prior.width:.3g} m"
        how = f"give prior.length={length:.3g} prior.width={width:.3g}"
        yield f"prior.{key}: the file's box is {length:.3g} × {width:.3g} m, {of_prior}: {how}"


def _faults_of_start(configuration: Configuration) -> Iterator[str]:
    """A start from a truth that is missing, and a target that starts at the camera."""
    measurement, path, user = configuration.measurement, configuration.path, configuration.road_user
    without_truth = isinstance(measurement, FileParameters) and measurement.truth is None
    if without_truth and measurement.path and isinstance(configuration.start, TruthStart):
        yield NO_TRUTH
    if path.kind in ("source", "recorded"):
        return
    in_points = not hasattr(path, "start")
    key, start = ("path.points", path.points[0]) if in_points else ("path.start", path.start)
    # Its heading is ignored.
    extent = 0.0 if user.mesh is not None else 0.5 * min(user.length, user.width)
    least, distance = _NEAREST_START + extent, math.hypot(*start)
    if distance < least:
        yield f"{key}: must be at least {least:.2g} m from the camera, got {distance:.2g} m"
