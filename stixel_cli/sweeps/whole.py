"""Run a new sweep or resume one, from the command line or Python."""

import os
import re
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stixel_cli.border import TYPED, Origin
from stixel_cli.config.compose import Composer
from stixel_cli.config.folders import OF_THE_MACHINE, PRESETS, of_the_machine
from stixel_cli.config.override_checks import check_overrides, read_overrides
from stixel_cli.config.overrides import Override, parse
from stixel_cli.config.own_options import with_own_values
from stixel_cli.config.texts import override_text
from stixel_cli.engine.plan import undeclared_reads
from stixel_cli.errors import ConfigurationError
from stixel_cli.experiment.run_names import joined_name
from stixel_cli.results.folder import new_folder
from stixel_cli.results.lineage import provenance
from stixel_cli.results.reader import SWEEP_FILE
from stixel_cli.results.result import RunResult
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest
from stixel_cli.sweeps.graphs import SweepPlan, check_axes, plan_runs
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.sweeps.run import run_sweep
from stixel_cli.sweeps.runs import compose_runs, is_done_by


def new_sweep(
    plan: SweepPlan,
    results: Path | None = None,
    name: str | None = None,
    visible: bool = False,
    note: Callable[[str], Any] = lambda text: None,
    advice: bool = True,
    fail_fast: bool = False,
    label: str = "",
) -> SweepResult:
    """Run a sweep.

    Args:
        plan: by `plan_sweep`.
        results: parent of the sweep's folder, see `check_results`; None to write nothing.
        name: of the sweep's folder; None for the file's name, or the swept keys, and the time.
        visible: show progress on stderr.
        note: called with notes on the axes before anything runs.
        advice: note files that the user's code may read without declaring them, too.
        fail_fast, label: see `run_sweep`.

    Raises:
        UserError, SweepInterrupted: as `run_sweep` does.
    """
    design, options = plan.design, [*(["--pictures"] if plan.pictures else []), *PRESETS.option]
    request = SweepRequest(
        axes=tuple(axis.keys for axis in design.axes),
        runs=tuple(with_own_values(o.overrides, o.composition.resolved) for o in plan.runs),
        pictures=plan.pictures,
        nodes=plan.nodes,
        working_directory=os.getcwd(),
        notes=_origin(shlex.join(["stixel", "sweep", *design.words, *options])),
        over=design.over,
    )
    missing = [plan.graph.nodes[key] for key in plan.missing] if advice else []
    for text in [*plan.notes, *undeclared_reads(missing)]:
        note(text)
    folder = None
    if results is not None:
        plan.probe()
        swept = [re.split("[./]", key)[-1] for key in design.keys]
        stem = Path(design.file).stem if design.file else joined_name(["sweep", *swept])
        now, create = datetime.now(UTC), lambda path: SweepFolder(path).create(request)
        folder = SweepFolder(new_folder(results, name, stem, now, create))
    return run_sweep(plan, request, folder, visible, label, fail_fast=fail_fast)


def resumed_sweep(
    path: Path,
    overrides: Sequence[str],
    names: Origin,
    visible: bool = False,
    label: str = "",
    note: Callable[[str], Any] = lambda text: None,
    fail_fast: bool = False,
) -> SweepResult:
    """Resume the sweep in a folder: run what is missing, has failed, or is out of date.

    Args:
        path: the sweep's folder.
        overrides: of executor and cache; those of the folder are never used.
        names: where the names of code in the folder come from.
        visible: show progress on stderr, with the prefix `label`.
        note: called with the number of finished runs that are out of date.
        fail_fast: see `run_sweep`.

    Raises:
        UserError, SweepInterrupted: as `run_sweep` does; if the folder is not of a sweep.
    """
    folder = SweepFolder(path)
    request = folder.request()
    runs = stored_runs(request, overrides, names, imports=True)
    plan = plan_runs(runs, request.pictures, request.nodes)
    check_axes(plan.runs)
    origin = _origin(str(request.notes.get("command", path.name)))
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
    return run_sweep(plan, request, folder, visible, label, finished, fail_fast)


def _origin(command: str) -> dict[str, Any]:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {"command": command, "created": now, **provenance()}


def stored_runs(
    request: SweepRequest, overrides: Sequence[str], origin: Origin, imports: bool
) -> list[RunResult]:
    """The runs of a folder's request, with executor and cache replaced by `overrides`.

    `origin` is the folder; to compare its runs, without `imports`, it may name code.

    Raises:
        ConfigurationError: as of `resumed_overrides`, or for a wrong run.
    """
    each = resumed_overrides(request.runs, overrides, origin)
    return compose_runs(each, request.keys, Composer(request.working_directory, imports))


def resumed_overrides(
    kept: Iterable[Iterable[str]], overrides: Sequence[str], origin: Origin
) -> list[list[Override]]:
    """Overrides that a folder keeps, each with executor and cache replaced by `overrides`.

    Nothing of these groups is kept: somebody else may have written the folder, and a cache holds
    pickles, a scheduler's address a computer.

    Raises:
        ConfigurationError: for an override of other groups or of several values.
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
