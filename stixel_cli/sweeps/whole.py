"""A whole sweep, new or gone on with, as the command line and Python call it."""

import os
import shlex
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stixel_cli.config.compose_many import Composer
from stixel_cli.engine.plan import probe
from stixel_cli.engine.store import open_store
from stixel_cli.errors import FolderTaken
from stixel_cli.experiment.run import one_line_errors
from stixel_cli.results.folder import check_results, reserve_folder, stamp
from stixel_cli.results.provenance import provenance
from stixel_cli.sweeps.checks import check_axes
from stixel_cli.sweeps.design import Design
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest
from stixel_cli.sweeps.graphs import SweepPlan, plan_runs, plan_sweep
from stixel_cli.sweeps.older import older_runs
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.sweeps.resume import note_resumed, on_this_machine, resume_words
from stixel_cli.sweeps.run import run_sweep
from stixel_cli.sweeps.runs import (
    SweepRun,
    compose_runs,
    design_runs,
    shuffled_runs,
    sweep_design,
)


def new_sweep(
    overrides: Sequence[str],
    file: str | None = None,
    results: Path | None = None,
    name: str | None = None,
    shuffle: int | None = None,
    pictures: bool = False,
    visible: bool = False,
    tell: Callable[[str], Any] = lambda note: None,
) -> SweepResult:
    """Run a sweep.

    Args:
        overrides: in Hydra's grammar, with its sweeps.
        file: that describes axes: a path, or the name of one that is shipped.
        results: the folder in which the sweep's is made; None to write nothing.
        name: of the sweep's folder; None for one made of the file's name and the time.
        shuffle: seed of the order in which the runs run; None for theirs.
        pictures: draw every run's pictures.
        visible: show progress on stderr.
        tell: called with notes on the axes before anything runs.

    Raises:
        UserError: in one line; before anything is computed for what is wrong with the runs.
        SweepInterrupted: by Ctrl-C.
    """
    design = sweep_design(overrides, file, shuffle)
    runs = design_runs(design)
    plan, notes = planned_sweep(runs, shuffle, pictures)
    for note in notes:
        tell(note)
    now = datetime.now(UTC)
    origin = _origin(_command(overrides, file, shuffle, pictures), now)
    folder = None
    if results is not None:
        stem = "sweep" if file is None else Path(file).stem
        check_results(results, name)
        _probe(plan)
        request = _request(design, runs, shuffle, pictures, (), origin)
        while folder is None:
            made = SweepFolder(reserve_folder(results, name, f"{stem}-{stamp(now)}"))
            try:
                made.create(request)
                folder = made
            except FolderTaken:
                # Two of a second: the other was faster, and there are more default names.
                if name is not None:
                    raise
    return _run(plan, [axis.keys for axis in design.axes], folder, origin, visible)


def designed_sweep(
    design: Design,
    path: Path,
    command: str,
    steps: Sequence[str] = (),
    visible: bool = False,
    label: str = "",
) -> SweepResult:
    """Run the sweep of a design in the new folder `path`.

    Args:
        design: of its runs.
        path: the folder to make.
        command: the command line that stands for it.
        steps: of the pipelines, whose results are kept in the store beside the scores.
        visible: show progress on stderr, with `label` before it.

    Raises:
        UserError, SweepInterrupted: as `new_sweep` does.
    """
    runs = design_runs(design)
    plan, _ = planned_sweep(runs, None, False, steps)
    origin = _origin(command, datetime.now(UTC))
    _probe(plan)
    folder = SweepFolder(path)
    folder.create(_request(design, runs, None, False, steps, origin))
    return _run(plan, [axis.keys for axis in design.axes], folder, origin, visible, label)


def resumed_sweep(
    path: Path,
    workers: int | None = None,
    visible: bool = False,
    label: str = "",
    overrides: Sequence[str] = (),
    tell: Callable[[str], Any] = lambda note: None,
) -> SweepResult:
    """Go on with the sweep in a folder: run what is missing, has failed, or is of older code.

    Args:
        path: the sweep's folder.
        workers: None for those it began with.
        visible: show progress on stderr, with `label` before it.
        overrides: of executor and cache, in the place of those it began with.
        tell: called with how many finished runs are computed again, and why.

    Raises:
        UserError: in one line, if it is no such folder or cannot be gone on with.
        SweepInterrupted: by Ctrl-C.
    """
    folder = SweepFolder(path)
    request = folder.request()
    overrides = [*overrides, *([] if workers is None else [f"executor.workers={workers}"])]
    texts = on_this_machine(request.runs, overrides)
    runs = compose_runs(texts, request.keys, Composer(request.working_directory))
    plan, _ = planned_sweep(runs, request.shuffle, request.pictures, request.steps)
    origin = _origin(str(request.notes.get("command", path.name)), datetime.now(UTC))
    older = older_runs(folder, plan.runs)
    if older is not None:
        tell(older)
    note_resumed(folder, request, plan, resume_words(path, overrides), origin)
    return _run(plan, request.axes, folder, origin, visible, label)


def planned_sweep(
    runs: Sequence[SweepRun], shuffle: int | None, pictures: bool, steps: Sequence[str] = ()
) -> tuple[SweepPlan, list[str]]:
    """The plan of runs, in the order in which they are to run, and notes on their axes.

    Raises:
        UserError: if no stage reads an axis, or the cache cannot be read.
    """
    planned = plan_runs(runs, pictures, steps)
    notes = check_axes(planned)
    store = open_store(runs[0].composition.configuration.cache)
    with one_line_errors():
        return plan_sweep(shuffled_runs(planned, shuffle), store), notes


def _probe(plan: SweepPlan) -> None:
    """Raise UserError if the cache or the scheduler is refused, before a folder is made."""
    configuration = plan.runs[0].run.composition.configuration
    with one_line_errors():
        probe(len(plan.missing), open_store(configuration.cache), configuration.executor)


def _run(
    plan: SweepPlan,
    axes: Sequence[Sequence[str]],
    folder: SweepFolder | None,
    origin: dict[str, Any],
    visible: bool,
    label: str = "",
) -> SweepResult:
    store = open_store(plan.runs[0].run.composition.configuration.cache)
    notes = {"sweep": origin["command"], **origin}
    del notes["command"]
    path = None if folder is None else folder.path
    return run_sweep(plan, axes, store, path, notes, visible, label)


def _origin(command: str, now: datetime) -> dict[str, Any]:
    return {"command": command, "created": now.isoformat(timespec="seconds"), **provenance()}


def _request(
    design: Design,
    runs: Sequence[SweepRun],
    shuffle: int | None,
    pictures: bool,
    steps: Sequence[str],
    origin: dict[str, Any],
) -> SweepRequest:
    return SweepRequest(
        axes=tuple(axis.keys for axis in design.axes),
        runs=tuple(run.overrides for run in runs),
        shuffle=shuffle,
        pictures=pictures,
        steps=tuple(steps),
        working_directory=os.getcwd(),
        notes=origin,
    )


def _command(
    overrides: Sequence[str], file: str | None, shuffle: int | None, pictures: bool
) -> str:
    options = [] if file is None else ["--from", file]
    options += [] if shuffle is None else ["--shuffle", str(shuffle)]
    options += ["--pictures"] if pictures else []
    return shlex.join(["stixel", "sweep", *overrides, *options])
