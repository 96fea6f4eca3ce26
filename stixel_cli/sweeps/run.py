"""Compute the runs of a sweep, new or resumed, and write its folder, without a command line."""

import os
import re
import shlex
import traceback
from collections import ChainMap, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any

from stixel_cli.border.files import read_json
from stixel_cli.border.origins import TYPED, Origin
from stixel_cli.config.compose import Composer
from stixel_cli.config.folders import OF_THE_MACHINE, PRESETS, of_the_machine
from stixel_cli.config.overrides import Override, check_overrides, parse, read_overrides
from stixel_cli.config.own_options import with_own_values
from stixel_cli.config.texts import override_text
from stixel_cli.engine.errors import CacheError, MissingEntry, StageFailure
from stixel_cli.engine.execute import Execution, execute
from stixel_cli.engine.graph import Node
from stixel_cli.engine.keys import digest
from stixel_cli.engine.plan import probe
from stixel_cli.engine.progress import Progress
from stixel_cli.errors import ConfigurationError, Interrupted, UserError
from stixel_cli.evaluation.scores import Scores
from stixel_cli.experiment.run_names import joined_name
from stixel_cli.experiment.stages import compared_rows
from stixel_cli.results import lineage
from stixel_cli.results.folder import arrays_content, figure_files, new_folder
from stixel_cli.results.result import (
    DONE,
    FAILED,
    SKIPPED,
    SWEEP_FILE,
    RunResult,
    json_text,
    yaml_text,
)
from stixel_cli.results.tables import score_columns
from stixel_cli.sweeps.design import compose_runs, is_done_by, picture_keys
from stixel_cli.sweeps.folder import (
    RUNS,
    SUMMARIES,
    TABLE,
    SweepFolder,
    SweepRequest,
    SweepResult,
    summary_files,
)
from stixel_cli.sweeps.graphs import SweepPlan, check_axes, plan_runs


def remove_unused_code(folder: SweepFolder) -> None:
    """Remove code files that no run refers to any more; those that cannot be removed stay."""
    files = list((folder.path / lineage.CODE_FOLDER).glob("*.json"))
    if len(files) < 2:
        return
    used = set()
    for run in (folder.path / RUNS).glob("[0-9]*"):
        with suppress(UserError):
            used.add(str(read_json(run / lineage.FILE).get("code")))
    unused = [one for one in files if one.stem not in used]
    folder.remove(f"{lineage.CODE_FOLDER}/{n}" for one in unused for n in (one.name, one.stem))


