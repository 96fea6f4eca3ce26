"""Entries of the store: list and verify them; remove them by age and size, and what was left.

All raise CacheError if the store cannot be read; what removes, if it cannot be written either.
"""

import os
import re
import shutil
import time
from collections.abc import Container, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from filelock import Timeout

from stixel_cli.engine.cache_folder import collector_lock, file_lock, inside, leased_keys
from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.source_files import SOURCES
from stixel_cli.engine.store import Store

COMPARED = 2000
"""Maximum number of notes per stage that `stored_notes` yields."""

_KEY = "[0-9a-f]" * 64
"""A pattern of regular expressions and of `glob`."""


@dataclass(frozen=True)
class Entry:
    """An entry; `size` in bytes, `last_use` in seconds since the epoch.

    `stage` and `label` are those of its notes; `entry_folders` reads neither.
    """

    key: str
    path: Path
    size: int
    last_use: float
    stage: str = "?"
    label: str = "?"


def entry_folders(store: Store) -> list[Entry]:
    """List the folders of all entries, least recently used first, without reading a file."""
    found = []
    prefixes = (Path(one) for one in _folders(store.folder) if len(one.name) == 2)
    for entry in (one for prefix in prefixes for one in _folders(prefix)):
        # `entries` reports a file that is missing.
        with suppress(OSError), os.scandir(entry.path) as files:
            sizes = [f.stat().st_size for f in files if f.is_file(follow_symlinks=False)]
            last_use = entry.stat().st_mtime
            if re.fullmatch(_KEY, entry.name):
                found.append(Entry(entry.name, Path(entry.path), sum(sizes), last_use))
    return sorted(found, key=lambda one: (one.last_use, one.key))


def entries(
    store: Store, damaged: list[tuple[Entry, MissingEntry]] | None = None, values: bool = False
) -> list[Entry]:
    """List all entries whose notes, and `values`, are not damaged, least recently used first.

    Damaged entries are removed, if possible, and added to the list `damaged`.
    """
    found = []
    for folder in entry_folders(store):
        entry = folder
        try:
            notes = store.meta(folder.key)
            entry = replace(folder, stage=notes["stage"], label=notes["label"])
            if values:
                store.checked(entry.key)
            found.append(entry)
        except MissingEntry as fault:
            # An entry that another process has removed meanwhile is not damaged.
            if damaged is not None and (fault.removed or entry.path.exists()):
                damaged.append((entry, fault))
    return found


def stored_notes(
    store: Store, stages: Container[str], keys: Container[str]
) -> Iterator[dict[str, Any]]:
    """Yield the notes of `keys` and of the last entries of `stages`, most recently used first."""
    counts: dict[str, int] = {}
    for one in reversed(entry_folders(store)):
        with suppress(MissingEntry):
            notes = store.meta(one.key)
            stage = notes["stage"]
            counts[stage] = counts.get(stage, 0) + 1
            if one.key in keys or (stage in stages and counts[stage] <= COMPARED):
                yield notes


def _folders(folder: Path) -> list[os.DirEntry]:
    try:
        with os.scandir(folder) as found:
            return [one for one in found if one.is_dir(follow_symlinks=False)]
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise CacheError(f"cannot read the cache {folder}: {error.strerror or error}") from error


_HOUR, _DAY = 3600.0, 86400.0

LEFT = (
    # To write a result takes less than an hour; a killed process leaves gigabytes.
    ("tmp", r"([0-9a-f]{16}|gone|probe)-.+-\d+-[0-9a-f]+", _HOUR),
    ("tmp", r"limit-.+", _DAY),
    (".", r"evicted\.jsonl", _HOUR),
    (SOURCES, r"[0-9a-f]{32}\.py|\.?digests-[0-9a-f]{16}\.json(\.partial-\d+)?", 90 * _DAY),
    ("configurations", r"[0-9a-f]{64}\.json", 90 * _DAY),
)
"""Folder, names of files, also of earlier versions, and seconds after which they are removed."""


@dataclass(frozen=True)
class Collection:
    """Result of a cleanup."""

    removed: int
    removed_size: int
    """`removed`, `removed_size`: number and bytes of the entries that were, or would be,
    removed."""
    kept: int
    kept_size: int
    """`kept`, `kept_size`: number and bytes of the entries that remain."""
    in_use: int
    """Number of entries that a running process uses."""
    left: int
    left_size: int
    """`left`, `left_size`: number and bytes of the files of killed processes and earlier versions
    that were, or would be, removed, too."""


def keep_limit(store: Store) -> None:
    """Remove entries until the store's own limit is kept.

    A store that cannot be written, or that another process cleans up at this moment, is left as is.
    """
    if store.max_size is None:
        return
    with suppress(CacheError):
        if sum(one.size for one in entry_folders(store)) > store.max_size:
            collect(store, store.max_size)


def collect(
    store: Store,
    max_size: int | None = None,
    older_than: float | None = None,
    dry_run: bool = False,
) -> Collection:
    """Remove old files of killed processes, then entries by age, then by size.

    Args:
        store: to clean up. Entries in use stay.
        max_size: remove the least recently used entries until the rest takes at most these bytes;
            with 0 all, and the digests of source files.
        older_than: remove entries that were not used for these seconds.
        dry_run: report what would be removed, and remove nothing.
    """
    if not store.folder.is_dir():
        return Collection(0, 0, 0, 0, 0, 0, 0)
    if not dry_run:
        store.check_writable()
    with ExitStack() as held:
        try:
            held.enter_context(collector_lock(store.folder))
        except CacheError:
            # A dry run also works on a store that is read-only.
            if not dry_run:
                raise
        used = leased_keys(store.folder)
        found = entry_folders(store)
        whole = size = sum(one.size for one in found)
        now, kept = time.time(), len(found)
        for one in found:
            old = older_than is not None and now - one.last_use > older_than
            large = max_size is not None and (size > max_size or max_size == 0)
            if (old or large) and one.key not in used and (dry_run or store.remove(one.key)):
                size -= one.size
                kept -= 1
        left = dict(_leftovers(store, everything=max_size == 0))
        if not dry_run:
            for path in left:
                with suppress(OSError):
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
            _tidy(store)
        in_use = sum(one.key in used for one in found)
    sizes = whole - size, kept, size, in_use
    return Collection(len(found) - kept, *sizes, len(left), sum(left.values()))


def _leftovers(store: Store, everything: bool) -> Iterator[tuple[Path, int]]:
    """What is `LEFT`, with its bytes; with `everything` new digests too."""
    for folder, names, seconds in LEFT:
        least = 0.0 if everything and folder == SOURCES else seconds
        for path in inside(store.folder / folder):
            with suppress(OSError):
                if re.fullmatch(names, path.name) and time.time() - path.stat().st_mtime >= least:
                    files = [path, *path.rglob("*")] if path.is_dir() else [path]
                    yield path, sum(file.stat().st_size for file in files if file.is_file())


def _tidy(store: Store) -> None:
    """Remove unheld locks and empty folders."""
    for path in (store.folder / "locks").glob(f"{_KEY}.lock"):
        lock = file_lock(path)
        with suppress(OSError, Timeout):
            lock.acquire(timeout=0)
            # Remove the file before the release, as `Store.lock` does.
            with suppress(OSError):
                path.unlink()
            lock.release()
    # Of the first digits of keys. `Store.save` creates them.
    for folder in store.folder.glob("[0-9a-f]" * 2):
        with suppress(OSError):
            folder.rmdir()
