"""What a sweep gives, point by point."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stixel_cli.engine.errors import StageFailure
from stixel_cli.sweeps.graphs import PlannedPoint
from stixel_cli.sweeps.statistics import Statistic

DONE, FAILED, SKIPPED, MISSING = "done", "failed", "skipped", "missing"
"""What becomes of a point: `skipped` is one that needs what failed in another, `missing` one that
was not come to."""


@dataclass(frozen=True)
class PointResult:
    """What became of a point.

    Attributes:
        planned: the point.
        status: `done`, `failed`, `skipped` or `missing`.
        metrics: of its scores, by name; empty unless it is done.
        failure: why it is not there.
    """

    planned: PlannedPoint
    status: str
    metrics: Mapping[str, float | int | None] = field(default_factory=dict)
    failure: StageFailure | None = None


@dataclass(frozen=True)
class IncompleteSetting:
    """A setting that has no statistics, for not all of its points are done.

    Attributes:
        setting: keys that differ between points, without the seed, with their values as typed.
        points: how many it has.
        done: how many of them are done.
    """

    setting: Mapping[str, str]
    points: int
    done: int

    @property
    def label(self) -> str:
        """`key=value …`, and how many points are done."""
        named = " ".join(f"{key}={value}" for key, value in self.setting.items())
        return f"{named or 'the one setting'} ({self.done} of {self.points} points done)"


@dataclass(frozen=True)
class SweepResult:
    """What a sweep gave.

    Attributes:
        folder: where it was written, None if nowhere.
        points: one a point, in the order of their indices.
        records: the rows of `runs.csv`, plain values; what differs between points is of its own
            type here, as in the configuration.
        statistics: over the seeds of each setting all of whose points are done.
        incomplete: the other settings, which have none.
        computed: how many nodes this call computed.
        cached: how many of those that the points need were in the store before.
    """

    folder: Path | None
    points: tuple[PointResult, ...]
    records: list[dict[str, Any]]
    statistics: list[Statistic]
    incomplete: tuple[IncompleteSetting, ...]
    computed: int
    cached: int

    @property
    def complete(self) -> bool:
        """Whether every point is done."""
        return all(point.status == DONE for point in self.points)

    def count(self, status: str) -> int:
        """How many points have a status."""
        return sum(point.status == status for point in self.points)
