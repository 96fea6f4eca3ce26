"""What a sweep gives, run by run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stixel_cli.engine.errors import StageFailure
from stixel_cli.sweeps.graphs import PlannedRun
from stixel_cli.sweeps.statistics import Statistic

DONE, FAILED, SKIPPED, MISSING = "done", "failed", "skipped", "missing"
"""What becomes of a run: `skipped` is one that needs what failed in another, `missing` one that
was not come to."""


@dataclass(frozen=True)
class RunOutcome:
    """What became of a run.

    Attributes:
        planned: the run.
        status: `done`, `failed`, `skipped` or `missing`.
        metrics: of its scores, by name; empty unless it is done.
        failure: why it is not there.
    """

    planned: PlannedRun
    status: str
    metrics: Mapping[str, float | int | None] = field(default_factory=dict)
    failure: StageFailure | None = None


@dataclass(frozen=True)
class IncompleteSetting:
    """A setting that has no statistics, for not all of its runs are done.

    Attributes:
        setting: keys that differ between runs, without the seed, with their values as typed.
        runs: how many it has.
        done: how many of them are done.
    """

    setting: Mapping[str, str]
    runs: int
    done: int

    @property
    def label(self) -> str:
        """`key=value …`, and how many runs are done."""
        named = " ".join(f"{key}={value}" for key, value in self.setting.items())
        return f"{named or 'the one setting'} ({self.done} of {self.runs} runs done)"


@dataclass(frozen=True)
class SweepResult:
    """What a sweep gave.

    Attributes:
        folder: where it was written, None if nowhere.
        runs: one a run, in the order of their indices.
        records: the rows of `runs.csv`, plain values; what differs between runs is of its own
            type here, as in the configuration.
        statistics: over the seeds of each setting all of whose runs are done.
        incomplete: the other settings, which have none.
        computed: how many nodes this call computed.
        cached: how many of those that the runs need were in the store before.
    """

    folder: Path | None
    runs: tuple[RunOutcome, ...]
    records: list[dict[str, Any]]
    statistics: list[Statistic]
    incomplete: tuple[IncompleteSetting, ...]
    computed: int
    cached: int

    @property
    def complete(self) -> bool:
        """Whether every run is done."""
        return all(run.status == DONE for run in self.runs)

    def count(self, status: str) -> int:
        """How many runs have a status."""
        return sum(run.status == status for run in self.runs)
