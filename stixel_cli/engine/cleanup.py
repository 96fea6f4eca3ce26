"""Remove entries from the store: by size, by age, or all.

Entries that a running process uses are never removed: see `stixel_cli.engine.cache_folder`.
"""

import json
import os
import re
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

from filelock import Timeout

from stixel_cli.border import write_whole
from stixel_cli.engine.cache_folder import (
    collector_lock,
    file_lock,
    inside,
    leased_keys,
    made_here,
    read_file,
)
from stixel_cli.engine.entries import Entry, entry_folders, stage_and_label
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.source_files import remove_sources
from stixel_cli.engine.store import Store

EVICTED = "evicted.jsonl"
REMEMBERED = 20_000
"""Number of removed keys that are remembered, to explain why a node is computed again."""

FOREIGN_AGE = 86400.0
"""Age in seconds at which an unfinished entry of another machine counts as abandoned."""


@dataclass(frozen=True)
class Removed:
    """A removed entry or file, or one that would be removed.

    Attributes:
        name: key of the entry, or name of the file.
        stage: stage of the entry; "" for other files.
        size: bytes.
        reason: `size`, `age`, `cleared`, `orphan` (of a killed process) or `set aside` (damaged).
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
        aside = list(_set_aside(store, older_than, max_size, dry_run))
        found = entry_folders(store)
        size = sum(one.size for one in found)
        now = time.time()
        removed = []
        for one in found:
            old = older_than is not None and now - one.last_use > older_than
            large = cleared or (max_size is not None and size > max_size)
            if (old or large) and one.key not in used:
                stage, _ = stage_and_label(one.path)
                if dry_run or _remove_entry(store, one):
                    reason = "cleared" if cleared else "age" if old else "size"
                    removed.append(Removed(one.key, stage, one.size, reason))
                    size -= one.size
        kept = len(found) - len(removed)
        if not dry_run:
            # Empty folders of the keys' first digits. `Store.save` creates them.
            for folder in inside(store.folder):
                if re.fullmatch("[0-9a-f]{2}", folder.name):
                    with suppress(OSError):
                        folder.rmdir()
            remove_sources(store.folder, everything=kept == 0)
            damaged = [(one.name, "damaged", when) for one, when in aside]
            _remember(store, [*damaged, *((one.name, one.reason, now) for one in removed)])
        in_use = sum(one.key in used for one in found)
    return Collection((*orphans, *(one for one, _ in aside), *removed), kept, size, in_use)


def evicted(store: Store) -> dict[str, tuple[str, float]]:
    """Reason and time of removal, by key, of entries that were removed or set aside."""
    found = []
    with suppress(OSError):
        for line in read_file(store.folder / EVICTED).decode(errors="replace").splitlines():
            with suppress(ValueError, TypeError, RecursionError):
                key, reason, when = json.loads(line)
                found.append((float(when), str(key), str(reason)))
    for path in inside(store.folder / "quarantine"):
        key, when = _aside_since(path)
        found.append((when, key, "damaged"))
    # The last reason counts: a damaged result may have been recomputed and then removed.
    found.sort(key=itemgetter(0))
    return {key: (reason, when) for when, key, reason in found}


def _remember(store: Store, removed: list[tuple[str, str, float]]) -> None:
    """Append key, reason and time of removal to the file that `evicted` reads, if possible."""
    if not removed:
        return
    path = store.folder / EVICTED
    with suppress(OSError):
        lines = read_file(path).decode(errors="replace").splitlines() if path.exists() else []
        lines += [json.dumps([key, reason, round(when, 3)]) for key, reason, when in removed]
        write_whole(path, "\n".join(lines[-REMEMBERED:]) + "\n")


def _remove_entry(store: Store, one: Entry) -> bool:
    """Move an entry away, then remove it, so that no reader sees half of it."""
    away = store.folder / "tmp" / f"gone-{socket.gethostname()}-{os.getpid()}-{one.key[:16]}"
    try:
        one.path.rename(away)
    except OSError:
        return False
    shutil.rmtree(away, ignore_errors=True)
    return True


def _orphans(store: Store, dry_run: bool) -> Iterator[Removed]:
    """Remove what killed processes left behind: partial entries and lock files."""
    for path in inside(store.folder / "tmp"):
        if made_here(path) and _is_orphan(path):
            size = _remove(path, dry_run)
            if size is not None:
                yield Removed(path.name, "", size, "orphan")
    if dry_run:
        return
    for path in inside(store.folder / "locks"):
        if made_here(path):
            lock = file_lock(path)
            with suppress(OSError, Timeout):
                lock.acquire(timeout=0)
                # Remove the file before the release, as `Store.lock` does.
                with suppress(OSError):
                    path.unlink()
                lock.release()


def _set_aside(
    store: Store, older_than: float | None, max_size: int | None, dry_run: bool
) -> Iterator[tuple[Removed, float]]:
    """Remove damaged entries, each with the time since when it is set aside."""
    for path in filter(made_here, inside(store.folder / "quarantine")):
        with suppress(OSError):
            age = time.time() - path.stat().st_mtime
            if max_size is None and (older_than is None or age <= older_than):
                continue
            size = _remove(path, dry_run)
            if size is not None:
                key, when = _aside_since(path)
                yield Removed(key, "", size, "set aside"), when


def _is_orphan(path: Path) -> bool:
    """Whether the process that created it has ended; for other machines, judged by its age."""
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > FOREIGN_AGE:
            return True
    named = re.search(rf"-{re.escape(socket.gethostname())}-(\d+)(?:-|$)", path.name)
    if named is None:
        return False
    try:
        os.kill(int(named[1]), 0)
    except (OSError, OverflowError) as error:
        return isinstance(error, ProcessLookupError)
    return False


def _remove(path: Path, dry_run: bool) -> int | None:
    """Remove a file or folder; its bytes, or None if it is still there without a `dry_run`."""
    size = 0
    for one in [path, *path.rglob("*")]:
        with suppress(OSError):
            size += one.stat().st_size if one.is_file() else 0
    if dry_run:
        return size
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()
    return None if path.exists() else size


def _aside_since(path: Path) -> tuple[str, float]:
    """Key of an entry that was set aside, and the time when that happened."""
    key, _, when = path.name.partition("-")
    with suppress(ValueError):
        return key, int(when, 10) / 1e9
    return key, 0.0
