"""Parameters that every kind of measurement has: scans without points, and clutter."""

from dataclasses import replace
from typing import Annotated, TypeVar

from annotated_types import Ge, Le

from stixel_cli.parameters import parameters

Seconds = Annotated[float, Ge(0), Le(1e6)]

Measurement = TypeVar("Measurement", bound="Disturbance")


@parameters(kw_only=True)
class Disturbance:
    """Disturbances of the scans of any sensor.

    Attributes:
        dropout: [first, last] time since the first scan, s: the scans between are empty, as while
            another object hides the target; null: no scan is emptied.
        clutter_rate: mean number of clutter points per scan.
    """

    dropout: tuple[Seconds, Seconds] | None
    clutter_rate: Annotated[float, Ge(0), Le(1000)]


def check_dropout(measurement: Disturbance) -> None:
    """Raise ValueError if the dropout ends before it begins."""
    dropout = measurement.dropout
    if dropout is not None and dropout[1] < dropout[0]:
        raise ValueError(
            f"measurement.dropout: the second must be at least the first, got {list(dropout)}"
        )


def is_disturbed(measurement: Disturbance) -> bool:
    """Whether the scans are changed at all."""
    return measurement.dropout is not None or measurement.clutter_rate > 0.0


def undisturbed(measurement: Measurement) -> Measurement:
    """The same measurement without dropout and clutter, as its own stages see it."""
    return replace(measurement, dropout=None, clutter_rate=0.0)
