"""Upkeep of the cache: what is in it, what may go, what is damaged.

What a running process uses is never removed: each execution names its keys in a *lease*, a file
that it holds a lock on. The system frees the lock of a killed process, so its lease is void.
"""

from collections.abc import Callable, Container, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.listing import scan, stage_and_label
from stixel_cli.engine.removal import Collection, remove
from stixel_cli.engine.store import META, Store

COMPARED = 2000
"""So many results of a stage are looked at for the nearest."""


@dataclass(frozen=True)
class Entry:
    """A result in the cache; `created` and `last_use` in seconds since the epoch, size in bytes."""

    key: str
    stage: str
    label: str
    size: int
    last_use: float
    created: float


def entries(store: Store, on_damaged: Callable[[MissingEntry], None] | None = None) -> list[Entry]:
    """All results in the cache, least recently used first.

    Those with damaged notes are left out, and set aside where that can be done; `on_damaged` is
    told of each.

    Raises:
        CacheError: it cannot be read.
    """
    found = []
    for one in scan(store):
        try:
            notes = store.meta(one.key)
        except MissingEntry as fault:
            # One that was removed meanwhile is not damaged.
            if on_damaged is not None and (fault.set_aside or store.entry(one.key).exists()):
                on_damaged(fault)
            continue
        found.append(
            Entry(
                key=one.key,
                stage=str(notes.get("stage", "?")),
                label=str(notes.get("label", "?")),
                size=one.size,
                last_use=one.last_use,
                created=float(notes.get("created", one.last_use)),
            )
        )
    return found


def collect(
    store: Store,
    max_size: int | None = None,
    older_than: float | None = None,
    dry_run: bool = False,
) -> Collection:
    """Remove what killed processes left, what was not used for `older_than` seconds, and then the
    least recently used until all takes at most `max_size` bytes. Results in use stay.

    Raises:
        CacheError: the cache cannot be read or written.
    """
    return remove(store, max_size, older_than, "", dry_run)


def clear(store: Store) -> Collection:
    """Remove all but what a running process uses.

    Raises:
        CacheError: the cache cannot be read or written.
    """
    return remove(store, 0, None, "cleared", False)


def verify_all(
    store: Store, progress: Callable[[int, int], None] | None = None
) -> list[tuple[Entry, str]]:
    """Read every entry; those that are not what was stored, with the reason. They are set aside.

    `progress` is told after each entry how many are done and how many there are.

    Raises:
        CacheError: the cache cannot be read, or a bad entry cannot be set aside.
    """
    found = scan(store)
    bad = []
    for done, one in enumerate(found, 1):
        stage, label = stage_and_label(store.entry(one.key) / META)
        try:
            store.check(one.key)
        except MissingEntry as error:
            # One that was removed meanwhile is not bad.
            if error.set_aside:
                entry = Entry(one.key, stage, label, one.size, one.last_use, one.last_use)
                bad.append((entry, error.reason))
            elif store.entry(one.key).exists():
                raise CacheError(
                    f"{label} in {store.folder} is bad ({error.reason}) and cannot be set aside"
                ) from error
        if progress is not None:
            progress(done, len(found))
    return bad


def keep_limit(store: Store) -> Collection | None:
    """Keep the store's own limit, if it has one; None if there was nothing to do.

    A cache that cannot be written, or that another process tidies up at this moment, is left.
    """
    if store.max_size is None:
        return None
    try:
        if sum(one.size for one in scan(store)) <= store.max_size:
            return None
        return collect(store, store.max_size)
    except CacheError:
        return None


def set_aside(store: Store) -> int:
    """How many damaged results were set aside, and are kept until space or age is asked for."""
    try:
        return sum(1 for _ in (store.folder / "quarantine").iterdir())
    except OSError:
        return 0


def stored_notes(store: Store, stages: Container[str]) -> Iterator[dict[str, Any]]:
    """The notes of the results of `stages`, at most some thousand of the last used of each.

    Raises:
        CacheError: the cache cannot be read.
    """
    counts: dict[str, int] = {}
    for one in reversed(scan(store)):
        stage, _ = stage_and_label(one.path / META)
        counts[stage] = counts.get(stage, 0) + 1
        if stage in stages and counts[stage] <= COMPARED:
            with suppress(MissingEntry):
                yield store.meta(one.key)
