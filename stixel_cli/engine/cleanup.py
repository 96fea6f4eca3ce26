"""Remove entries from the store: by size, by age, or all.

Entries that a running process uses are never removed: see `stixel_cli.engine.cache_folder`. Nor are
files with other names than the store makes.
"""

import os
import re
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

from filelock import Timeout

from stixel_cli.border import write_whole
from stixel_cli.engine.cache_folder import (
    collector_lock,
    file_lock,
    inside,
    leased_keys,
)
from stixel_cli.engine.entries import entry_folders, stage_and_label
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.store import REMEMBERED, REMOVALS, Store
from stixel_cli.errors import UserError
from stixel_cli.files import read_bytes

LEFT = {
    "locks": r"[0-9a-f]{64}\.lock",
    "sources": r"[0-9a-f]{32}\.py|\.?digests-[0-9a-f]{16}\.json(\.partial-\d+)?",
    "tmp": r"[0-9a-f]{16}-.+-\d+-[0-9a-f]+|gone-.+-\d+-[0-9a-f]{16}|probe-\d+-[0-9a-f]+|limit-.+",
}
"""Names of files, and of earlier versions, that a cleanup removes, by folder."""

ABANDONED = 86400.0
"""Seconds after which a file in `tmp` counts as left by a process that has ended."""

UNUSED = 90 * 86400.0
"""Seconds after the last use when a file that is no entry is removed."""


@dataclass(frozen=True)
class Removed:
    """A removed entry or file, or one that would be removed.

    Attributes:
        name: key of the entry, or name of the file.
        stage: stage of the entry; "" for other files.
        size: bytes.
        reason: `size`, `age`, `cleared` or `orphan` (of a killed process).
    """

    name: str
    stage: str
    size: int
    reason: str


@dataclass(frozen=True)
class Collection:
    """Result of a cleanup.

    Attributes:
        removed: in the order of removal.
        kept, kept_size: number and bytes of the entries that remain.
        in_use: number of entries that a running process uses.
    """

    removed: tuple[Removed, ...]
    kept: int
    kept_size: int
    in_use: int

    @property
    def removed_size(self) -> int:
        """Bytes that were removed."""
        return sum(one.size for one in self.removed)


def clear(store: Store) -> Collection:
    """Remove everything except entries that a running process uses.

    Raises:
        CacheError: the store cannot be read or written.
    """
    return collect(store, 0, cleared=True)


def keep_limit(store: Store) -> Collection | None:
    """Remove entries until the store's own limit is kept; None if there was nothing to do.

    A store that cannot be written, or that another process cleans up at this moment, is left as is.
    """
    if store.max_size is None:
        return None
    try:
        if sum(one.size for one in entry_folders(store)) <= store.max_size:
            return None
        return collect(store, store.max_size)
    except CacheError:
        return None


def collect(
    store: Store,
    max_size: int | None = None,
    older_than: float | None = None,
    dry_run: bool = False,
    cleared: bool = False,
) -> Collection:
    """Remove the files of killed processes, then entries by age, then by size.

    Args:
        store: to clean up. Entries in use stay.
        max_size: remove the least recently used entries until the rest takes at most these bytes.
        older_than: remove entries that were not used for these seconds.
        dry_run: report what would be removed, and remove nothing.
        cleared: remove all entries, with this as the reason.

    Raises:
        CacheError: the store cannot be read or written.
    """
    if not store.folder.is_dir():
        return Collection((), 0, 0, 0)
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
        orphans = list(_orphans(store, dry_run))
        found = entry_folders(store)
        size = sum(one.size for one in found)
        now = time.time()
        removed = []
        for one in found:
            old = older_than is not None and now - one.last_use > older_than
            large = cleared or (max_size is not None and size > max_size)
            if (old or large) and one.key not in used:
                stage, _ = stage_and_label(one.path)
                reason = "cleared" if cleared else "age" if old else "size"
                if dry_run or store.remove(one.key, reason):
                    removed.append(Removed(one.key, stage, one.size, reason))
                    size -= one.size
        kept = len(found) - len(removed)
        if not dry_run:
            _tidy(store, everything=kept == 0)
        in_use = sum(one.key in used for one in found)
    return Collection((*orphans, *removed), kept, size, in_use)


def _left(store: Store, folder: str) -> list[Path]:
    paths = inside(store.folder / folder)
    return [path for path in paths if re.fullmatch(LEFT[folder], path.name)]


def _orphans(store: Store, dry_run: bool) -> Iterator[Removed]:
    """Remove what killed processes left in `tmp`."""
    for path in _left(store, "tmp"):
        if not _is_orphan(path):
            continue
        files = [path, *path.rglob("*")]
        with suppress(OSError):
            size = sum(one.stat().st_size for one in files if one.is_file())
            if not dry_run:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
            yield Removed(path.name, "", size, "orphan")


def _is_orphan(path: Path) -> bool:
    """Whether the process that created it has ended; for other machines, judged by its age."""
    named = re.search(rf"-{re.escape(socket.gethostname())}-(\d+)(?:-|$)", path.name)
    try:
        if time.time() - path.stat().st_mtime > ABANDONED:
            return True
        if named is not None:
            os.kill(int(named[1]), 0)
    except (OSError, OverflowError) as error:
        return isinstance(error, ProcessLookupError)
    return False


def _tidy(store: Store, everything: bool) -> None:
    """Remove unheld locks, empty folders, old removals, and unused or all files of `sources`."""
    for path in _left(store, "locks"):
        lock = file_lock(path)
        with suppress(OSError, Timeout):
            lock.acquire(timeout=0)
            # Remove the file before the release, as `Store.lock` does.
            with suppress(OSError):
                path.unlink()
            lock.release()
    for path in _left(store, "sources"):
        with suppress(OSError):
            if everything or time.time() - path.stat().st_mtime > UNUSED:
                path.unlink()
    with suppress(OSError, UserError):
        lines = read_bytes(store.folder / REMOVALS).splitlines(keepends=True)
        write_whole(store.folder / REMOVALS, b"".join(lines[-REMEMBERED:]))
    for folder in inside(store.folder):
        # Of the first digits of keys. `Store.save` creates them.
        if re.fullmatch("[0-9a-f]{2}", folder.name):
            with suppress(OSError):
                folder.rmdir()
