"""Leases: the keys that a running process uses, which no one may remove from the cache.

A lease is a file of keys that its process holds a lock on. The system frees the lock when the
process ends, however it ends; a lease without a lock is void.
"""

import os
import socket
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.locks import file_lock, unwritable

FOLDER = "leases"
PATIENCE = 60.0
"""Seconds to wait for another process that tidies up."""


class Lease:
    """A lease of this process on entries of the cache at `folder`.

    In a cache that cannot be written nothing is leased: whoever could remove its entries does not
    come by this process.
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._path: Path | None = None
        self._lock: FileLock | None = None

    def take(self, keys: Iterable[str]) -> None:
        """Keep `keys`, whether they are there yet or not, in the place of those before."""
        name = f"{socket.gethostname()}-{os.getpid()}-{time.monotonic_ns():x}"
        path = self._folder / FOLDER / f"{name}.keys"
        with suppress(OSError, CacheError):
            path.parent.mkdir(parents=True, exist_ok=True)
            # A collector that is at it has read the leases already: wait for its end.
            with collector_lock(self._folder):
                path.write_text("\n".join(keys), encoding="ascii")
                lock = file_lock(path.with_suffix(".lock"))
                lock.acquire(timeout=0)
            self.end()
            self._path, self._lock = path, lock

    def end(self) -> None:
        """Let the keys go."""
        if self._lock is not None:
            _drop(self._path)
            self._lock.release()
            self._path = self._lock = None


@contextmanager
def lease(folder: Path, keys: Iterable[str]) -> Iterator[None]:
    """Keep `keys` in the cache at `folder` within."""
    own = Lease(folder)
    own.take(keys)
    try:
        yield
    finally:
        own.end()


@contextmanager
def collector_lock(folder: Path) -> Iterator[None]:
    """Hold the lock of those who remove entries, and of those who say what must stay.

    Raises:
        CacheError: the folder cannot be written, or another process holds the lock for long.
    """
    try:
        lock = file_lock(folder / "collector.lock")
        lock.acquire(timeout=PATIENCE)
    except Timeout as error:
        raise CacheError(
            f"another process has been tidying up the cache {folder} for {PATIENCE:.0f} s"
        ) from error
    except OSError as error:
        raise unwritable(folder, error) from error
    try:
        yield
    finally:
        lock.release()


def leased_keys(folder: Path) -> set[str]:
    """The keys that running processes use; leases of ended ones are removed.

    To be called with the collector's lock.
    """
    keys: set[str] = set()
    try:
        paths = sorted((folder / FOLDER).glob("*.keys"))
    except OSError:
        return keys
    for path in paths:
        lock = file_lock(path.with_suffix(".lock"))
        try:
            lock.acquire(timeout=0)
        except (Timeout, OSError):
            with suppress(OSError):
                keys.update(path.read_text("ascii").split())
            continue
        _drop(path)
        lock.release()
    return keys


def _drop(path: Path) -> None:
    for suffix in (".keys", ".lock"):
        with suppress(OSError):
            path.with_suffix(suffix).unlink()
