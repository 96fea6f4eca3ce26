"""List and verify the entries of the store."""

import json
import os
import re
from collections.abc import Container, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.store import META, Store
from stixel_cli.errors import UserError
from stixel_cli.files import read_bytes

COMPARED = 2000
"""Maximum number of notes per stage that `stored_notes` yields."""

_KEY = re.compile(r"[0-9a-f]{64}")
_STAGE = re.compile(rb'"stage": ("(?:[^"\\]|\\.)*")')
_LABEL = re.compile(rb'"label": ("(?:[^"\\]|\\.)*")')


@dataclass(frozen=True)
class Entry:
    """An entry; `size` in bytes, `last_use` in seconds since the epoch.

    `entry_folders` reads neither `stage` nor `label`.
    """

    key: str
    path: Path
    size: int
    last_use: float
    stage: str = "?"
    label: str = "?"


def entry_folders(store: Store) -> list[Entry]:
    """List the folders of all entries, least recently used first, without reading a file.

    Raises:
        CacheError: the store cannot be read.
    """
    found = []
    for prefix in _folders(store.folder):
        if len(prefix.name) != 2:
            continue
        for entry in _folders(Path(prefix)):
            if not _KEY.fullmatch(entry.name):
                continue
            # `entries` reports a file that is missing.
            with suppress(OSError), os.scandir(entry.path) as files:
                sizes = [f.stat().st_size for f in files if f.is_file(follow_symlinks=False)]
                last_use = entry.stat().st_mtime
                found.append(Entry(entry.name, Path(entry.path), sum(sizes), last_use))
    return sorted(found, key=lambda one: (one.last_use, one.key))


def entries(
    store: Store, damaged: list[tuple[Entry, MissingEntry]] | None = None, values: bool = False
) -> list[Entry]:
    """List all entries whose notes, and `values`, are not damaged, least recently used first.

    Damaged entries are removed, if possible, and added to the list `damaged`.

    Raises:
        CacheError: the store cannot be read.
    """
    found = []
    for folder in entry_folders(store):
        stage, label = stage_and_label(folder.path)
        entry = replace(folder, stage=stage, label=label)
        try:
            store.check(entry.key) if values else store.meta(entry.key)
            found.append(entry)
        except MissingEntry as fault:
            # An entry that another process has removed meanwhile is not damaged.
            if damaged is not None and (fault.removed or entry.path.exists()):
                damaged.append((entry, fault))
    return found


def stage_and_label(entry: Path) -> tuple[str, str]:
    """Stage and label in the notes of an entry, found without parsing them; "?" if unreadable."""
    with suppress(UserError, ValueError, TypeError):
        notes = read_bytes(entry / META)
        return json.loads(_STAGE.search(notes)[1]), json.loads(_LABEL.search(notes)[1])
    return "?", "?"


def stored_notes(
    store: Store, stages: Container[str], keys: Container[str]
) -> Iterator[dict[str, Any]]:
    """Yield the notes of `keys` and of the last entries of `stages`, most recently used first.

    Raises:
        CacheError: the store cannot be read.
    """
    counts: dict[str, int] = {}
    for one in reversed(entry_folders(store)):
        stage, _ = stage_and_label(one.path)
        counts[stage] = counts.get(stage, 0) + 1
        if one.key in keys or (stage in stages and counts[stage] <= COMPARED):
            with suppress(MissingEntry):
                yield store.meta(one.key)


def _folders(folder: Path) -> list[os.DirEntry]:
    try:
        with os.scandir(folder) as found:
            return [one for one in found if one.is_dir(follow_symlinks=False)]
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise CacheError(f"cannot read the cache {folder}: {error.strerror or error}") from error
