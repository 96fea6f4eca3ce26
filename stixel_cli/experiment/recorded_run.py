"""One experiment from its configuration to its result folder: what `run`, `rerun` and Python do."""

import shlex
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stixel_cli.config.compose import Composition
from stixel_cli.engine.errors import CacheError, CodeChanged, ExecutorError, StageFailure
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import open_store
from stixel_cli.errors import FolderTaken, UserError
from stixel_cli.experiment.played_run import run_page
from stixel_cli.experiment.run import Outcome, run_experiment
from stixel_cli.results.folder import check_results, reserve_folder, write_folder
from stixel_cli.results.provenance import git_state, machine, package_versions


@dataclass(frozen=True)
class RecordedRun:
    """An experiment that has run.

    Attributes:
        folder: where it was written; None if it was not asked for.
        outcome: its results.
        manifest: what `manifest.json` says of it.
    """

    folder: Path | None
    outcome: Outcome
    manifest: dict[str, Any]


def record_run(
    composition: Composition,
    command: Sequence[str],
    results: Path | None = None,
    name: str | None = None,
    stem: str | None = None,
    progress: Progress | None = None,
    notes: dict[str, Any] | None = None,
) -> RecordedRun:
    """Run an experiment and write its result folder below `results`, if that is given.

    Args:
        composition: the experiment.
        command: the command line that stands for it, for the manifest.
        results: the folder in which the result folder is made; None to write nothing.
        name: of the result folder; None for one made of `stem` and the time.
        stem: None for the choices of the main groups.
        progress: told how far it is.
        notes: further entries of the manifest.

    Raises:
        UserError: for whatever the user can put right; no result folder is left then.
        StageFailure: if a stage fails for another reason.
    """
    started = time.perf_counter()
    if results is not None:
        check_results(results, name)
    store = open_store(composition.configuration.cache)
    now = datetime.now(UTC)
    with told_in_one_line():
        outcome = run_experiment(composition.configuration, store, progress=progress)
    stem = choice_name(composition) if stem is None else stem
    manifest = {
        "command": shlex.join(command),
        "overrides": list(composition.overrides),
        "choices": composition.choices,
        "seed": composition.configuration.seed,
        "created": now.isoformat(timespec="seconds"),
        "seconds": round(time.perf_counter() - started, 3),
        "workers": composition.configuration.executor.workers,
        **provenance(),
        **(notes or {}),
        "star_convex": outcome.scenario.star_convex,
        "stages": outcome.stages,
    }
    folder = None
    while results is not None:
        # Only now: a cache or a scheduler that is refused leaves no folder behind.
        folder = reserve_folder(results, name, f"{stem}-{stamp(now)}")
        page = run_page(folder.name, composition, outcome)
        try:
            write_folder(folder, outcome, composition.resolved, manifest, page)
            break
        except FolderTaken:
            # Two of a second: the other was faster, and there are more default names.
            if name is not None:
                raise
    return RecordedRun(folder, outcome, manifest)


def provenance() -> dict[str, Any]:
    """The entries of a manifest that say with what the results were made."""
    return {"git": git_state(), "versions": package_versions(), "machine": machine()}


def choice_name(composition: Composition) -> str:
    """What a run is called by default: its choices of the main groups."""
    groups = ("road_user", "path", "measurement", "tracker")
    return "-".join(composition.choices[group] for group in groups if group in composition.choices)


def stamp(time_of_day: datetime) -> str:
    """Date and time as they stand at the end of a folder's name."""
    return f"{time_of_day:%Y%m%d-%H%M%S}"


@contextmanager
def told_in_one_line() -> Iterator[None]:
    """Turn what the user can mend into a `UserError`; what is a defect passes through."""
    try:
        yield
    except (CacheError, CodeChanged, ExecutorError) as error:
        raise UserError(str(error)) from error
    except StageFailure as failure:
        # What a stage says of its input or of the machine is for the user; the rest is a defect.
        if isinstance(failure.cause, ValueError | UserError) or hasattr(failure.cause, "one_line"):
            raise UserError(f"{failure.label}: {failure.cause}") from failure
        raise
