"""Compute the runs of a sweep and write its folder, without a command line."""

from collections import ChainMap, defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import import_module

from stixel_cli.engine.errors import CacheError, MissingEntry, StageFailure
from stixel_cli.engine.execute import execute
from stixel_cli.engine.graph import Node
from stixel_cli.engine.progress import Progress
from stixel_cli.errors import UserError
from stixel_cli.experiment.stages import compared_rows
from stixel_cli.results.folder import figure_files
from stixel_cli.results.result import DONE, FAILED, SKIPPED, RunResult
from stixel_cli.sweeps.folder import SUMMARIES, TABLE, SweepFolder, SweepRequest
from stixel_cli.sweeps.graphs import SweepPlan
from stixel_cli.sweeps.page import summary_files
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.sweeps.run_files import RunLineages, failure_files, remove_unused_code, run_files
from stixel_cli.sweeps.runs import is_done_by, picture_keys


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
    fail_fast: bool = False,
) -> SweepResult:
    """Compute the missing nodes of a sweep and write its results. A failing run stops no other.

    Args:
        plan: the runs, in the order of their indices.
        request: has the axes, and the notes for the manifest of every run.
        folder: of the sweep, with its `sweep.yaml`; None to write nothing.
        visible: show progress on stderr.
        label: prefix of the progress.
        finished: complete runs of the folder by index, which may be out of date.
        fail_fast: start nothing after the first failure; the other runs are missing.

    Raises:
        SweepInterrupted: by Ctrl-C; the tables in the folder show which runs are done.
        UserError: if the cache or the folder cannot be written, or there are no workers.
    """
    sweep = _Sweep(plan, folder, request)
    typed = plan.runs[0].overrides
    resume = "" if folder is None else f"; resume with: {folder.resume_command(typed)}"
    try:
        sweep.take_finished(finished or {})
        sweep.compute(visible, label, fail_fast)
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
    result = sweep.write_tables()
    if folder is not None:
        remove_unused_code(folder)
    return result


class SweepProgress(Progress):
    """Counts runs and nodes, and reports each run as soon as all its results are in the store."""

    def __init__(
        self,
        waiting: Sequence[RunResult],
        on_run: Callable[[RunResult, Mapping[str, float]], None],
        done: int = 0,
        label: str = "",
        prepare: Callable[[], None] = lambda: None,
        visible: bool = False,
    ):
        """Start with no run of `waiting` done.

        Args:
            waiting: the runs to compute.
            on_run: called with each complete run, and the seconds of all nodes computed so far,
                by key.
            done: number of runs that are already done.
            label: prefix of the counts.
            prepare: called once, as soon as the first nodes run: the workers start meanwhile.
            visible: as in `Progress`.
        """
        super().__init__(visible)
        self.runs_total = done + len(waiting)
        self.runs_done, self.runs_failed = done, 0
        self.node_seconds: dict[str, float] = {}
        self._on_run = on_run
        self._prepare = prepare
        self._label = f"{label}: " if label else ""
        self._left = {one.index: set(one.targets) for one in waiting}
        self._waiting_for: dict[str, list[RunResult]] = defaultdict(list)
        for one in waiting:
            for target in one.targets:
                self._waiting_for[target].append(one)

    def begin(self, nodes: Sequence[Node], cached: int) -> None:
        """Count the nodes, and report runs that need no node to run."""
        super().begin(nodes, cached)
        to_run = {node.key for node in nodes}
        for target in [target for target in self._waiting_for if target not in to_run]:
            self._done(target)

    def tick(self) -> None:
        """Update the display; the first time, prepare the end of the sweep."""
        super().tick()
        self._prepare()
        self._prepare = lambda: None

    def finished(self, node: Node, seconds: float) -> None:
        """Count the node, and report the runs that waited only for it."""
        super().finished(node, seconds)
        self.node_seconds[node.key] = seconds
        self._done(node.key)

    def failed(self, node: Node, failure: StageFailure, skipped: Sequence[Node]) -> None:
        """Report the failure, and count the runs that cannot become complete."""
        super().failed(node, failure, skipped)
        for one in (node, *skipped):
            for run in self._waiting_for.get(one.key, ()):
                if self._left.pop(run.index, None) is not None:
                    self.runs_failed += 1

    @property
    def text(self) -> str:
        """The time left and all counts in one line; of nodes first, which grow steadily."""
        failed = f", {self.runs_failed} failed" if self.runs_failed else ""
        nodes_failed = f", {self.failures} failed" if self.failures else ""
        return (
            f"{self._label}{self.text_left}{self.all_done}/{self.all_total} nodes{nodes_failed}; "
            f"{self.runs_done}/{self.runs_total} runs{failed}; {self.cached} nodes cached"
        )

    def _done(self, target: str) -> None:
        for run in self._waiting_for.get(target, ()):
            left = self._left.get(run.index, set())
            if left == {target}:
                del self._left[run.index]
                self.runs_done += 1
                self._on_run(run, self.node_seconds)
            left.discard(target)


