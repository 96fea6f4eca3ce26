"""A sweep from its runs to its folder, without a command line."""

import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from stixel_cli.engine.errors import MissingEntry, StageFailure
from stixel_cli.engine.execute import execute
from stixel_cli.engine.plan import Durations
from stixel_cli.engine.store import Store
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import one_line_errors
from stixel_cli.sweeps.folder import FIGURES, TABLE, SweepFolder
from stixel_cli.sweeps.graphs import PlannedRun, SweepPlan
from stixel_cli.sweeps.lineages import RunLineages, remove_unused_code
from stixel_cli.sweeps.progress import SweepProgress
from stixel_cli.sweeps.results import DONE, FAILED, MISSING, SKIPPED, RunOutcome, SweepResult
from stixel_cli.sweeps.resume import resume_words
from stixel_cli.sweeps.run_files import failure_files, run_files
from stixel_cli.sweeps.summary import SUMMARIES, summary_of, write_figures, write_tables


class SweepInterrupted(UserError):
    """Ctrl-C during a sweep."""

    exit_code = 130


def run_sweep(
    plan: SweepPlan,
    axes: Sequence[Sequence[str]],
    store: Store,
    folder: Path | None = None,
    notes: Mapping[str, Any] | None = None,
    visible: bool = True,
    label: str = "",
) -> SweepResult:
    """Compute what the runs of a sweep lack, each failing alone, and write what they give.

    Args:
        plan: the runs, in the order in which they are to run.
        axes: the keys of each axis.
        store: where results are kept.
        folder: of the sweep; it is there, with its `sweep.yaml`. None to write nothing.
        notes: what every run's manifest says of the sweep and the machine.
        visible: whether progress is shown on stderr.
        label: what stands before it.

    Raises:
        SweepInterrupted: by Ctrl-C; the folder says what is there.
        UserError: if the cache or the folder cannot be written, or there are no workers.
    """
    sweep = _Sweep(plan, store, None if folder is None else SweepFolder(folder), notes or {})
    try:
        with one_line_errors():
            sweep.take_what_is_there()
            sweep.compute(visible, label)
    except KeyboardInterrupt:
        done = len(sweep.metrics)
        again = "" if folder is None else f"; go on with: {resume_command(folder)}"
        sweep.leave()
        raise SweepInterrupted(
            f"interrupted: {done} of {len(plan.runs)} runs are done, and what was computed "
            f"is kept{again}"
        ) from None
    except UserError as error:
        sweep.leave()
        if folder is None:
            raise
        raise type(error)(f"{error}; go on with: {resume_command(folder)}") from error
    return sweep.finish(axes)


def resume_command(folder: Path) -> str:
    """The command line that goes on with a sweep."""
    return resume_words(folder)


