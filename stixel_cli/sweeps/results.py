"""The result of a sweep: its runs, and statistics of the complete settings."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.report.statistics import Statistic, summarise
from stixel_cli.results.result import DONE, RunResult

if TYPE_CHECKING:
    import pandas


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
class SweepResult:
    """A sweep with its results, computed or read.

    Attributes:
        folder: its folder; None if nothing was written.
        runs: one entry for each run, in the order of their indices.
        computed: number of nodes that this call computed.
        cached: number of needed nodes that were in the store before.
    """

    folder: Path | None
    runs: tuple[RunResult, ...]
    computed: int = 0
    cached: int = 0

    @cached_property
    def by_setting(self) -> dict[tuple[tuple[str, str], ...], list[RunResult]]:
        """The runs of each setting, its (key, value as typed) pairs without the seed."""
        found: dict[tuple, list[RunResult]] = {}
        for run in self.runs:
            found.setdefault(tuple(run.setting.items()), []).append(run)
        return found

    @cached_property
    def complete_runs(self) -> list[RunResult]:
        """The runs of complete settings, those all of whose runs are done."""
        settings = [runs for runs in self.by_setting.values() if _done(runs) == len(runs)]
        return [run for runs in settings for run in runs]

    @cached_property
    def incomplete(self) -> tuple[IncompleteSetting, ...]:
        """The other settings."""
        counts = ((setting, len(runs), _done(runs)) for setting, runs in self.by_setting.items())
        return tuple(IncompleteSetting(dict(s), n, done) for s, n, done in counts if done < n)

    @cached_property
    def statistics(self) -> list[Statistic]:
        """Statistics of the complete settings over their seeds: missing seeds would bias others."""
        runs = self.complete_runs
        return summarise([run.setting for run in runs], [run.metrics for run in runs])

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of `runs.csv`."""
        return [self._row(run) for run in self.runs]

    @property
    def records(self) -> list[dict[str, Any]]:
        """The rows with values of keys that differ between runs in their own types."""
        return [self._row(run) | run.planned.values for run in self.runs]

    def _row(self, run: RunResult) -> dict[str, Any]:
        failure = run.failure
        at = "failed" if failure is not None else "runs" if run.status == DONE else None
        return {
            "run": run.index,
            "status": run.status,
            **run.setting,
            "seed": run.seed,
            "overrides": " ".join(map(shlex.quote, run.overrides)),
            "folder": None if at is None or self.folder is None else f"{at}/{run.index:04d}",
            "failed_stage": None if failure is None else failure.stage,
            "error": None if failure is None else " ".join(str(failure).split()),
            **run.metrics,
        }

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
        return _done(self.runs) == len(self.runs)

    def count(self, status: str) -> int:
        """Number of runs with a status."""
        return sum(run.status == status for run in self.runs)


def _done(runs: Sequence[RunResult]) -> int:
    return sum(run.status == DONE for run in runs)
