"""The result of a sweep: the outcome of each run, and statistics of the complete settings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.engine.errors import StageFailure
from stixel_cli.sweeps.graphs import PlannedRun
from stixel_cli.sweeps.statistics import Statistic, summarise

if TYPE_CHECKING:
    import pandas

DONE, FAILED, SKIPPED, MISSING = "done", "failed", "skipped", "missing"
"""Status of a run; `skipped`: a node failed in another run; `missing`: not run yet."""


@dataclass(frozen=True)
class RunOutcome:
    """The outcome of a run.

    Attributes:
        planned: the run.
        status: `done`, `failed`, `skipped` or `missing`.
        metrics: of its scores, by name; empty unless it is done.
        failure: of a run that failed or was skipped.
    """

    planned: PlannedRun
    status: str
    metrics: Mapping[str, float | int | None] = field(default_factory=dict)
    failure: StageFailure | None = None


@dataclass(frozen=True)
class IncompleteSetting:
    """A setting without statistics, because some of its runs are not done.

    Attributes:
        setting: keys that differ between runs, without the seed, with their values as typed.
        runs: number of its runs.
        done: number of its runs that are done.
    """

    setting: Mapping[str, str]
    runs: int
    done: int

    @property
    def label(self) -> str:
        """`key=value …`, and the number of runs that are done."""
        named = " ".join(f"{key}={value}" for key, value in self.setting.items())
        return f"{named or 'the one setting'} ({self.done} of {self.runs} runs done)"


@dataclass(frozen=True)
class Summary:
    """The settings of a sweep, divided into complete and incomplete ones.

    Attributes:
        complete: the runs of complete settings, those all of whose runs are done.
        statistics: of the complete settings, over their seeds.
        incomplete: the other settings.
    """

    complete: tuple[RunOutcome, ...]
    statistics: list[Statistic]
    incomplete: tuple[IncompleteSetting, ...]


def summary_of(runs: Sequence[RunOutcome]) -> Summary:
    """The summary of runs. Incomplete settings get no statistics: missing seeds would bias them."""
    groups: dict[tuple, list[RunOutcome]] = {}
    for run in runs:
        groups.setdefault(tuple(run.planned.run.setting.items()), []).append(run)
    complete, incomplete = [], []
    for setting, members in groups.items():
        done = sum(run.status == DONE for run in members)
        if done == len(members):
            complete += members
        else:
            incomplete.append(IncompleteSetting(dict(setting), len(members), done))
    statistics = summarise(
        [run.planned.run.setting for run in complete], [run.metrics for run in complete]
    )
    return Summary(tuple(complete), statistics, tuple(incomplete))


@dataclass(frozen=True)
class SweepResult:
    """The result of a sweep.

    Attributes:
        folder: its folder; None if nothing was written.
        runs: one entry for each run, in the order of their indices.
        records: the rows of `runs.csv` as plain values; values of keys that differ between runs
            have their own type here, as in the configuration.
        statistics: of the settings all of whose runs are done, over their seeds.
        incomplete: the other settings.
        computed: number of nodes that this call computed.
        cached: number of needed nodes that were in the store before.
    """

    folder: Path | None
    runs: tuple[RunOutcome, ...]
    records: list[dict[str, Any]]
    statistics: list[Statistic]
    incomplete: tuple[IncompleteSetting, ...]
    computed: int
    cached: int

    def __repr__(self) -> str:
        """The numbers of runs and nodes, and the folder, in one line."""
        runs = f"{self.count(DONE)} of {len(self.runs)} runs done"
        nodes = f"{self.computed} nodes computed, {self.cached} cached"
        return f"<SweepResult {runs}; {nodes} {self.folder or ''}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the table of the runs."""
        return self.frame()._repr_html_()

    def frame(self) -> "pandas.DataFrame":
        """The records as a table: one row per run, with its settings, status and metrics."""
        import pandas

        return pandas.DataFrame(self.records)

    @property
    def complete(self) -> bool:
        """Whether every run is done."""
        return all(run.status == DONE for run in self.runs)

    def count(self, status: str) -> int:
        """Number of runs with a status."""
        return sum(run.status == status for run in self.runs)
