"""Compute the runs of a sweep and write its folder, without a command line."""

import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from stixel_cli.engine.errors import MissingEntry, StageFailure
from stixel_cli.engine.execute import execute
from stixel_cli.engine.plan import Durations
from stixel_cli.engine.remembered import remembered
from stixel_cli.engine.store import Store
from stixel_cli.errors import UserError
from stixel_cli.experiment.kernels import uncompiled
from stixel_cli.experiment.run import one_line_errors
from stixel_cli.sweeps.folder import FIGURES, RUNS, SUMMARIES, TABLE, SweepFolder
from stixel_cli.sweeps.graphs import PlannedRun, SweepPlan
from stixel_cli.sweeps.progress import SweepProgress
from stixel_cli.sweeps.results import (
    DONE,
    FAILED,
    MISSING,
    SKIPPED,
    RunOutcome,
    Summary,
    SweepResult,
    summary_of,
)
from stixel_cli.sweeps.resume import resume_command
from stixel_cli.sweeps.run_files import RunLineages, failure_files, remove_unused_code, run_files


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
    """Compute the missing nodes of a sweep and write its results. A failing run stops no other.

    Args:
        plan: the runs, in the order of execution.
        axes: the keys of each axis.
        store: of the results.
        folder: of the sweep, with its `sweep.yaml`; None to write nothing.
        notes: entries about the sweep and the machine for the manifest of every run.
        visible: show progress on stderr.
        label: prefix of the progress.

    Raises:
        SweepInterrupted: by Ctrl-C; the tables in the folder show which runs are done.
        UserError: if the cache or the folder cannot be written, or there are no workers.
    """
    sweep = _Sweep(plan, store, None if folder is None else SweepFolder(folder), notes or {})
    resume = "" if folder is None else f"; resume with: {resume_command(folder)}"
    try:
        with one_line_errors():
            sweep.take_finished()
            sweep.compute(visible, label)
    except KeyboardInterrupt:
        done = len(sweep.metrics)
        sweep.leave()
        raise SweepInterrupted(
            f"interrupted: {done} of {len(plan.runs)} runs are done; computed results are "
            f"kept{resume}"
        ) from None
    except UserError as error:
        sweep.leave()
        if folder is None:
            raise
        raise type(error)(f"{error}{resume}") from error
    return sweep.finish(axes)


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
        """Index of the first run that needs each failed node."""
        self.skipped: set[int] = set()
        self.computed = 0
        self.cached = set(plan.needed).difference(plan.missing)
        """Nodes in the store that this call did not compute."""
        self.lineages = None if folder is None else RunLineages(store, folder)

    def take_finished(self) -> None:
        """Take the runs whose folder is complete, or whose results are all in the store."""
        if self.folder is not None:
            self.folder.remove([*SUMMARIES, FIGURES])
            self.folder.remove_unfinished()
        missing = set(self.plan.missing)
        for planned in self.plan.runs:
            index = planned.run.index
            if self.folder is not None:
                stored = self.folder.stored(index, planned.targets)
                if stored is not None and missing.isdisjoint(planned.store_only):
                    self.metrics[index] = stored
                    continue
            if missing.isdisjoint(planned.targets):
                # A damaged entry is moved away; the run is computed with the others.
                with suppress(MissingEntry):
                    self.take(planned, {})

    def compute(self, visible: bool, label: str) -> None:
        """Compute the missing nodes of the other runs."""
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
            uncompiled() if visible else (),
            self._prepare,
        )
        execution = execute(
            self.plan.graph,
            list(dict.fromkeys(target for one in waiting for target in one.targets)),
            self.store,
            executor=executor,
            progress=progress,
            keep_going=True,
        )
        self.computed = sum(r.status == "computed" for r in execution.records.values())
        self.cached.update(execution.records)
        self.cached -= {key for key, r in execution.records.items() if r.status != "cached"}
        for planned in waiting:
            if planned.run.index in self.metrics:
                continue
            failure = execution.failure_of(planned.targets)
            if failure is None:
                self.take(planned, progress.node_seconds)
            else:
                self.note_failure(planned, *failure)

    def _prepare(self) -> None:
        """Import the modules of the statistics and the figures: as long as a few runs take."""
        import_module("scipy.special")
        if self.folder is not None:
            import_module("stixel_cli.sweeps.figures")

    def take(self, planned: PlannedRun, seconds: Mapping[str, float]) -> None:
        """Load the scores of a complete run, and write its folder."""
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
        """Record the failure of a run, here and in the folder."""
        index = planned.run.index
        first = self.failed_nodes.setdefault(node, index)
        self.failures[index] = failure
        if first != index:
            self.skipped.add(index)
        if self.folder is not None:
            self.folder.write_failure(index, failure_files(planned.run, node, failure, first))

    def finish(self, axes: Sequence[Sequence[str]]) -> SweepResult:
        """Write the tables, and the statistics and figures of complete settings."""
        runs, records, summary = self.write_tables()
        if self.folder is not None:
            if summary.statistics:
                self._write_figures(summary, axes)
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
            cached=len(self.cached),
        )

    def leave(self) -> None:
        """Write the tables of an interrupted sweep; drawing figures would delay Ctrl-C."""
        # The runs in the folder count, even if its tables cannot be written.
        with suppress(UserError):
            self.write_tables()

    def write_tables(self) -> tuple[tuple[RunOutcome, ...], list[dict[str, Any]], Summary]:
        """Write `runs.csv` and the summaries; return the outcomes, the rows and the summary."""
        from stixel_cli.sweeps.tables import csv_text, summary_files

        in_order = sorted(self.plan.runs, key=lambda one: one.run.index)
        runs = tuple(self._outcome(one) for one in in_order)
        records = [self._record(run) for run in runs]
        summary = summary_of(runs)
        if self.folder is not None:
            columns = dict.fromkeys(name for record in records for name in record)
            self.folder.write_table(TABLE, csv_text(list(columns), records))
            if summary.statistics:
                title = str(self.notes.get("sweep", self.folder.path.name))
                files = summary_files(summary.statistics, summary.incomplete, title)
                for name, text in files.items():
                    self.folder.write_table(name, text)
        return runs, records, summary

    def _write_figures(self, summary: Summary, axes: Sequence[Sequence[str]]) -> None:
        settings = [run.planned.run.setting for run in summary.complete]
        metrics = [run.metrics for run in summary.complete]
        left_out = len(summary.incomplete)

        def draw() -> dict[str, bytes]:
            from stixel_cli.sweeps.figures import axis_figures

            return axis_figures(settings, metrics, axes, left_out)

        content = [
            [[list(of_run.items()) for of_run in given] for given in (settings, metrics)],
            [list(keys) for keys in axes],
            left_out,
        ]
        code = ["stixel_cli.sweeps.figures"]
        figures = remembered(self.store, "sweep_figures", code, content, draw)
        if figures:
            self.folder.write_figures(figures)

    def _record(self, result: RunOutcome) -> dict[str, Any]:
        run, failure = result.planned.run, result.failure
        at = FAILED if failure is not None else RUNS if result.status == DONE else None
        return {
            "run": run.index,
            "status": result.status,
            **run.setting,
            "seed": run.seed,
            "overrides": " ".join(map(shlex.quote, run.overrides)),
            "folder": None if at is None or self.folder is None else f"{at}/{run.index:04d}",
            "failed_stage": None if failure is None else failure.stage,
            "error": None if failure is None else " ".join(str(failure).split()),
            **result.metrics,
        }

    def _outcome(self, planned: PlannedRun) -> RunOutcome:
        index = planned.run.index
        if index in self.metrics:
            return RunOutcome(planned, DONE, self.metrics[index])
        if index in self.failures:
            status = SKIPPED if index in self.skipped else FAILED
            return RunOutcome(planned, status, failure=self.failures[index])
        return RunOutcome(planned, MISSING)

    def _known_seconds(self) -> dict[str, float]:
        durations = Durations(self.store.folder)
        graph = self.plan.graph
        firsts = {name: graph.nodes[keys[0]] for name, keys in graph.stages.items() if keys}
        estimates = {name: durations.estimate([node]) for name, node in firsts.items()}
        return {name: seconds for name, seconds in estimates.items() if seconds is not None}
