"""The result of a sweep: its runs, statistics of the complete settings, and their tables."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.evaluation.metric_table import metric
from stixel_cli.report.metrics import NO_VALUE, counted, shown_value
from stixel_cli.report.statistics import Statistic, consistent_bounds, summarise
from stixel_cli.report.tables import csv_text, latex_table, markdown_table
from stixel_cli.results.result import DONE, RunResult
from stixel_cli.sweeps.folder import SUMMARIES

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

    @property
    def keys(self) -> tuple[str, ...]:
        """Those of its axes, including the seed if it is swept."""
        return tuple(self.runs[0].planned.settings)

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

    @cached_property
    def statistics_of(self) -> dict[tuple[tuple[str, str], ...], dict[str, Statistic]]:
        """The statistics of each complete setting by metric."""
        found: dict[tuple, dict[str, Statistic]] = {}
        for one in self.statistics:
            found.setdefault(tuple(one.setting.items()), {})[one.metric] = one
        return found

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of `runs.csv`."""
        return [self._row(run) for run in self.runs]

    @property
    def records(self) -> list[dict[str, Any]]:
        """The rows with values of keys that differ between runs in their own types."""
        return [
            self._row(run) | {key: run.composition.value(key) for key in run.setting}
            for run in self.runs
        ]

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


_EXPLANATION = (
    "One row per setting: n seeds with a value, their mean, standard deviation, and the 95 % "
    "interval of the mean (Student's t; for a share of runs Wilson's; its ends can be beyond the "
    "possible values). The column 'consistent' of a NEES is the 95 % interval of its mean for a "
    "consistent filter (χ²; each run counts as one scan, because the errors of its scans are "
    "alike). Settings have the same seeds: to compare two settings, take the differences seed by "
    "seed, from runs.csv."
)


def summary_records(statistics: Sequence[Statistic]) -> list[dict[str, Any]]:
    """One record for each setting and metric, as in `summary.csv`."""
    records = []
    for one in statistics:
        low, high = consistent_bounds(one)
        records.append(
            {
                **one.setting,
                "metric": one.metric,
                "unit": metric(one.metric).unit,
                "n": one.n,
                "mean": one.mean,
                "std": one.std,
                "interval_low": one.low,
                "interval_high": one.high,
                "consistent_low": low,
                "consistent_high": high,
            }
        )
    return records


def summary_files(
    statistics: Sequence[Statistic], incomplete: Sequence[IncompleteSetting], title: str
) -> dict[str, str]:
    """The summaries of a sweep by file name; `title` is its command line.

    The CSV file has one row for each setting and metric, and one for each incomplete setting; the
    others have one table for each metric. LaTeX needs no package for them.
    """
    records = [record | {"status": "complete"} for record in summary_records(statistics)]
    columns = list(records[0]) if records else []
    records += [one.setting | {"n": one.done, "status": "incomplete"} for one in incomplete]
    markdown = [f"# {title}", "", _EXPLANATION, ""]
    latex = [f"% {' '.join(title.split())}", f"% {_EXPLANATION}"]
    if incomplete:
        refusal = f"No statistics yet of {counted(len(incomplete), 'incomplete setting')}:"
        labels = [one.label for one in incomplete]
        markdown += [refusal, "", *(f"- {label}" for label in labels), ""]
        latex += [f"% {refusal}", *(f"%   {' '.join(label.split())}" for label in labels)]
    for name in dict.fromkeys(one.metric for one in statistics if one.n > 0):
        rows = [one for one in statistics if one.metric == name]
        header, *body = _cells(rows, incomplete)
        numeric = [place >= len(rows[0].setting) for place in range(len(header))]
        markdown += [f"## {heading(name)}", "", *markdown_table(header, body, numeric), ""]
        latex += latex_table(heading(name), numeric, header, body)
    texts = (csv_text(columns, records), "\n".join(markdown), "\n".join(latex))
    return dict(zip(SUMMARIES, texts, strict=True))


def heading(name: str) -> str:
    """Label of a metric, with its unit."""
    shown = metric(name)
    return f"{shown.label} ({shown.shown_unit})" if shown.shown_unit else shown.label


def _cells(rows: Sequence[Statistic], incomplete: Sequence[IncompleteSetting]) -> list[list[str]]:
    header = [*rows[0].setting, "n", "mean", "standard deviation", "95 % interval"]
    bounded = metric(rows[0].metric).degrees_of_freedom is not None
    header += ["consistent"] if bounded else []
    cells = [header]
    for row in rows:
        ends = [(row.low, row.high), *([consistent_bounds(row)] if bounded else [])]
        numbers = [shown_value(row.metric, value) for value in (row.mean, row.std)]
        for low, high in ends:
            span = f"{shown_value(row.metric, low)} … {shown_value(row.metric, high)}"
            numbers.append(NO_VALUE if low is None else span)
        cells.append([*row.setting.values(), str(row.n), *numbers])
    rest = [NO_VALUE] * (3 if bounded else 2)
    for one in incomplete:
        cells.append([*one.setting.values(), str(one.done), "incomplete", *rest])
    return cells
