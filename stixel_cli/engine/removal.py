"""What may be removed from the cache, and the removing."""

import json
import os
import re
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from filelock import Timeout

from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.leases import collector_lock, leased_keys
from stixel_cli.engine.listing import Found, scan, stage_and_label
from stixel_cli.engine.locks import file_lock
from stixel_cli.engine.sources import remove_sources
from stixel_cli.engine.store import META, Store

EVICTED = "evicted.jsonl"
REMEMBERED = 20_000
"""So many removed keys are remembered, to answer why a node runs again."""

FOREIGN_AGE = 86400.0
"""Seconds after which what another machine has begun and not finished counts as given up."""


@dataclass(frozen=True)
class Removed:
    """One thing that was removed, or would be.

    Attributes:
        name: key of the entry, or the file's name.
        stage: of the entry; "" for what is none.
        size: bytes.
        reason: `size`, `age`, `cleared`, `orphan` (of a killed process) or `set aside` (damaged).
    """

    name: str
    stage: str
    size: int
    reason: str


@dataclass(frozen=True)
class Collection:
    """What a collection removed, and what it left.

    Attributes:
        removed: in the order of removal.
        kept, kept_size: number and bytes of the entries that are left.
        in_use: how many of them a running process uses.
    """

    removed: tuple[Removed, ...]
    kept: int
    kept_size: int
    in_use: int

    @property
    def removed_size(self) -> int:
        """Bytes that were removed."""
        return sum(one.size for one in self.removed)


def remove(
    store: Store, max_size: int | None, older_than: float | None, word: str, dry_run: bool
) -> Collection:
    """See `collect`; `word` is the reason to note, where it is not space or age.

    Raises:
        CacheError: the cache cannot be read or written.
    """
    if not store.folder.is_dir():
        return Collection((), 0, 0, 0)
    if not dry_run:
        store.check_writable()
    with _collecting(store.folder, dry_run):
        used = leased_keys(store.folder)
        orphans = list(_orphans(store, dry_run))
        aside = list(_set_aside(store, older_than, max_size, dry_run))
        found = scan(store)
        size = sum(one.size for one in found)
        now = time.time()
        kept = 0
        gone = []
        for one in found:
            old = older_than is not None and now - one.last_use > older_than
            large = max_size is not None and (size > max_size or word == "cleared")
            if (old or large) and one.key not in used:
                stage, _ = stage_and_label(one.path / META)
                if dry_run or _remove_entry(store, one):
                    reason = word or ("age" if old else "size")
                    gone.append(Removed(one.key, stage, one.size, reason))
                    size -= one.size
                    continue
            kept += 1
        if not dry_run:
            _remove_empty(store)
            remove_sources(store.folder, everything=kept == 0)
        if not dry_run:
            damaged = [(one.name, "damaged", when) for one, when in aside]
            _remember(store, [*damaged, *((one.name, one.reason, now) for one in gone)])
        in_use = sum(one.key in used for one in found)
    return Collection((*orphans, *(one for one, _ in aside), *gone), kept, size, in_use)


@contextmanager
def _collecting(folder: Path, dry_run: bool) -> Iterator[None]:
    """Hold the collector's lock; to look only, as in a cache that is read-only, do without."""
    with ExitStack() as held:
        try:
            held.enter_context(collector_lock(folder))
        except CacheError:
            if not dry_run:
                raise
        yield


def _remove_empty(store: Store) -> None:
    """Remove the folders of the keys' first digits that hold nothing. Who stores makes them."""
    for folder in _inside(store.folder):
        if len(folder.name) == 2:
            with suppress(OSError):
                folder.rmdir()


def _remove_entry(store: Store, one: Found) -> bool:
    """Take an entry out of its place at once, then remove it, so that no reader sees half of it."""
    away = store.folder / "tmp" / f"gone-{socket.gethostname()}-{os.getpid()}-{one.key[:16]}"
    try:
        one.path.rename(away)
    except OSError:
        return False
    shutil.rmtree(away, ignore_errors=True)
    return True


def _orphans(store: Store, dry_run: bool) -> Iterator[Removed]:
    """What killed processes left: entries half written, locks."""
    for path in _inside(store.folder / "tmp"):
        if _is_orphan(path):
            size = _size(path)
            if dry_run or _remove(path):
                yield Removed(path.name, "", size, "orphan")
    for path in _inside(store.folder / "locks"):
        if not path.name.endswith(".lock"):
            continue
        if dry_run:
            continue
        lock = file_lock(path)
        with suppress(OSError, Timeout):
            lock.acquire(timeout=0)
            # Removed while it is held, as the store does it.
            with suppress(OSError):
                path.unlink()
            lock.release()


def _set_aside(
    store: Store, older_than: float | None, max_size: int | None, dry_run: bool
) -> Iterator[tuple[Removed, float]]:
    """Damaged entries, kept for a look at them until space or age is asked for; and since when."""
    for path in _inside(store.folder / "quarantine"):
        with suppress(OSError):
            age = time.time() - path.stat().st_mtime
            if max_size is None and (older_than is None or age <= older_than):
                continue
            size = _size(path)
            if dry_run or _remove(path):
                key, when = _aside_since(path)
                yield Removed(key, "", size, "set aside"), when


def _is_orphan(path: Path) -> bool:
    """Whether who made it is gone: a process of this machine by its id, others by the age."""
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > FOREIGN_AGE:
            return True
    named = re.search(rf"-{re.escape(socket.gethostname())}-(\d+)(?:-|$)", path.name)
    if named is None:
        return False
    try:
        os.kill(int(named[1]), 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        pass
    return False


def _inside(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def _size(path: Path) -> int:
    total = 0
    for one in [path, *path.rglob("*")]:
        with suppress(OSError):
            total += one.stat().st_size if one.is_file() else 0
    return total


def _remove(path: Path) -> bool:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()
    return not path.exists()


def _aside_since(path: Path) -> tuple[str, float]:
    """The key of an entry that was set aside, and when that was."""
    key, _, when = path.name.partition("-")
    with suppress(ValueError):
        return key, int(when, 10) / 1e9
    return key, 0.0


def _remember(store: Store, gone: list[tuple[str, str, float]]) -> None:
    """Note keys that were removed, why and when. A convenience: nothing is lost without it."""
    if not gone:
        return
    path = store.folder / EVICTED
    with suppress(OSError):
        lines = path.read_text("utf-8").splitlines() if path.exists() else []
        lines += [json.dumps([key, reason, round(when, 3)]) for key, reason, when in gone]
        partial = path.with_name(f"{EVICTED}-{os.getpid()}")
        partial.write_text("\n".join(lines[-REMEMBERED:]) + "\n", "utf-8")
        partial.replace(path)


def evicted(store: Store) -> dict[str, tuple[str, float]]:
    """The reason and the time of removal of keys that were removed and are not there now."""
    found: dict[str, tuple[str, float]] = {}

    def note(key: str, reason: str, when: float) -> None:
        # What came last counts: a damaged result may have been computed again, and then removed.
        if key not in found or found[key][1] <= when:
            found[key] = (reason, when)

    with suppress(OSError):
        for line in (store.folder / EVICTED).read_text("utf-8").splitlines():
            with suppress(ValueError, TypeError):
                key, reason, when = json.loads(line)
                note(key, reason, when)
    for path in _inside(store.folder / "quarantine"):
        key, when = _aside_since(path)
        note(key, "damaged", when)
    return found
