"""The result of a sweep: its runs, statistics of the complete settings, and their tables."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.errors import counted
from stixel_cli.evaluation.metric_table import metric, over_runs
from stixel_cli.report.blocks import Cell, Table
from stixel_cli.report.statistics import Repetition, Statistic, consistent_bounds, summarise
from stixel_cli.report.tables import csv_text, ends, markdown_table, shown_table, table_latex
from stixel_cli.results.reader import listed
from stixel_cli.results.result import DONE, RunResult
from stixel_cli.sweeps.design import NOT_GIVEN
from stixel_cli.sweeps.folder import SUMMARIES
from stixel_cli.sweeps.over import (
    OVER_SEEDS,
    Axes,
    Setting,
    behind_best,
    marks,
    over_axes,
    setting_of,
    unit_of,
)

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class SweepResult:
    """A sweep with its results, computed or read.

    Attributes:
        folder: its folder; None if nothing was written.
        runs: one entry for each run, in the order of their indices.
        computed: number of nodes that this call computed.
        cached: number of needed nodes that were in the store before.
        axes: the keys of each axis.
        over: the axes that means are over, see `sweeps.over`.
    """

    folder: Path | None
    runs: tuple[RunResult, ...]
    computed: int = 0
    cached: int = 0
    axes: Axes = ()
    over: Axes = OVER_SEEDS

    @cached_property
    def by_setting(self) -> dict[Setting, list[RunResult]]:
        """The runs of each setting."""
        found: dict[Setting, list[RunResult]] = {}
        for run in self.runs:
            found.setdefault(setting_of(run, self.over), []).append(run)
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
    def complete_settings(self) -> dict[Setting, list[RunResult]]:
        """The runs of the other settings: with missing runs, statistics would be biased."""
        every = self.by_setting.items()
        return {s: runs for s, runs in every if all(run.status == DONE for run in runs)}

    @property
    def repetitions(self) -> list[Repetition]:
        """The runs of complete settings."""
        return [
            (setting, unit_of(run, self.over), run.metrics)
            for setting, runs in self.complete_settings.items()
            for run in runs
        ]

    @cached_property
    def statistics(self) -> dict[Setting, dict[str, Statistic]]:
        """Statistics over the axes `over` of each complete setting, by metric."""
        return summarise(self.repetitions)

    @cached_property
    def behind(self) -> dict[str, dict[Setting, Statistic]]:
        """Metric to each complete setting's difference from the best one, see `behind_best`."""
        complete = self.complete_settings
        known = dict.fromkeys(n for runs in complete.values() for r in runs for n in r.metrics)
        return {over_runs(name): behind_best(name, complete, self.over) for name in known}

    @property
    def units(self) -> str:
        """What a mean is over, in words: "seeds", or the keys."""
        if self.over == OVER_SEEDS:
            return "seeds"
        return f"combinations of {listed([key for axis in self.over for key in axis])}"

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
            row | {k: run.composition.value(k) for k, v in run.setting.items() if v != NOT_GIVEN}
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

    def frame(self, over: str | Sequence[str] = ()) -> "pandas.DataFrame":
        """The records as a table: one row per run, with its settings, status and metrics.

        With `over`, such as "seed,path": one row per setting and metric, with its mean over these
        axes, its interval, and the paired difference from the best setting, see `summary_records`.
        """
        import pandas

        if not over:
            return pandas.DataFrame(self.records)
        chosen = replace(self, over=over_axes(over, self.axes))
        return pandas.DataFrame(summary_records(chosen))

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
    "One row per setting: n {units} with a value, their mean, standard deviation, and the 95 % "
    "interval of the mean (Student's t on a scale on which all values are possible; for a share of "
    "runs Wilson's; none below n = 4). The column 'minus the best' is the mean of the paired "
    "differences from the best setting; its intervals hold together (Bonferroni). 'best' is a "
    "setting that all others are behind, 'tied' those that are not shown to be behind. The columns "
    "'consistent' of a NEES are the ends of the 95 % interval of its mean for a consistent filter "
    "(χ²; each run counts as one scan, because the errors of its scans are alike)."
)


def summary_records(result: SweepResult) -> list[dict[str, Any]]:
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
            "minus_best": behind.mean,
            "minus_best_low": behind.low,
            "minus_best_high": behind.high,
            "mark": marks(result.behind[name]).get(setting, ""),
            **dict(zip(ends, consistent_bounds(one), strict=True)),
        }
        for setting, by_metric in result.statistics.items()
        for name, one in by_metric.items()
        for behind in [result.behind[name].get(setting, Statistic())]
    ]


def summary_files(result: SweepResult, title: str) -> dict[str, str]:
    """The summaries of a sweep by file name; `title` is its command line.

    The CSV file has one row for each setting and metric, and one for each incomplete setting; the
    others have one table for each metric. LaTeX needs no package for them.
    """
    statistics, incomplete = result.statistics, result.incomplete
    records = [record | {"status": "complete"} for record in summary_records(result)]
    columns = list(records[0]) if records else []
    records += [one["setting"] | {"n": one["done"], "status": "incomplete"} for one in incomplete]
    explanation = _EXPLANATION.format(units=result.units)
    markdown = [f"# {title}", "", explanation, ""]
    latex = [f"% {' '.join(title.split())}", f"% {explanation}"]
    if incomplete:
        refusal = f"No statistics yet of {counted(len(incomplete), 'incomplete setting')}:"
        labels = list(map(incomplete_label, incomplete))
        markdown += [refusal, "", *(f"- {label}" for label in labels), ""]
        latex += [f"% {refusal}", *(f"%   {' '.join(label.split())}" for label in labels)]
    known = (name for found in statistics.values() for name, one in found.items() if one.n > 0)
    for name in dict.fromkeys(known):
        table = replace(Table.of(name, _cells(name, result)), caption=heading(name))
        markdown += [f"## {table.caption}", "", *markdown_table(*shown_table(table)), ""]
        latex.append(table_latex(table))
    texts = (csv_text(columns, records), "\n".join(markdown), "\n".join(latex))
    return dict(zip(SUMMARIES, texts, strict=True))


def heading(name: str) -> str:
    """Label of a metric, with its unit."""
    shown = metric(name)
    return f"{shown.label} ({shown.unit})" if shown.unit else shown.label


def _cells(name: str, result: SweepResult) -> Iterator[dict[str, Cell]]:
    behind = result.behind[name]
    marked, bounded = marks(behind), metric(name).degrees_of_freedom is not None
    for setting, row in ((setting, found[name]) for setting, found in result.statistics.items()):
        cells = dict(setting) | {"n": row.n} | ends("mean", row) | {"standard deviation": row.std}
        if behind:
            cells |= ends("minus the best", behind.get(setting)) | {"mark": marked.get(setting, "")}
        if bounded:
            low, high = consistent_bounds(row)
            cells |= {"consistent from": low, "consistent to": high}
        yield cells
    for one in result.incomplete:
        yield one["setting"] | {"n": one["done"], "mean": "incomplete"}
