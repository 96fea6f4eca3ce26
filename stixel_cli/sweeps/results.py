"""The result of a sweep: its runs, statistics of the complete settings, and their tables."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.errors import counted
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.report.metrics import NO_VALUE, shown_value
from stixel_cli.report.statistics import Statistic, consistent_bounds, summarise
from stixel_cli.report.tables import csv_text, latex_table, markdown_table
from stixel_cli.results.result import DONE, RunResult
from stixel_cli.sweeps.folder import SUMMARIES

if TYPE_CHECKING:
    import pandas


Setting = tuple[tuple[str, str], ...]
"""The keys that differ between runs, without the seed, with their values as typed."""


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
    def by_setting(self) -> dict[Setting, list[RunResult]]:
        """The runs of each setting."""
        found: dict[Setting, list[RunResult]] = {}
        for run in self.runs:
            found.setdefault(tuple(run.setting.items()), []).append(run)
        return found

    @cached_property
    def incomplete(self) -> list[dict[str, Any]]:
        """Each `setting` with missing runs: the number of its `runs`, and of those `done`."""
        found = []
        for setting, runs in self.by_setting.items():
            done = sum(run.status == DONE for run in runs)
            if done < len(runs):
                found.append({"setting": dict(setting), "runs": len(runs), "done": done})
        return found

    @cached_property
    def complete_runs(self) -> list[RunResult]:
        """The runs of the other settings: with missing seeds, statistics would be biased."""
        complete = (r for r in self.by_setting.values() if all(run.status == DONE for run in r))
        return [run for runs in complete for run in runs]

    @cached_property
    def statistics(self) -> dict[Setting, dict[str, Statistic]]:
        """Statistics over the seeds of each complete setting, by metric."""
        return summarise((tuple(run.setting.items()), run.metrics) for run in self.complete_runs)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of `runs.csv`."""
        rows = []
        for run in self.runs:
            failure = run.failure
            at = "failed" if failure is not None else "runs" if run.status == DONE else None
            rows.append(
                {
                    "run": run.index,
                    "status": run.status,
                    **run.setting,
                    "seed": run.seed,
                    "overrides": " ".join(map(shlex.quote, run.overrides)),
                    "folder": None if None in (at, self.folder) else f"{at}/{run.index:04d}",
                    "failed_stage": None if failure is None else failure.stage,
                    "error": None if failure is None else " ".join(str(failure).split()),
                    **run.metrics,
                }
            )
        return rows

    @property
    def records(self) -> list[dict[str, Any]]:
        """The rows with values of keys that differ between runs in their own types."""
        return [
            row | {key: run.composition.value(key) for key in run.setting}
            for row, run in zip(self.rows, self.runs, strict=True)
        ]

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
        return self.count(DONE) == len(self.runs)

    def count(self, status: str) -> int:
        """Number of runs with a status."""
        return sum(run.status == status for run in self.runs)


def incomplete_label(one: Mapping[str, Any]) -> str:
    """`key=value …` of an incomplete setting, and the number of its runs that are done."""
    named = " ".join(f"{key}={value}" for key, value in one["setting"].items())
    return f"{named or 'the one setting'} ({one['done']} of {one['runs']} runs done)"


_EXPLANATION = (
    "One row per setting: n seeds with a value, their mean, standard deviation, and the 95 % "
    "interval of the mean (Student's t; for a share of runs Wilson's; its ends can be beyond the "
    "possible values). The column 'consistent' of a NEES is the 95 % interval of its mean for a "
    "consistent filter (χ²; each run counts as one scan, because the errors of its scans are "
    "alike). Settings have the same seeds: to compare two settings, take the differences seed by "
    "seed, from runs.csv."
)


def summary_records(statistics: Mapping[Setting, Mapping[str, Statistic]]) -> list[dict[str, Any]]:
    """One record for each setting and metric, as in `summary.csv`."""
    ends = ("consistent_low", "consistent_high")
    return [
        {
            **dict(setting),
            "metric": name,
            "unit": metric(name).unit,
            "n": one.n,
            "mean": one.mean,
            "std": one.std,
            "interval_low": one.low,
            "interval_high": one.high,
            **dict(zip(ends, consistent_bounds(one), strict=True)),
        }
        for setting, by_metric in statistics.items()
        for name, one in by_metric.items()
    ]


def summary_files(
    statistics: Mapping[Setting, Mapping[str, Statistic]],
    incomplete: Sequence[Mapping[str, Any]],
    title: str,
) -> dict[str, str]:
    """The summaries of a sweep by file name; `title` is its command line.

    The CSV file has one row for each setting and metric, and one for each incomplete setting; the
    others have one table for each metric. LaTeX needs no package for them.
    """
    records = [record | {"status": "complete"} for record in summary_records(statistics)]
    columns = list(records[0]) if records else []
    records += [one["setting"] | {"n": one["done"], "status": "incomplete"} for one in incomplete]
    markdown = [f"# {title}", "", _EXPLANATION, ""]
    latex = [f"% {' '.join(title.split())}", f"% {_EXPLANATION}"]
    if incomplete:
        refusal = f"No statistics yet of {counted(len(incomplete), 'incomplete setting')}:"
        labels = list(map(incomplete_label, incomplete))
        markdown += [refusal, "", *(f"- {label}" for label in labels), ""]
        latex += [f"% {refusal}", *(f"%   {' '.join(label.split())}" for label in labels)]
    known = (name for found in statistics.values() for name, one in found.items() if one.n > 0)
    for name in dict.fromkeys(known):
        rows = {setting: found[name] for setting, found in statistics.items()}
        header, *body = _cells(name, rows, incomplete)
        numeric = [place >= len(next(iter(rows))) for place in range(len(header))]
        markdown += [f"## {heading(name)}", "", *markdown_table(header, body, numeric), ""]
        latex += latex_table(heading(name), numeric, header, body)
    texts = (csv_text(columns, records), "\n".join(markdown), "\n".join(latex))
    return dict(zip(SUMMARIES, texts, strict=True))


def heading(name: str) -> str:
    """Label of a metric, with its unit."""
    shown = metric(name)
    return f"{shown.label} ({shown.shown_unit})" if shown.shown_unit else shown.label


def _cells(
    name: str, rows: Mapping[Setting, Statistic], incomplete: Sequence[Mapping[str, Any]]
) -> list[list[str]]:
    bounded = metric(name).degrees_of_freedom is not None
    header = [*dict(next(iter(rows))), "n", "mean", "standard deviation", "95 % interval"]
    cells = [header + ["consistent"] * bounded]
    for setting, row in rows.items():
        numbers = [shown_value(name, value) for value in (row.mean, row.std)]
        for low, high in [(row.low, row.high), *([consistent_bounds(row)] if bounded else [])]:
            span = f"{shown_value(name, low)} … {shown_value(name, high)}"
            numbers.append(NO_VALUE if low is None else span)
        cells.append([*dict(setting).values(), str(row.n), *numbers])
    for one in incomplete:
        rest = [NO_VALUE] * (len(cells[0]) - len(one["setting"]) - 2)
        cells.append([*one["setting"].values(), str(one["done"]), "incomplete", *rest])
    return cells
