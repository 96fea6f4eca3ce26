"""A whole sweep, new or gone on with, as the command line and Python call it."""

import os
import shlex
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stixel_cli.config.compose import Composer
from stixel_cli.engine.probe import probe
from stixel_cli.engine.store import open_store
from stixel_cli.errors import FolderTaken
from stixel_cli.experiment.recorded_run import provenance, stamp, told_in_one_line
from stixel_cli.results.folder import check_results, reserve_folder
from stixel_cli.sweeps.checks import check_axes
from stixel_cli.sweeps.design import Design
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest
from stixel_cli.sweeps.graphs import SweepPlan, plan_points, plan_sweep
from stixel_cli.sweeps.older import older_points
from stixel_cli.sweeps.points import (
    Point,
    compose_points,
    design_points,
    shuffled_points,
    sweep_design,
)
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.sweeps.resume import note_resumed, on_this_machine, resume_words
from stixel_cli.sweeps.run import run_sweep


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
        shuffle: seed of the order in which the points run; None for theirs.
        pictures: draw every point's pictures.
        visible: show progress on stderr.
        tell: called with notes on the axes before anything runs.

    Raises:
        UserError: in one line; before anything is computed for what is wrong with the points.
        SweepInterrupted: by Ctrl-C.
    """
    design = sweep_design(overrides, file, shuffle)
    points = design_points(design)
    plan, notes = planned_sweep(points, shuffle, pictures)
    for note in notes:
        tell(note)
    now = datetime.now(UTC)
    origin = _origin(_command(overrides, file, shuffle, pictures), now)
    folder = None
    if results is not None:
        stem = "sweep" if file is None else Path(file).stem
        check_results(results, name)
        _probe(plan)
        request = _request(design, points, shuffle, pictures, (), origin)
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
        design: of its points.
        path: the folder to make.
        command: the command line that stands for it.
        steps: of the pipelines, whose results are kept in the store beside the scores.
        visible: show progress on stderr, with `label` before it.

    Raises:
        UserError, SweepInterrupted: as `new_sweep` does.
    """
    points = design_points(design)
    plan, _ = planned_sweep(points, None, False, steps)
    origin = _origin(command, datetime.now(UTC))
    _probe(plan)
    folder = SweepFolder(path)
    folder.create(_request(design, points, None, False, steps, origin))
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
        tell: called with how many finished points are computed again, and why.

    Raises:
        UserError: in one line, if it is no such folder or cannot be gone on with.
        SweepInterrupted: by Ctrl-C.
    """
    folder = SweepFolder(path)
    request = folder.request()
    overrides = [*overrides, *([] if workers is None else [f"executor.workers={workers}"])]
    texts = on_this_machine(request.points, overrides)
    points = compose_points(texts, request.keys, Composer(request.working_directory))
    plan, _ = planned_sweep(points, request.shuffle, request.pictures, request.steps)
    origin = _origin(str(request.notes.get("command", path.name)), datetime.now(UTC))
    older = older_points(folder, plan.points)
    if older is not None:
        tell(older)
    note_resumed(folder, request, plan, resume_words(path, overrides), origin)
    return _run(plan, request.axes, folder, origin, visible, label)


def planned_sweep(
    points: Sequence[Point], shuffle: int | None, pictures: bool, steps: Sequence[str] = ()
) -> tuple[SweepPlan, list[str]]:
    """The plan of points, in the order in which they are to run, and notes on their axes.

    Raises:
        UserError: if no stage reads an axis, or the cache cannot be read.
    """
    planned = plan_points(points, pictures, steps)
    notes = check_axes(planned)
    store = open_store(points[0].composition.configuration.cache)
    with told_in_one_line():
        return plan_sweep(shuffled_points(planned, shuffle), store), notes


def _probe(plan: SweepPlan) -> None:
    """Raise UserError if the cache or the scheduler is refused, before a folder is made."""
    configuration = plan.points[0].point.composition.configuration
    with told_in_one_line():
        probe(len(plan.missing), open_store(configuration.cache), configuration.executor)


def _run(
    plan: SweepPlan,
    axes: Sequence[Sequence[str]],
    folder: SweepFolder | None,
    origin: dict[str, Any],
    visible: bool,
    label: str = "",
) -> SweepResult:
    store = open_store(plan.points[0].point.composition.configuration.cache)
    notes = {"sweep": origin["command"], **origin}
    del notes["command"]
    path = None if folder is None else folder.path
    return run_sweep(plan, axes, store, path, notes, visible, label)


def _origin(command: str, now: datetime) -> dict[str, Any]:
    return {"command": command, "created": now.isoformat(timespec="seconds"), **provenance()}


def _request(
    design: Design,
    points: Sequence[Point],
    shuffle: int | None,
    pictures: bool,
    steps: Sequence[str],
    origin: dict[str, Any],
) -> SweepRequest:
    return SweepRequest(
        axes=tuple(axis.keys for axis in design.axes),
        points=tuple(point.overrides for point in points),
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
