"""List the result folders below a folder."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from stixel_cli.errors import UserError, printable_path
from stixel_cli.results.reader import SWEEP_FILE, read_manifest, read_metrics

DEEPEST = 4
"""Depth of the search below the folder."""


@dataclass(frozen=True)
class ListedRun:
    """One line of the list.

    Attributes:
        path: the folder.
        kind: `run` or `sweep`.
        created: date and time, "" if unknown.
        choices: the options of the main groups.
        seed: None if unknown.
        metrics: of the run; empty for a sweep.
        fault: why it cannot be read, in one line; None if it can be read.
    """

    path: Path
    kind: str
    created: str
    choices: str
    seed: int | None
    metrics: dict[str, float | int | None]
    fault: str | None


def list_runs(root: Path) -> list[ListedRun]:
    """The result folders below `root`, oldest first; a sweep is one entry, without its runs.

    Raises:
        UserError: if the folder does not exist or cannot be read.
    """
    if not root.is_dir():
        raise UserError(f"{printable_path(root)}: no such folder")
    try:
        os.listdir(root)
    except OSError as error:
        raise UserError(f"{root}: cannot be read: {error.strerror}") from error
    found = [_listed(folder, kind) for folder, kind in _find(root, 0)]
    return sorted(found, key=lambda run: (run.created, run.path))


def _find(folder: Path, depth: int) -> Iterator[tuple[Path, str]]:
    try:
        with os.scandir(folder) as entries:
            inside = {entry.name: entry.is_dir(follow_symlinks=False) for entry in entries}
    except OSError:
        return
    if "manifest.json" in inside:
        yield folder, "run"
    elif SWEEP_FILE in inside and depth > 0:
        yield folder, "sweep"
    elif depth < DEEPEST:
        for name in sorted(name for name, is_folder in inside.items() if is_folder):
            # A name that begins with a dot is unfinished or of another program.
            if not name.startswith("."):
                yield from _find(folder / name, depth + 1)


def _listed(folder: Path, kind: str) -> ListedRun:
    if kind == "sweep":
        return ListedRun(folder, kind, _modified(folder / SWEEP_FILE), "", None, {}, None)
    try:
        manifest, metrics = read_manifest(folder), read_metrics(folder)
    except UserError as fault:
        return ListedRun(folder, kind, "", "", None, {}, str(fault))
    choices = manifest.get("choices")
    choices = choices if isinstance(choices, dict) else {}
    groups = ("road_user", "path", "measurement", "tracker")
    seed = manifest.get("seed")
    return ListedRun(
        folder,
        kind,
        str(manifest.get("created", "")),
        " ".join(str(choices[group]) for group in groups if group in choices),
        seed if isinstance(seed, int) else None,
        metrics,
        None,
    )


def _modified(file: Path) -> str:
    from datetime import UTC, datetime

    try:
        return datetime.fromtimestamp(file.stat().st_mtime, UTC).isoformat(timespec="seconds")
    except OSError:
        return ""
