"""File locks, and leases on entries that a running process uses.

The operating system releases a file lock when its process ends, even if the process is killed. A
lease is a file of keys whose process holds a lock on it; a lease without a lock is void.
"""

import errno
import os
import socket
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from stixel_cli.engine.cache_folder import make_folder, read_file
from stixel_cli.engine.errors import CacheError

_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)


def file_lock(path: Path) -> FileLock:
    """Return a lock on the file `path`, not acquired yet.

    `acquire` raises OSError on a file system without locks. The library's fallback, a file that
    exists while its process runs, would survive a killed process.
    """
    return FileLock(path, fallback_to_soft=False)


def unwritable(folder: Path, error: OSError) -> CacheError:
    """Error for a cache at `folder` in which a file cannot be written or locked."""
    if error.errno in _NO_LOCKS:
        return CacheError(
            f"the file system of the cache {folder} does not support locks (flock): mount it with "
            "locks, or choose another folder"
        )
    return CacheError(f"cannot write in the cache {folder}: {error.strerror or error}")


LEASES = "leases"
PATIENCE = 60.0
"""Seconds to wait for another process that cleans up."""


class Lease:
    """A lease of this process on entries of the cache at `folder`.

    In a cache that is read-only nothing is leased: no other process can remove its entries.
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._path: Path | None = None
        self._lock: FileLock | None = None

    def take(self, keys: Iterable[str]) -> None:
        """Lease `keys` instead of the previous ones. Their entries may not exist yet."""
        name = f"{socket.gethostname()}-{os.getpid()}-{time.monotonic_ns():x}"
        path = self._folder / LEASES / f"{name}.keys"
        with suppress(OSError, CacheError):
            make_folder(self._folder, LEASES)
            # A cleanup that has started has read the leases already: wait for its end.
            with collector_lock(self._folder):
                path.write_text("\n".join(keys), encoding="ascii")
                lock = file_lock(path.with_suffix(".lock"))
                lock.acquire(timeout=0)
            self.end()
            self._path, self._lock = path, lock

    def end(self) -> None:
        """End the lease."""
        if self._lock is not None:
            _drop(self._path)
            self._lock.release()
            self._path = self._lock = None


@contextmanager
def lease(folder: Path, keys: Iterable[str]) -> Iterator[None]:
    """Lease `keys` in the cache at `folder` inside the `with` block."""
    own = Lease(folder)
    own.take(keys)
    try:
        yield
    finally:
        own.end()


@contextmanager
def collector_lock(folder: Path) -> Iterator[None]:
    """Acquire the lock that every cleanup and every new lease needs.

    Raises:
        CacheError: the folder cannot be written, or another process keeps the lock for too long.
    """
    try:
        lock = file_lock(folder / "collector.lock")
        lock.acquire(timeout=PATIENCE)
    except Timeout as error:
        raise CacheError(
            f"another process has been cleaning the cache {folder} for {PATIENCE:.0f} s"
        ) from error
    except OSError as error:
        raise unwritable(folder, error) from error
    try:
        yield
    finally:
        lock.release()


def leased_keys(folder: Path) -> set[str]:
    """Return the keys that running processes use, and remove the leases of ended processes.

    Requires `collector_lock`.
    """
    keys: set[str] = set()
    try:
        paths = sorted((folder / LEASES).glob("*.keys"))
    except OSError:
        return keys
    for path in paths:
        lock = file_lock(path.with_suffix(".lock"))
        try:
            lock.acquire(timeout=0)
        except (Timeout, OSError):
            with suppress(OSError):
                keys.update(read_file(path).decode("ascii").split())
            continue
        _drop(path)
        lock.release()
    return keys


def _drop(path: Path) -> None:
    for suffix in (".keys", ".lock"):
        with suppress(OSError):
            path.with_suffix(suffix).unlink()
