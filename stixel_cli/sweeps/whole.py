"""Run a new sweep or resume one, from the command line or Python."""

import os
import re
import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stixel_cli.config.compose import Composer, Composition
from stixel_cli.config.folders import PRESETS
from stixel_cli.config.own_options import with_own_values
from stixel_cli.engine.plan import probe, undeclared_reads
from stixel_cli.engine.store import open_store
from stixel_cli.experiment.run import CAMERA, OBJECTS, TRACKS, trust_stored_run
from stixel_cli.experiment.run_names import joined_name
from stixel_cli.experiment.stages import RESULTS
from stixel_cli.results.folder import check_results, new_folder
from stixel_cli.results.provenance import provenance
from stixel_cli.sweeps.design import Design
from stixel_cli.sweeps.folder import PLAN, SweepFolder, SweepRequest
from stixel_cli.sweeps.graphs import SweepPlan, check_axes, plan_runs, plan_sweep
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.sweeps.resume import (
    on_this_machine,
    outdated_runs,
    resume_command,
)
from stixel_cli.sweeps.run import run_sweep
from stixel_cli.sweeps.runs import (
    PlannedRun,
    compose_runs,
    design_runs,
    shuffled_runs,
)


def new_sweep(
    design: Design,
    results: Path | None = None,
    name: str | None = None,
    pictures: bool = False,
    visible: bool = False,
    note: Callable[[str], Any] = lambda text: None,
    advice: bool = True,
) -> SweepResult:
    """Run a sweep.

    Args:
        design: of its runs, by `sweep_design`.
        results: parent of the sweep's folder; None to write nothing.
        name: of the sweep's folder; None for the file's name, or the swept keys, and the time.
        pictures: draw the pictures of every run.
        visible: show progress on stderr.
        note: called with notes on the axes before anything runs.
        advice: note files that the user's code may read without declaring them, too.

    Raises:
        UserError: in one line; for invalid runs before anything is computed.
        SweepInterrupted: by Ctrl-C.
    """
    if results is not None:
        check_results(results, name)
    options = [*(["--pictures"] if pictures else []), *PRESETS.option]
    command = shlex.join(["stixel", "sweep", *design.words, *options])
    plan, request = _requested(design, command, pictures)
    missing = [plan.graph.nodes[key] for key in plan.missing] if advice else []
    for text in [*plan.notes, *undeclared_reads(missing)]:
        note(text)
    if results is None:
        return run_sweep(plan, request, None, visible)
    swept = [re.split("[./]", key)[-1] for key in design.keys]
    stem = Path(design.file).stem if design.file else joined_name(["sweep", *swept])
    check_computable(plan)
    now = datetime.now(UTC)
    folder = new_folder(results, name, stem, now, lambda path: SweepFolder(path).create(request))
    return run_sweep(plan, request, SweepFolder(folder), visible)


def designed_sweep(
    design: Design,
    path: Path,
    command: str,
    nodes: Sequence[str] = (),
    visible: bool = False,
    label: str = "",
) -> SweepResult:
    """Run the sweep of a design in a new folder.

    Args:
        design: of its runs.
        path: the folder to create.
        command: the command line to record.
        nodes: of the pipelines; their results are required in addition to the scores.
        visible: show progress on stderr, with the prefix `label`.

    Raises:
        UserError, SweepInterrupted: as `new_sweep` does.
    """
    plan, request = _requested(design, command, nodes=nodes)
    check_computable(plan)
    folder = SweepFolder(path)
    folder.create(request)
    return run_sweep(plan, request, folder, visible, label)


def resumed_sweep(
    path: Path,
    overrides: Sequence[str] = (),
    trust_code: bool = False,
    visible: bool = False,
    label: str = "",
    note: Callable[[str], Any] = lambda text: None,
) -> SweepResult:
    """Resume the sweep in a folder: run what is missing, has failed, or is out of date.

    Args:
        path: the sweep's folder.
        overrides: of executor and cache; those of the folder are never used.
        trust_code: run the user's own functions that the folder names.
        visible: show progress on stderr, with the prefix `label`.
        note: called with the number of finished runs that are out of date, and why.

    Raises:
        UserError: in one line, if the folder is not of a sweep or cannot be resumed.
        SweepInterrupted: by Ctrl-C.
    """
    folder = SweepFolder(path)
    request = folder.request()
    texts = on_this_machine(request.runs, overrides)
    composer = Composer(request.working_directory, trusted=False)
    runs = compose_runs(texts, request.keys, composer)
    for one in runs:
        trust_stored_run(replace(one.result(), folder=path), trust_code)
    plan = planned_sweep(runs, request.shuffle, request.pictures, request.nodes)
    origin = _origin(str(request.notes.get("command", path.name)))
    finished = folder.finished(len(runs))
    outdated = outdated_runs(folder, plan.runs, finished)
    if outdated is not None:
        note(outdated)
    missing = frozenset(plan.missing)
    if not all(one.is_done_by(finished.get(one.index), missing) for one in plan.runs):
        command, revision = resume_command(path, overrides), origin["git"]["revision"]
        entry = {"time": origin["created"], "command": command, "revision": revision}
        before = request.notes.get("resumed")
        resumed = [*(before if isinstance(before, list) else ()), entry]
        folder.write({PLAN: replace(request, notes={**request.notes, "resumed": resumed}).text})
    return run_sweep(plan, replace(request, notes=origin), folder, visible, label, finished)


def planned_sweep(
    runs: Sequence[PlannedRun], shuffle: int | None, pictures: bool, nodes: Sequence[str] = ()
) -> SweepPlan:
    """The plan of runs in the order of execution, with notes on their axes.

    Raises:
        UserError: if no stage reads an axis, or the cache cannot be read.
    """
    planned = plan_runs(runs, pictures, nodes)
    notes = check_axes(planned)
    store = open_store(runs[0].composition.configuration.cache)
    return plan_sweep(shuffled_runs(planned, shuffle), store, notes)


def planned_run(composition: Composition, pictures: bool = True) -> SweepPlan:
    """The plan of one run with all that its folder has; UserError as above."""
    nodes = (*RESULTS, OBJECTS, TRACKS, *((CAMERA,) if pictures else ()))
    planned = plan_runs([PlannedRun(0, {}, composition)], pictures, nodes)
    return plan_sweep(planned, open_store(composition.configuration.cache))


def check_computable(plan: SweepPlan) -> None:
    """Raise UserError for an unusable cache or scheduler, before a folder is created."""
    configuration = plan.runs[0].composition.configuration
    probe(len(plan.missing), open_store(configuration.cache), configuration.executor)


def _requested(
    design: Design,
    command: str,
    pictures: bool = False,
    nodes: Sequence[str] = (),
) -> tuple[SweepPlan, SweepRequest]:
    """The plan and the request of a design."""
    runs = design_runs(design)
    plan = planned_sweep(runs, design.shuffle, pictures, nodes)
    request = SweepRequest(
        axes=tuple(axis.keys for axis in design.axes),
        runs=tuple(with_own_values(o.overrides, o.composition.resolved) for o in runs),
        shuffle=design.shuffle,
        pictures=pictures,
        nodes=tuple(nodes),
        working_directory=os.getcwd(),
        notes=_origin(command),
    )
    return plan, request


def _origin(command: str) -> dict[str, Any]:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {"command": command, "created": now, **provenance()}
