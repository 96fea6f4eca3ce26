"""Checks of conditions between several keys and groups, before anything is computed."""

import dataclasses
import inspect
import math
from functools import cache

from stixel_cli.config.schema import Configuration
from stixel_cli.errors import ConfigurationError
from stixel_cli.measurements.disturbance_parameters import check_dropout
from stixel_cli.measurements.file import FileParameters
from stixel_cli.tracking.start import NO_TRUTH, TruthStart

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