class Sweep(Progress):
    """A sweep that computes its missing nodes, and writes each run once all its results are there.

    Attributes:
        runs: those that are done or have failed, by index.
        computed: number of nodes that this call computed.
        stored: keys of the needed nodes in the store that this call did not compute.
    """

    def __init__(
        self,
        plan: SweepPlan,
        folder: SweepFolder | None,
        request: SweepRequest,
        label: str = "",
        visible: bool = False,
    ):
        """Nothing is computed or written yet.

        Args:
            plan: the runs, in the order of their indices.
            folder: of the sweep, with its `sweep.yaml`; None to write nothing.
            request: has the axes, and the notes for the manifest of every run.
            label, visible: prefix of the progress, and whether it is shown on stderr.
        """
        super().__init__(visible, advice=visible)
        self.plan, self.folder, self.request, self.store = plan, folder, request, plan.store
        self.runs: dict[int, RunResult] = {}
        self.computed, self.stored = 0, set(plan.needed).difference(plan.missing)
        self._label = f"{label}: " if label else ""
        self._runs_failed, self._prepared = 0, False
        # By index, the results that a run lacks; by result, the runs that wait for it.
        self._left: dict[int, set[str]] = {}
        self._waiting_for: dict[str, list[RunResult]] = defaultdict(list)
        self._node_seconds: dict[str, float] = {}
        # Index of the first run that needs each failed node.
        self._failed_nodes: dict[str, int] = {}
        # Runs share the digests of results, by key, and code files, four fifths of each lineage.
        self._digests: dict[str, str] = {}
        self._code_files: set[str] = set()

    def run(
        self, finished: Mapping[int, RunResult] | None = None, fail_fast: bool = False
    ) -> SweepResult:
        """Compute the missing nodes and write the results. A failing run stops no other.

        Args:
            finished: complete runs of the folder by index, which may be out of date.
            fail_fast: start nothing after the first failure; the other runs are missing.

        Interrupted by Ctrl-C; the tables in the folder show which runs are done. UserError if
        the cache or the folder cannot be written, or there are no workers.
        """
        folder, typed = self.folder, self.plan.runs[0].overrides
        resume = "" if folder is None else f"; resume with: {folder.resume_command(typed)}"
        try:
            self.take_finished(finished or {})
            self.compute(fail_fast)
        except (KeyboardInterrupt, UserError) as error:
            # The runs in the folder count, even if its tables cannot be written. Figures would
            # delay Ctrl-C.
            with suppress(UserError):
                self.write_tables()
            if isinstance(error, UserError):
                kind = CacheError if isinstance(error, MissingEntry) else type(error)
                raise kind(f"{error}{resume}") from error
            raise Interrupted(
                f"interrupted: {len(self.runs)} of {len(self.plan.runs)} runs are done; computed "
                f"results are kept{resume}"
            ) from None
        result = self.write_tables()
        if folder is not None:
            remove_unused_code(folder)
        return result

    def wait_for(self, runs: Iterable[RunResult]) -> None:
        """Take each of the runs, to be computed, once all its results are in the store."""
        for run in runs:
            self._left[run.index] = set(run.targets)
            for target in run.targets:
                self._waiting_for[target].append(run)

    def begin(self, nodes: Sequence[Node], cached: int) -> None:
        """Count the nodes, and take runs that need no node to run."""
        super().begin(nodes, cached)
        to_run = {node.key for node in nodes}
        for target in [target for target in self._waiting_for if target not in to_run]:
            self._done(target)

    def tick(self) -> None:
        """Update the display; the first time, while workers start, import what the end needs."""
        super().tick()
        if not self._prepared:
            import_module("stixel_cli.answers.runs")
            if self.folder is not None:
                import_module("stixel_cli.answers.page")
            self._prepared = True

    def finished(self, node: Node, seconds: float) -> None:
        """Count the node, and take the runs that waited only for it."""
        super().finished(node, seconds)
        self._node_seconds[node.key] = seconds
        self._done(node.key)

    def failed(self, node: Node, failure: StageFailure, skipped: Sequence[Node]) -> None:
        """Report the failure with its first run, and count those that cannot become complete."""
        waiting = (run for run in self.plan.runs if run.index not in self.runs)
        first = next(run for run in waiting if node.key in run.graph.nodes)
        super().failed(node, failure, skipped, f"{self._label}run {first.index} ({first.label}): ")
        for one in (node, *skipped):
            for run in self._waiting_for.get(one.key, ()):
                self._runs_failed += self._left.pop(run.index, None) is not None

    @property
    def text(self) -> str:
        """The time left and all counts in one line; of nodes first, which grow steadily."""
        failed = f", {self._runs_failed} failed" if self._runs_failed else ""
        nodes_failed = f", {self.failures} failed" if self.failures else ""
        return (
            f"{self._label}{self.text_left}{self.all_done}/{self.all_total} nodes{nodes_failed}; "
            f"{len(self.runs)}/{len(self.plan.runs)} runs{failed}; {self.cached} nodes cached"
        )

    def _done(self, target: str) -> None:
        for run in self._waiting_for.get(target, ()):
            left = self._left.get(run.index, set())
            if left == {target}:
                del self._left[run.index]
                self.take(run)
            left.discard(target)

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
                    self.take(planned)

    def compute(self, fail_fast: bool) -> None:
        """Compute the missing nodes of the other runs."""
        waiting = [planned for planned in self.plan.runs if planned.index not in self.runs]
        if not waiting:
            return
        self.wait_for(waiting)
        notes: list[str] = []
        for composition in (planned.composition for planned in waiting):
            compared_rows(composition, notes.append)
            notes += composition.files.notes
        for text in dict.fromkeys(notes):
            self.note(text)
        try:
            execution = execute(
                self.plan.graph,
                list(self._waiting_for),
                self.store,
                executor=self.plan.executor,
                progress=self,
                keep_going=not fail_fast,
            )
        except StageFailure as failure:
            self.computed = len(self._node_seconds)
            first = next(o for o in waiting if failure.key in o.graph.ancestors(o.targets))
            self.note_failure(first, failure.key, failure)
            return
        status = execution.status
        self.computed = sum(one == "computed" for one in status.values())
        self.stored -= status.keys()
        self.stored.update(key for key, one in status.items() if one == "cached")
        for planned in (one for one in waiting if one.index not in self.runs):
            failure = execution.failure_of(planned.targets)
            if failure is None:
                self.take(planned)
            else:
                self.note_failure(planned, *failure)

    def take(self, planned: RunResult) -> None:
        """Load the scores of a complete run, and write its folder."""
        scores = self.store.load(planned.targets[0])
        if self.folder is not None:
            pictures = (self.store.load(key).files for key in picture_keys(planned))
            files = self.run_files(planned, scores) | figure_files(dict(ChainMap(*pictures)))
            self.folder.write_run(planned.index, files)
        self.runs[planned.index] = replace(planned, metrics=scores.metrics, status=DONE)

    def run_files(self, planned: RunResult, scores: Scores) -> dict[str, str | bytes]:
        """The files of a complete run by name; writes its code file into the sweep's folder."""
        keys, seconds = planned.graph.ancestors(planned.targets), self._node_seconds
        found = lineage.lineage_of(planned.graph, keys, self.store, self._digests)
        code = lineage.compact_json(found.code)
        name = digest(code)[:16]
        if name not in self._code_files:
            sources = lineage.stored_sources(found.sources).items()
            files = {f"{name}.json": code} | {f"{name}/{path}": source for path, source in sources}
            self.folder.write({f"{lineage.CODE_FOLDER}/{path}": files[path] for path in files})
            self._code_files.add(name)
        # Each run that shares a computed node records it as computed.
        status = {key: "computed" if key in seconds else "cached" for key in keys}
        entries, notes = dict(planned.manifest), dict(self.request.notes)
        index = entries.pop("run")
        manifest = {
            "command": shlex.join(["stixel", "run", *planned.overrides, *PRESETS.option]),
            **entries,
            "sweep": str(notes.pop("command")),
            **notes,
            "run": index,
            "results": list(planned.targets),
            "stages": Execution(planned.graph, status, seconds).stage_records(),
        }
        return {
            "config.yaml": yaml_text(planned.settings),
            "manifest.json": json_text(manifest),
            "metrics.json": json_text(scores.metrics),
            lineage.FILE: lineage.compact_json(lineage.lineage_tree(found, name)),
            "scores.npz": arrays_content(score_columns(scores)),
        }

    def note_failure(self, planned: RunResult, node: str, failure: StageFailure) -> None:
        """Record the failure of a run, here and in the folder, and the key of the failed node."""
        first = self._failed_nodes.setdefault(node, planned.index)
        status = FAILED if first == planned.index else SKIPPED
        self.runs[planned.index] = replace(planned, status=status, failure=failure)
        if self.folder is None:
            return
        content = {
            "run": planned.index,
            "status": status,
            "failed_in_run": first,
            "overrides": list(planned.overrides),
            "stage": failure.stage,
            "node": failure.label,
            "key": node,
            "error": f"{type(failure.cause).__name__}: {failure.cause}",
        }
        files = {
            "config.yaml": yaml_text(planned.settings),
            "failure.json": json_text(content),
            "traceback.txt": failure.traceback_text
            or "".join(traceback.format_exception(failure.cause)),
        }
        self.folder.write_run(planned.index, files, FAILED)

    def write_tables(self) -> SweepResult:
        """Write `runs.csv`, and the summaries of complete settings."""
        runs = tuple(self.runs.get(one.index, one) for one in self.plan.runs)
        folder = None if self.folder is None else self.folder.path
        result = SweepResult(folder, runs, self.request, self.computed, len(self.stored))
        if self.folder is not None:
            table = import_module("pandas").DataFrame(result.rows, dtype=object)
            self.folder.write({TABLE: table.to_csv(index=False, lineterminator="\n")})
            if result.count(DONE):
                self.folder.write(summary_files(result))
        return result


