"""A whole sweep, new or gone on with, as the command line and Python call it."""

import shlex
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stixel_cli.engine.store import open_store
from stixel_cli.experiment.folder import reserve_folder
from stixel_cli.experiment.recorded_run import provenance, stamp, told_in_one_line
from stixel_cli.sweeps.checks import check_axes
from stixel_cli.sweeps.design import Design
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest
from stixel_cli.sweeps.graphs import SweepPlan, plan_points, plan_sweep
from stixel_cli.sweeps.points import (
    Point,
    compose_points,
    design_points,
    shuffled_points,
    sweep_design,
)
from stixel_cli.sweeps.results import SweepResult
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
    origin = {
        "command": _command(overrides, file, shuffle, pictures),
        "created": now.isoformat(timespec="seconds"),
        **provenance(),
    }
    folder = None
    if results is not None:
        stem = "sweep" if file is None else Path(file).stem
        folder = SweepFolder(reserve_folder(results, name, f"{stem}-{stamp(now)}"))
        folder.create(_request(design, points, shuffle, pictures, origin))
    return _run(plan, [axis.keys for axis in design.axes], folder, origin, visible)


def resumed_sweep(path: Path, workers: int | None = None, visible: bool = False) -> SweepResult:
    """Go on with the sweep in a folder: run what is missing, has failed, or is of older code.

    Args:
        path: the sweep's folder.
        workers: None for those it began with.
        visible: show progress on stderr.

    Raises:
        UserError: in one line, if it is no such folder or cannot be gone on with.
        SweepInterrupted: by Ctrl-C.
    """
    folder = SweepFolder(path)
    request = folder.request()
    points = compose_points(_with_workers(request.points, workers), request.keys)
    plan, _ = planned_sweep(points, request.shuffle, request.pictures)
    origin = {
        "command": str(request.notes.get("command", path.name)),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        **provenance(),
    }
    return _run(plan, request.axes, folder, origin, visible)


def planned_sweep(
    points: Sequence[Point], shuffle: int | None, pictures: bool
) -> tuple[SweepPlan, list[str]]:
    """The plan of points, in the order in which they are to run, and notes on their axes.

    Raises:
        UserError: if no stage reads an axis, or the cache cannot be read.
    """
    planned = plan_points(points, pictures)
    notes = check_axes(planned)
    store = open_store(points[0].composition.configuration.cache)
    with told_in_one_line():
        return plan_sweep(shuffled_points(planned, shuffle), store), notes


def _run(
    plan: SweepPlan,
    axes: Sequence[Sequence[str]],
    folder: SweepFolder | None,
    origin: dict[str, Any],
    visible: bool,
) -> SweepResult:
    store = open_store(plan.points[0].point.composition.configuration.cache)
    notes = {"sweep": origin["command"], **origin}
    del notes["command"]
    return run_sweep(plan, axes, store, None if folder is None else folder.path, notes, visible)


def _request(
    design: Design,
    points: Sequence[Point],
    shuffle: int | None,
    pictures: bool,
    origin: dict[str, Any],
) -> SweepRequest:
    return SweepRequest(
        axes=tuple(axis.keys for axis in design.axes),
        points=tuple(point.overrides for point in points),
        shuffle=shuffle,
        pictures=pictures,
        notes=origin,
    )


def _with_workers(points: Sequence[Sequence[str]], workers: int | None) -> list[tuple[str, ...]]:
    if workers is None:
        return [tuple(overrides) for overrides in points]
    key = "executor.workers="
    return [
        (*(text for text in overrides if not text.lstrip("+").startswith(key)), f"{key}{workers}")
        for overrides in points
    ]


def _command(
    overrides: Sequence[str], file: str | None, shuffle: int | None, pictures: bool
) -> str:
    options = [] if file is None else ["--from", file]
    options += [] if shuffle is None else ["--shuffle", str(shuffle)]
    options += ["--pictures"] if pictures else []
    return shlex.join(["stixel", "sweep", *overrides, *options])