class _Sweep:
    """The state of one sweep."""

    def __init__(self, plan: SweepPlan, folder: SweepFolder | None, request: SweepRequest):
        self.plan, self.request = plan, request
        self.store, self.folder = plan.store, folder
        notes = dict(request.notes)
        self.notes = {"sweep": str(notes.pop("command")), **notes}
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
            self.folder.remove([*SUMMARIES, "runs/.*.partial-*", "failed/.*.partial-*"])
        missing = set(self.plan.missing)
        for planned in self.plan.runs:
            stored = finished.get(planned.index)
            if is_done_by(planned, stored, missing):
                self.runs[planned.index] = replace(planned, metrics=stored.metrics, status=DONE)
            elif missing.isdisjoint(planned.targets):
                # A damaged entry is moved away; the run is computed with the others.
                with suppress(MissingEntry):
                    self.take(planned, {})

    def compute(self, visible: bool, label: str, fail_fast: bool) -> None:
        """Compute the missing nodes of the other runs."""
        waiting = [planned for planned in self.plan.runs if planned.index not in self.runs]
        if not waiting:
            return
        executor, graph = self.plan.executor, self.plan.graph
        firsts = [graph.nodes[keys[0]] for keys in graph.stages.values() if keys]
        progress = SweepProgress(waiting, self.take, len(self.runs), label, self._prepare, visible)
        notes: list[str] = []
        for composition in (planned.composition for planned in waiting):
            compared_rows(composition, notes.append)
            notes += composition.files.notes
        for text in dict.fromkeys(notes):
            progress.note(text)
        progress.expect(self.plan.durations.by_stage(firsts), executor.workers)
        try:
            execution = execute(
                graph,
                list(dict.fromkeys(target for one in waiting for target in one.targets)),
                self.store,
                executor=executor,
                progress=progress,
                keep_going=not fail_fast,
            )
        except StageFailure as failure:
            self.computed = len(progress.node_seconds)
            first = next(o for o in waiting if failure.key in o.graph.ancestors(o.targets))
            self.note_failure(first, failure.key, failure)
            return
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
        """Import the modules of the statistics and the page: as long as a few runs take."""
        import_module("stixel_cli.answers.runs")
        if self.folder is not None:
            import_module("stixel_cli.answers.page")

    def take(self, planned: RunResult, seconds: Mapping[str, float]) -> None:
        """Load the scores of a complete run, and write its folder."""
        scores = self.store.load(planned.targets[0])
        if self.folder is not None:
            pictures = (self.store.load(key).files for key in picture_keys(planned))
            lineage = self.lineages.text(planned)
            files = run_files(planned, scores, seconds, self.notes, lineage)
            self.folder.write_run(planned.index, files | figure_files(dict(ChainMap(*pictures))))
        self.runs[planned.index] = replace(planned, metrics=scores.metrics, status=DONE)

    def note_failure(self, planned: RunResult, node: str, failure: StageFailure) -> None:
        """Record the failure of a run, here and in the folder."""
        first = self.failed_nodes.setdefault(node, planned.index)
        status = FAILED if first == planned.index else SKIPPED
        run = self.runs[planned.index] = replace(planned, status=status, failure=failure)
        if self.folder is not None:
            self.folder.write_run(planned.index, failure_files(run, node, first), FAILED)

    def write_tables(self) -> SweepResult:
        """Write `runs.csv`, and the summaries of complete settings."""
        runs = tuple(self.runs.get(one.index, one) for one in self.plan.runs)
        folder = None if self.folder is None else self.folder.path
        request = self.request
        result = SweepResult(
            folder, runs, self.computed, len(self.cached), request.axes, request.over
        )
        if self.folder is not None:
            table = import_module("pandas").DataFrame(result.rows, dtype=object)
            self.folder.write({TABLE: table.to_csv(index=False, lineterminator="\n")})
            if result.count(DONE):
                self.folder.write(summary_files(result, self.request.notes))
        return result