def new_sweep(
    plan: SweepPlan,
    results: Path | None = None,
    name: str | None = None,
    visible: bool = False,
    fail_fast: bool = False,
    label: str = "",
) -> SweepResult:
    """Run a sweep, planned by `plan_sweep`; the errors are those of `Sweep.run`.

    Args:
        results: parent of the sweep's folder, see `check_results`; None to write nothing.
        name: of the sweep's folder; None for the file's name, or the swept keys, and the time.
        visible, label, fail_fast: see `Sweep`.
    """
    design, options = plan.design, [*(["--pictures"] if plan.pictures else []), *PRESETS.option]
    request = SweepRequest(
        axes=tuple(axis.keys for axis in design.axes),
        runs=tuple(with_own_values(o.overrides, o.composition.resolved) for o in plan.runs),
        pictures=plan.pictures,
        nodes=plan.nodes,
        working_directory=os.getcwd(),
        notes=lineage.origin(shlex.join(["stixel", "sweep", *design.words, *options])),
        over=design.over,
    )
    folder = None
    if results is not None:
        probe(len(plan.missing), plan.store, plan.executor)
        swept = [re.split("[./]", key)[-1] for key in design.keys]
        stem = Path(design.file).stem if design.file else joined_name(["sweep", *swept])
        now, create = datetime.now(UTC), lambda path: SweepFolder(path).create(request)
        folder = SweepFolder(new_folder(results, name, stem, now, create))
    return Sweep(plan, folder, request, label, visible).run(fail_fast=fail_fast)