class _Sweep:
    """The state of one sweep."""

    def __init__(
        self, plan: SweepPlan, store: Store, folder: SweepFolder | None, notes: Mapping[str, Any]
    ):
        self.plan = plan
        self.store = store
        self.folder = folder
        self.notes = notes
        self.metrics: dict[int, Mapping[str, Any]] = {}
        """Of the runs that are done, by index."""
        self.failures: dict[int, StageFailure] = {}
        self.failed_nodes: dict[str, int] = {}
        """Index of the first run that needed each node that failed."""
        self.skipped: set[int] = set()
        self.computed = 0
        self.there = set(plan.needed).difference(plan.missing)
        """Nodes that are in the store and were not computed by this call."""
        self.lineages = None if folder is None else RunLineages(store, folder)

    def take_what_is_there(self) -> None:
        """Take up the runs whose folder is complete, or whose results are all in the store."""
        if self.folder is not None:
            self.folder.remove([*SUMMARIES, FIGURES])
            self.folder.remove_unfinished()
        missing = set(self.plan.missing)
        for planned in self.plan.runs:
            index = planned.run.index
            if self.folder is not None:
                stored = self.folder.stored(index, planned.targets)
                if stored is not None and missing.isdisjoint(planned.beside):
                    self.metrics[index] = stored
                    continue
            if missing.isdisjoint(planned.targets):
                # One that turns out damaged is set aside, and computed with the rest.
                with suppress(MissingEntry):
                    self.take(planned, {})

    def compute(self, visible: bool, label: str) -> None:
        """Compute what the other runs lack."""
        waiting = [p for p in self.plan.runs if p.run.index not in self.metrics]
        if not waiting:
            return
        executor = waiting[0].run.composition.configuration.executor
        progress = SweepProgress(
            waiting,
            len(self.metrics),
            executor.workers,
            self._known_seconds(),
            self.take,
            visible,
            label,
        )
        targets = list(dict.fromkeys(target for one in waiting for target in one.targets))
        execution = execute(
            self.plan.graph,
            targets,
            self.store,
            executor=executor,
            progress=progress,
            keep_going=True,
        )
        self.computed = sum(r.status == "computed" for r in execution.records.values())
        self.there.update(execution.records)
        self.there -= {key for key, r in execution.records.items() if r.status != "cached"}
        for planned in waiting:
            if planned.run.index in self.metrics:
                continue
            failure = execution.failure_of(planned.targets)
            if failure is None:
                self.take(planned, progress.node_seconds)
            else:
                self.note_failure(planned, *failure)

    def take(self, planned: PlannedRun, seconds: Mapping[str, float]) -> None:
        """Load a run's scores, and write its folder."""
        scores = self.store.load(planned.scores)
        if self.folder is not None:
            pictures = {
                f"figures/{path}": data
                for key in planned.pictures
                for path, data in self.store.load(key).files.items()
            }
            lineage = self.lineages.text(planned)
            files = run_files(planned, scores, seconds, self.notes, lineage)
            self.folder.write_run(planned.run.index, {**files, **pictures})
        self.metrics[planned.run.index] = scores.metrics

    def note_failure(self, planned: PlannedRun, node: str, failure: StageFailure) -> None:
        """Keep in mind, and in the folder, why a run is not there."""
        index = planned.run.index
        first = self.failed_nodes.setdefault(node, index)
        self.failures[index] = failure
        if first != index:
            self.skipped.add(index)
        if self.folder is None:
            return
        self.folder.write_failure(index, failure_files(planned.run, node, failure, first))

    def finish(self, axes: Sequence[Sequence[str]]) -> SweepResult:
        """Write the tables, and of the settings that are complete the statistics and figures."""
        records = self.write_runs()
        runs = self._results()
        summary = summary_of(runs)
        if self.folder is not None:
            write_tables(self.folder, summary, self._title(self.folder))
            write_figures(self.folder, summary, axes)
            remove_unused_code(self.folder)
        return SweepResult(
            folder=None if self.folder is None else self.folder.path,
            runs=runs,
            records=[
                record | one.planned.run.values for record, one in zip(records, runs, strict=True)
            ],
            statistics=summary.statistics,
            incomplete=summary.incomplete,
            computed=self.computed,
            cached=len(self.there),
        )

    def leave(self) -> None:
        """Write the tables as things stand. Figures would take longer than Ctrl-C may."""
        # What is in the folder counts, not whether its tables could be written as well.
        with suppress(UserError):
            self.write_runs()
            if self.folder is not None:
                summary = summary_of(self._results())
                write_tables(self.folder, summary, self._title(self.folder))

    def write_runs(self) -> list[dict[str, Any]]:
        """Write `runs.csv` as things stand; its rows."""
        from stixel_cli.sweeps.tables import csv_text

        records = [self._record(result) for result in self._results()]
        if self.folder is not None:
            columns = dict.fromkeys(name for record in records for name in record)
            self.folder.write_table(TABLE, csv_text(list(columns), records))
        return records

    def _record(self, result: RunOutcome) -> dict[str, Any]:
        run, failure = result.planned.run, result.failure
        at = FAILED if failure is not None else "runs" if result.status == DONE else None
        return {
            "run": run.index,
            "status": result.status,
            **{key: value for key, value in run.setting.items()},
            "seed": run.seed,
            "overrides": " ".join(map(shlex.quote, run.overrides)),
            "folder": None if at is None or self.folder is None else f"{at}/{run.index:04d}",
            "failed_stage": None if failure is None else failure.stage,
            "error": None if failure is None else " ".join(str(failure).split()),
            **result.metrics,
        }

    def _result(self, planned: PlannedRun) -> RunOutcome:
        index = planned.run.index
        if index in self.metrics:
            return RunOutcome(planned, DONE, self.metrics[index])
        if index in self.failures:
            status = SKIPPED if index in self.skipped else FAILED
            return RunOutcome(planned, status, failure=self.failures[index])
        return RunOutcome(planned, MISSING)

    def _results(self) -> tuple[RunOutcome, ...]:
        """Of every run, in the order of their indices."""
        in_order = sorted(self.plan.runs, key=lambda one: one.run.index)
        return tuple(self._result(one) for one in in_order)

    def _title(self, folder: SweepFolder) -> str:
        return str(self.notes.get("sweep", folder.path.name))

    def _known_seconds(self) -> dict[str, float]:
        durations = Durations(self.store.folder)
        graph = self.plan.graph
        firsts = {name: graph.nodes[keys[0]] for name, keys in graph.stages.items() if keys}
        estimates = {name: durations.estimate([node]) for name, node in firsts.items()}
        return {name: seconds for name, seconds in estimates.items() if seconds is not None}
