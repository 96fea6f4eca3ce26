"""Going on with a sweep elsewhere: another executor, another cache, and the note of it."""

import os
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.config import messages
from stixel_cli.config.override_text import override_text
from stixel_cli.config.overrides import check_overrides, parse_overrides
from stixel_cli.errors import ConfigurationError
from stixel_cli.experiment.stored_run import OF_THE_MACHINE
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest
from stixel_cli.sweeps.graphs import SweepPlan

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override


def on_this_machine(
    runs: Sequence[Sequence[str]], overrides: Sequence[str]
) -> list[tuple[str, ...]]:
    """The overrides of each run, with those of executor and cache that are given in their place.

    The option of a group takes the place of all that the runs say of the group: its keys may
    not be those of another.

    Raises:
        ConfigurationError: in one line, for an override of any other group, or of several values.
    """
    parsed = parse_overrides(overrides)
    for override in parsed:
        if override.key_or_group.partition(".")[0] not in OF_THE_MACHINE:
            line = messages.printable(str(override.input_line))
            raise ConfigurationError(
                f"{line}: --resume goes on with what the folder asks for: only keys of "
                f"{' and '.join(OF_THE_MACHINE)} can be given, on which no result depends"
            )
        if override.is_sweep_override():
            line = messages.printable(str(override.input_line))
            raise ConfigurationError(f"{line}: --resume: one value is needed")
    check_overrides(parsed)
    names = {override.key_or_group for override in parsed}
    given = [_as_meant_here(override) for override in parsed]
    return [(*(text for text in texts if not _replaced(text, names)), *given) for texts in runs]


def _as_meant_here(override: "Override") -> str:
    """The text of an override; a folder in full, for the runs' own names are meant elsewhere."""
    folder = override.value()
    if override.key_or_group == "cache.folder" and isinstance(folder, str) and folder:
        in_full = os.path.abspath(os.path.expanduser(folder))
        if in_full != folder:
            return override_text("cache.folder", in_full)
    return str(override.input_line)


def _replaced(text: str, names: set[str]) -> bool:
    key = text.partition("=")[0].strip().lstrip("+")
    return key in names or key.partition(".")[0] in names


def resume_words(path: Path, overrides: Sequence[str] = ()) -> str:
    """The command line that goes on with a sweep."""
    return shlex.join(["stixel", "sweep", "--resume", str(path), *overrides])


def note_resumed(
    folder: SweepFolder,
    request: SweepRequest,
    plan: SweepPlan,
    command: str,
    origin: dict[str, Any],
) -> None:
    """Write into `sweep.yaml` that the sweep is gone on with, if something of it is not there.

    Raises:
        UserError: if it cannot be written.
    """
    missing = set(plan.missing)
    if all(
        folder.stored(one.run.index, one.targets) is not None and missing.isdisjoint(one.beside)
        for one in plan.runs
    ):
        return
    before = request.notes.get("resumed")
    entry = {"time": origin["created"], "command": command, "revision": origin["git"]["revision"]}
    resumed = [*(before if isinstance(before, list) else ()), entry]
    folder.write_request(replace(request, notes={**request.notes, "resumed": resumed}))
