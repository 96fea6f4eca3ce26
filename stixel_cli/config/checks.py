"""Checks of conditions between several keys and groups, before anything is computed."""

import dataclasses
import inspect
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from stixel_cli.config.schema import Configuration
from stixel_cli.errors import ConfigurationError
from stixel_cli.measurements.disturbance_parameters import check_dropout
from stixel_cli.measurements.file import FileParameters
from stixel_cli.scene.classes import ROAD_USER_CLASSES
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.start import NO_TRUTH, TruthStart

SAME_SIZE = 0.02
"""The prior's length and width may differ by this share from a box of the user's file."""

_NEAREST_START = 1.0
"""Minimum distance between the camera and the target at its start, m."""


def check(configuration: Configuration) -> None:
    """Refuse a configuration whose keys are valid one by one but contradict each other.

    Raises:
        ConfigurationError: in one line that names the key.
    """
    try:
        _check_source(configuration)
        for field in dataclasses.fields(configuration):
            part = getattr(configuration, field.name)
            if hasattr(part, "check"):
                others = _groups_of(type(part))
                part.check(**{group: getattr(configuration, group) for group in others})
        _check_prior(configuration)
        check_dropout(configuration.measurement)
        _check_start(configuration)
    except ValueError as fault:
        raise ConfigurationError(" ".join(str(fault).split())) from None


@cache
def _groups_of(part: type) -> tuple[str, ...]:
    """The other groups that the check of a part needs: the names of its arguments."""
    return tuple(inspect.signature(part.check).parameters)[1:]


def _check_source(configuration: Configuration) -> None:
    """Refuse a recorded path with rendered images, and the other way round."""
    recorded = configuration.source.kind != "rendered"
    if recorded and configuration.measurement.kind != "stixels":
        raise ValueError(
            f"measurement: {configuration.measurement.kind} is of the rendered scene; "
            f"with source={configuration.source.kind} only measurement=stixels"
        )
    replayed = configuration.path.kind == "recorded"
    for group in ("path", "ego"):
        kind = getattr(configuration, group).kind
        if kind == "source" and not recorded and not (replayed and group == "ego"):
            raise ValueError(f"{group}: source needs a recording, got source=rendered")
        if recorded and kind not in ("source", "parked"):
            raise ValueError(
                f"{group}: {kind} is of the rendered scene; source={configuration.source.kind} "
                "has its own"
            )


def _check_prior(configuration: Configuration) -> None:
    """Refuse a class or an outline that is not in its file, or is not of the prior's size."""
    prior = configuration.prior
    if prior.class_file is not None:
        if not prior.class_file.endswith(".json"):
            known = ", ".join((*ROAD_USER_CLASSES, "unknown"))
            raise ValueError(
                f"prior.road_user: {prior.class_file!r} is not known: must be one of {known}, or "
                "the .json file of stixel learn-shape"
            )
        from stixel_cli.tracking.contour.user_shape import read_class

        known, kind = read_class(Path(prior.class_file)), configuration.measurement.kind
        sensor = kind if kind in ("stixels", "lidar") else "outline"
        if sensor not in known:
            raise ValueError(
                f"prior.road_user: {prior.class_file} has no visible shape for measurement={kind}: "
                f"learn it, stixel learn-shape --sensor {sensor}"
            )
        _check_size("road_user", [0.001 * one for one in known["size"]], prior)
    if prior.outline is not None:
        from stixel_cli.tracking.contour.user_shape import read_outline

        if prior.road_user == "unknown":
            raise ValueError("prior.outline: needs a class: give prior.road_user, too")
        vertices = read_outline(Path(prior.outline))
        _check_size("outline", (vertices.max(axis=0) - vertices.min(axis=0)).tolist(), prior)


def _check_size(key: str, size: Sequence[float], prior: PriorShape) -> None:
    length, width = size
    if abs(length / prior.length - 1.0) > SAME_SIZE or abs(width / prior.width - 1.0) > SAME_SIZE:
        raise ValueError(
            f"prior.{key}: the file's box is {length:.3g} × {width:.3g} m, the prior's "
            f"{prior.length:.3g} × {prior.width:.3g} m: give prior.length={length:.3g} "
            f"prior.width={width:.3g}"
        )


def _check_start(configuration: Configuration) -> None:
    """Refuse a start from a truth that is missing, and a target that starts at the camera."""
    measurement, path, user = configuration.measurement, configuration.path, configuration.road_user
    without_truth = isinstance(measurement, FileParameters) and measurement.truth is None
    if without_truth and measurement.path and isinstance(configuration.start, TruthStart):
        raise ValueError(NO_TRUTH)
    if path.kind in ("source", "recorded"):
        return
    key, start = (
        ("path.start", path.start) if hasattr(path, "start") else ("path.points", path.points[0])
    )
    # Its heading is ignored.
    extent = 0.0 if user.mesh is not None else 0.5 * min(user.length, user.width)
    distance = math.hypot(*start)
    if distance - extent < _NEAREST_START:
        raise ValueError(
            f"{key}: must be at least {_NEAREST_START + extent:.2g} m from the camera, "
            f"got {distance:.2g} m"
        )
