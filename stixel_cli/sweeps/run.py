"""Compute the runs of a sweep and write its folder, without a command line."""

from collections import ChainMap
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any

from stixel_cli.engine.errors import CacheError, MissingEntry, StageFailure
from stixel_cli.engine.execute import execute
from stixel_cli.engine.plan import Durations
from stixel_cli.engine.progress import make_display
from stixel_cli.engine.store import open_store
from stixel_cli.engine.task import remembered
from stixel_cli.errors import UserError
from stixel_cli.machine.kernels import uncompiled
from stixel_cli.report.tables import csv_text
from stixel_cli.results.folder import figure_files
from stixel_cli.results.result import FAILED, MISSING, SKIPPED, RunResult
from stixel_cli.sweeps.folder import FAILED as FAILED_RUNS
from stixel_cli.sweeps.folder import FIGURES, SUMMARIES, TABLE, SweepFolder, SweepRequest
from stixel_cli.sweeps.graphs import SweepPlan
from stixel_cli.sweeps.progress import SweepProgress
from stixel_cli.sweeps.results import SweepResult, summary_files
from stixel_cli.sweeps.resume import resume_command
from stixel_cli.sweeps.run_files import RunLineages, failure_files, remove_unused_code, run_files
from stixel_cli.sweeps.runs import PlannedRun


class SweepInterrupted(UserError):
    """Ctrl-C during a sweep."""

    exit_code = 130


def run_sweep(
    plan: SweepPlan,
    request: SweepRequest,
    folder: SweepFolder | None,
    visible: bool,
    label: str = "",
    finished: Mapping[int, RunResult] | None = None,
) -> SweepResult:
    """Compute the missing nodes of a sweep and write its results. A failing run stops no other.

    Args:
        plan: the runs, in the order of execution.
        request: has the axes, and the notes for the manifest of every run.
        folder: of the sweep, with its `sweep.yaml`; None to write nothing.
        visible: show progress on stderr.
        label: prefix of the progress.
        finished: complete runs of the folder by index, which may be out of date.

    Raises:
        SweepInterrupted: by Ctrl-C; the tables in the folder show which runs are done.
        UserError: if the cache or the folder cannot be written, or there are no workers.
    """
    sweep = _Sweep(plan, folder, dict(request.notes))
    typed = plan.runs[0].overrides
    resume = "" if folder is None else f"; resume with: {resume_command(folder.path, typed)}"
    try:
        sweep.take_finished(finished or {})
        sweep.compute(visible, label)
    except (KeyboardInterrupt, UserError) as error:
        # The runs in the folder count, even if its tables cannot be written. Figures would delay
        # Ctrl-C.
        with suppress(UserError):
            sweep.write_tables()
        if isinstance(error, UserError):
            kind = CacheError if isinstance(error, MissingEntry) else type(error)
            raise kind(f"{error}{resume}") from error
        raise SweepInterrupted(
            f"interrupted: {len(sweep.runs)} of {len(plan.runs)} runs are done; computed results "
            f"are kept{resume}"
        ) from None
    return sweep.finish(request.axes)