def resumed_sweep(
    path: Path,
    overrides: Sequence[str],
    names: Origin,
    label: str = "",
    note: Callable[[str], Any] = lambda text: None,
    fail_fast: bool = False,
) -> SweepResult:
    """Resume the sweep in a folder: run what is missing, has failed, or is out of date.

    Args:
        overrides: of executor and cache; those of the folder are never used.
        names: where the names of code in the folder come from.
        note: called with the number of finished runs that are out of date.
        label, fail_fast: see `Sweep`.

    UserError, Interrupted as `Sweep.run` does; if the folder is not of a sweep.
    """
    folder = SweepFolder(path)
    request = folder.request()
    runs = stored_runs(request, overrides, names, imports=True)
    plan = plan_runs(runs, request.pictures, request.nodes)
    check_axes(plan.runs)
    origin = lineage.origin(str(request.notes.get("command", path.name)))
    finished = folder.finished(len(runs))
    there = [one for one in plan.runs if one.index in finished]
    outdated = [one for one in there if not is_done_by(one, finished[one.index])]
    if outdated:
        note(
            f"{len(outdated)} of {len(finished)} finished runs out of date, recomputed now (before "
            f"that, stixel verify --cached {folder.run(outdated[0].index)} says why)"
        )
    missing = frozenset(plan.missing)
    if not all(is_done_by(one, finished.get(one.index), missing) for one in plan.runs):
        command, revision = folder.resume_command(overrides), origin["git"]["revision"]
        entry = {"time": origin["created"], "command": command, "revision": revision}
        before = request.notes.get("resumed")
        resumed = [*(before if isinstance(before, list) else ()), entry]
        folder.write(
            {SWEEP_FILE: replace(request, notes={**request.notes, "resumed": resumed}).text}
        )
    request = replace(request, notes=origin)
    return Sweep(plan, folder, request, label, visible=True).run(finished, fail_fast)


def stored_runs(
    request: SweepRequest, overrides: Sequence[str], origin: Origin, imports: bool
) -> list[RunResult]:
    """The runs of a folder's request, with executor and cache replaced by `overrides`.

    `origin` is the folder; to compare its runs, without `imports`, it may name code.
    ConfigurationError as of `resumed_overrides`, or for a wrong run.
    """
    each = resumed_overrides(request.runs, overrides, origin)
    return compose_runs(each, request.keys, Composer(request.working_directory, imports))


def resumed_overrides(
    kept: Iterable[Iterable[str]], overrides: Sequence[str], origin: Origin
) -> list[list[Override]]:
    """Overrides that a folder keeps, each with executor and cache replaced by `overrides`.

    Nothing of these groups is kept: somebody else may have written the folder, and a cache holds
    pickles, a scheduler's address a computer. ConfigurationError for an override of other groups or
    of several values.
    """
    parsed, given = read_overrides(overrides, TYPED), []
    for override in parsed:
        if not of_the_machine(override.key):
            raise ConfigurationError(
                f"{override.shown}: --resume keeps the settings in the folder: only keys of "
                f"{' and '.join(OF_THE_MACHINE)}, which do not affect results, can be changed"
            )
        if override.sweep is not None:
            raise ConfigurationError(f"{override.shown}: --resume: one value is needed")
        text, folder = override.text, override.value
        if override.key == "cache.folder" and isinstance(folder, str) and folder:
            # Paths of the runs refer to the sweep's working directory, this one to today's.
            text = override_text("cache.folder", os.path.abspath(os.path.expanduser(folder)))
        given.append(parse(text, TYPED))
    check_overrides(parsed)
    return [[*(parse(t, origin) for t in own if not of_the_machine(t)), *given] for own in kept]
