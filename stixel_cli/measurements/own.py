"""Scans from the user's own model of a sensor."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from stixel_cli.border.own_code import OwnCode, further_arguments, loaded
from stixel_cli.measurements.parameters import Disturbance
from stixel_cli.measurements.scans import FieldOfView, Scans
from stixel_cli.parameters import parameters
from stixel_cli.scene.scenario import Scenario

GIVEN = 2
"""Arguments of the function before its parameters: scenario, seed."""


@parameters
class OwnMeasurement(OwnCode, Disturbance):
    """Scans of the user's own function."""


def own_scans(scenario: Scenario, function: str, parameters: Mapping[str, Any], seed: int) -> Scans:
    """The scans that the user's function returns.

    It is called as `function(scenario, seed, …)`, with its parameters as one dataclass or as
    keyword arguments. `randomness.generator(seed, name, k)` gives its random numbers. ValueError if
    the result is not scans of this scenario.
    """
    own = loaded(function)
    scans = own(scenario, seed, **further_arguments(own, GIVEN, parameters))
    if not isinstance(scans, Scans):
        raise ValueError(f"{function}: must return Scans, returned a {type(scans).__name__}")
    if not np.array_equal(scans.times, scenario.times):
        raise ValueError(f"{function}: the times of its scans must be those of the scenario")
    if not isinstance(scans.field_of_view, FieldOfView | None):
        raise ValueError(
            f"{function}: field_of_view of its scans must be a FieldOfView or None, "
            f"got a {type(scans.field_of_view).__name__}"
        )
    count = len(scans.points_world)
    shapes = {
        "sensor_poses_world": (len(scenario.times), 3),
        "offsets": (len(scenario.times) + 1,),
        "points_world": (count, 2),
        "covariances_world": (count, 2, 2),
    }
    for field, shape in shapes.items():
        values = np.asarray(getattr(scans, field))
        if values.shape != shape:
            raise ValueError(
                f"{function}: {field} of its scans must have shape {shape}, got {values.shape}"
            )
        if not np.isfinite(values).all():
            raise ValueError(f"{function}: {field} of its scans must be finite")
    if scans.offsets[0] != 0 or scans.offsets[-1] != count or np.any(np.diff(scans.offsets) < 0):
        raise ValueError(f"{function}: offsets of its scans must rise from 0 to {count}")
    return scans
