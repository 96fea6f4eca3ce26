"""A tracker of the user's own."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from stixel_cli.border.own_code import further_arguments, loaded
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState, Track, check_finite

GIVEN = 3
"""Arguments of the function before its parameters: scans, initial, prior."""


def track(
    scans: Scans,
    initial: InitialState,
    prior: PriorShape,
    function: str,
    parameters: Mapping[str, Any],
) -> Track:
    """The track that the user's function returns.

    It is called as `function(scans, initial, prior, …)`, with its parameters as one dataclass or as
    keyword arguments, see `own_code.further_arguments`.

    Raises:
        ValueError: if the result is not a track of these scans.
    """
    own = loaded(function)
    result = own(scans, initial, prior, **further_arguments(own, GIVEN, parameters))
    check_track(result, scans, function)
    return result


def check_track(result: Any, scans: Scans, name: str) -> None:
    """Raise ValueError, in one line, unless `result` is a track of `scans`; `name` returned it."""
    if not isinstance(result, Track):
        raise ValueError(f"{name}: must return a Track, returned a {type(result).__name__}")
    count = len(scans)
    contours = np.shape(result.contours_world)
    corners = contours[1] if len(contours) == 3 else "M"
    states = np.shape(result.means)[-1:] or ("D",)
    shapes = {
        "times": (count,),
        "means": (count, *states),
        "covariances": (count, *states, *states),
        "contours_world": (count, corners, 2),
        "contour_std": (count, corners),
        "used_offsets": (count + 1,),
        "nis": (count,),
        "nis_degrees_of_freedom": (count,),
    }
    for field, shape in shapes.items():
        got = np.shape(getattr(result, field))
        if got != shape:
            right = ", ".join(map(str, shape))
            raise ValueError(f"{name}: {field} of its track must have shape ({right}), got {got}")
    used, offsets = np.asarray(result.used_points), np.asarray(result.used_offsets)
    whole = offsets.dtype.kind in "iu" and used.dtype.kind in "iu"
    steps = np.diff(offsets, prepend=0, append=len(used)) if whole else offsets
    rising = whole and steps[0] == steps[-1] == 0 and steps.min() >= 0
    rules = {
        "must have six states or more and three corners or more": states[0] >= 6 and corners >= 3,
        "must have the times of the scans": np.array_equal(result.times, scans.times),
        "must have whole numbers as used_offsets and used_points": whole,
        f"must have used_offsets that rise from 0 to {len(used)}": rising,
        "must have rows of the scans' points as used_points": whole
        and np.all((used >= 0) & (used < len(scans.points_world))),
    }
    for rule, holds in rules.items():
        if not holds:
            raise ValueError(f"{name}: its track {rule}")
    check_finite(result, name)