class _Sweep:
    """The state of one sweep."""

    def __init__(self, plan: SweepPlan, folder: SweepFolder | None, notes: dict[str, Any]):
        self.plan = plan
        self.store = open_store(plan.runs[0].composition.configuration.cache)
        self.folder = folder
        self.title = str(notes.pop("command"))
        self.notes = {"sweep": self.title, **notes}
        self.runs: dict[int, RunResult] = {}
        """Those that are done or have failed, by index."""
        self.failed_nodes: dict[str, int] = {}
        """Index of the first run that needs each failed node."""
        self.computed = 0
        self.cached = set(plan.needed).difference(plan.missing)
        """Nodes in the store that this call did not compute."""
        self.lineages = None if folder is None else RunLineages(self.store, folder)

    def take_finished(self, finished: Mapping[int, RunResult]) -> None:
        """Take the runs whose folder is complete, or whose results are all in the store."""
        if self.folder is not None:
            # A killed process leaves partial folders.
            self.folder.remove([*SUMMARIES, FIGURES, "runs/.*.partial-*", "failed/.*.partial-*"])
        missing = set(self.plan.missing)
        for planned in self.plan.runs:
            stored = finished.get(planned.index)
            if planned.is_done_by(stored, missing):
                self._note(planned, metrics=stored.metrics)
            elif missing.isdisjoint(planned.targets):
                # A damaged entry is moved away; the run is computed with the others.
                with suppress(MissingEntry):
                    self.take(planned, {})

    def compute(self, visible: bool, label: str) -> None:
        """Compute the missing nodes of the other runs."""
        waiting = [planned for planned in self.plan.runs if planned.index not in self.runs]
        if not waiting:
            return
        executor = waiting[0].composition.configuration.executor
        graph = self.plan.graph
        firsts = [graph.nodes[keys[0]] for keys in graph.stages.values() if keys]
        shown = {"display": make_display(), "uncompiled": uncompiled()} if visible else {}
        progress = SweepProgress(waiting, self.take, len(self.runs), label, self._prepare, **shown)
        progress.expect(Durations(self.store.folder).by_stage(firsts), executor.workers)
        execution = execute(
            graph,
            list(dict.fromkeys(target for one in waiting for target in one.targets)),
            self.store,
            executor=executor,
            progress=progress,
            keep_going=True,
        )
        status = execution.status
        self.computed = sum(one == "computed" for one in status.values())
        self.cached -= status.keys()
        self.cached.update(key for key, one in status.items() if one == "cached")
        for planned in (one for one in waiting if one.index not in self.runs):
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
            pictures = (self.store.load(key).files for key in planned.pictures)
            lineage = self.lineages.text(planned)
            files = run_files(planned, scores, seconds, self.notes, lineage)
            self.folder.write_run(planned.index, files | figure_files(dict(ChainMap(*pictures))))
        self._note(planned, metrics=scores.metrics)

    def note_failure(self, planned: PlannedRun, node: str, failure: StageFailure) -> None:
        """Record the failure of a run, here and in the folder."""
        first = self.failed_nodes.setdefault(node, planned.index)
        status = FAILED if first == planned.index else SKIPPED
        self._note(planned, status=status, failure=failure)
        if self.folder is not None:
            content = failure_files(self.runs[planned.index], node, first)
            self.folder.write_run(planned.index, content, FAILED_RUNS)

    def _note(self, planned: PlannedRun, **outcome: Any) -> None:
        self.runs[planned.index] = planned.result(**outcome)

    def finish(self, axes: Sequence[Sequence[str]]) -> SweepResult:
        """Write the tables, and the statistics and figures of complete settings."""
        result = self.write_tables()
        if self.folder is not None:
            if result.statistics:
                self._write_figures(result, axes)
            remove_unused_code(self.folder)
        return result

    def write_tables(self) -> SweepResult:
        """Write `runs.csv` and the summaries."""
        in_order = sorted(self.plan.runs, key=lambda planned: planned.index)
        runs = tuple(self.runs.get(one.index) or one.result(status=MISSING) for one in in_order)
        folder = None if self.folder is None else self.folder.path
        result = SweepResult(folder, runs, self.computed, len(self.cached))
        if self.folder is not None:
            columns = dict.fromkeys(name for row in result.rows for name in row)
            self.folder.write({TABLE: csv_text(list(columns), result.rows)})
            if result.statistics:
                files = summary_files(result.statistics, result.incomplete, self.title)
                self.folder.write(files)
        return result

    def _write_figures(self, result: SweepResult, axes: Sequence[Sequence[str]]) -> None:
        settings = [run.setting for run in result.complete_runs]
        metrics = [run.metrics for run in result.complete_runs]
        left_out = len(result.incomplete)

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
        self.folder.write({f"{FIGURES}/{name}": image for name, image in figures.items()})
