"""List and verify the entries of the store."""

import json
import os
import re
from collections.abc import Callable, Container, Iterator
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
            # `verify_all` reports a file that is missing.
            with suppress(OSError), os.scandir(entry.path) as files:
                sizes = [f.stat().st_size for f in files if f.is_file(follow_symlinks=False)]
                last_use = entry.stat().st_mtime
                found.append(Entry(entry.name, Path(entry.path), sum(sizes), last_use))
    return sorted(found, key=lambda one: (one.last_use, one.key))


def entries(store: Store, on_damaged: Callable[[MissingEntry], None] | None = None) -> list[Entry]:
    """List all entries, least recently used first.

    Entries with damaged notes are left out, removed if possible, and passed to `on_damaged`.

    Raises:
        CacheError: the store cannot be read.
    """
    found = []
    for one in entry_folders(store):
        try:
            notes = store.meta(one.key)
        except MissingEntry as fault:
            # An entry that another process has removed meanwhile is not damaged.
            if on_damaged is not None and (fault.removed or store.entry(one.key).exists()):
                on_damaged(fault)
            continue
        stage, label = (str(notes.get(name, "?")) for name in ("stage", "label"))
        found.append(replace(one, stage=stage, label=label))
    return found


def stage_and_label(entry: Path) -> tuple[str, str]:
    """Stage and label in the notes of an entry, found without parsing them; "?" if unreadable."""
    with suppress(UserError, ValueError, TypeError):
        notes = read_bytes(entry / META)
        return json.loads(_STAGE.search(notes)[1]), json.loads(_LABEL.search(notes)[1])
    return "?", "?"


def verify_all(
    store: Store, progress: Callable[[int, int], None] | None = None
) -> list[tuple[Entry, str]]:
    """Read every entry; remove damaged entries and return them, each with the reason.

    `progress` is called after each entry with the number of entries read and of all entries.

    Raises:
        CacheError: the store cannot be read, or a damaged entry cannot be removed.
    """
    found = entry_folders(store)
    damaged = []
    for done, one in enumerate(found, 1):
        stage, label = stage_and_label(one.path)
        try:
            store.check(one.key)
        except MissingEntry as error:
            # An entry that another process has removed meanwhile is not damaged.
            if error.removed:
                damaged.append((replace(one, stage=stage, label=label), error.reason))
            elif store.entry(one.key).exists():
                raise CacheError(
                    f"{label} in {store.folder} is damaged ({error.reason}) and cannot be removed"
                ) from error
        if progress is not None:
            progress(done, len(found))
    return damaged


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
