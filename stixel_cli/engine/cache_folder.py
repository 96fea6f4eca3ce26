"""The folder of the cache: its owner, and how its files are locked and leased.

Whoever creates the folder marks it with a file `CACHEDIR.TAG` (https://bford.info/cachedir/), whose
second line names this program. A folder of the user's with other files is never used, so that no
cleanup can remove them.

The operating system releases a file lock when its process ends, even if the process is killed. A
lease is a file of keys whose process holds a lock on it; a lease without a lock is void.
"""

import json
import os
import socket
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.border.files import read_bytes
from stixel_cli.border.origins import write_whole
from stixel_cli.engine.errors import CacheError, writing
from stixel_cli.errors import UserError, printable

if TYPE_CHECKING:
    from filelock import FileLock

MARK = "CACHEDIR.TAG"
_SIGNATURE, _OWNER = b"Signature: 8a477f597d28d172789f06886806bc55", b"stixel cache"

LARGEST = 16_000_000
"""A larger file of `store_json`, in bytes, is not read."""

CELLS = "cells"
"""Folder of the modules that are written from a notebook's functions."""


def check_owner(folder: Path) -> None:
    """Raise CacheError if the folder has files and is not marked as a cache of this program."""
    # Another process may be marking it at this moment: look for files first, and for the mark last.
    foreign = [path.name for path in inside(folder) if not path.name.startswith(f".{MARK}.")]
    with suppress(UserError):
        if read_bytes(folder / MARK, 10_000).splitlines()[:2] == [_SIGNATURE, _OWNER]:
            return
    if foreign:
        raise CacheError(
            f"the cache {folder} has files that stixel did not make, such as "
            f"{printable(foreign[0])}: choose a new folder (cache.folder or STIXEL_CACHE)"
        )


def make_folder(root: Path, name: str) -> Path:
    """The folder `name` of the cache `root`, created if it is missing. A new cache gets its mark.

    CacheError as `check_owner` does; OSError if it cannot be written.
    """
    mark = root / MARK
    if not mark.exists():
        check_owner(root)
        root.mkdir(parents=True, exist_ok=True)
        write_whole(mark, b"%s\n%s\n" % (_SIGNATURE, _OWNER))
    path = root / name
    path.mkdir(parents=True, exist_ok=True)
    return path


def store_json(root: Path, folder: str, name: str, content: Any) -> None:
    """Write JSON behind its digest into a file of the cache `root`; errors as of `make_folder`."""
    text = json.dumps(content, separators=(",", ":"))
    digest = sha256(text.encode()).hexdigest()
    write_whole(make_folder(root, folder) / name, f"{digest}\n{text}")


def stored_json(root: Path, folder: str, name: str) -> Any:
    """The content of a file of `store_json`; None if it is missing or damaged."""
    with suppress(UserError, ValueError):
        digest, _, text = read_bytes(root / folder / name, LARGEST).partition(b"\n")
        if sha256(text).hexdigest().encode() == digest:
            return json.loads(text)
    return None


def new_name() -> str:
    """A name that no other process, and no other call, gives."""
    return f"{socket.gethostname()}-{os.getpid()}-{time.monotonic_ns():x}"


def inside(folder: Path) -> list[Path]:
    """What is in the folder, in order; empty if it is missing or cannot be read."""
    with suppress(OSError):
        return sorted(folder.iterdir())
    return []


def file_lock(path: Path) -> "FileLock":
    """Return a lock on the file `path`, not acquired yet.

    `acquire` raises TimeoutError, and OSError on a file system without locks. The library's
    fallback, a file that exists while its process runs, would survive a killed process.
    """
    from filelock import FileLock

    return FileLock(path, fallback_to_soft=False)


LEASES = "leases"
PATIENCE = 60.0
"""Seconds to wait for another process that cleans up."""


class Lease(ExitStack):
    """A lease of this process on entries of the cache at `folder`, for the time of a `with` block.

    In a cache that is read-only nothing is leased: no other process can remove its entries.
    """

    def __init__(self, folder: Path, keys: Iterable[str] = ()):
        super().__init__()
        self._folder, self._keys = folder, keys

    def __enter__(self) -> "Lease":
        self.take(self._keys)
        return self

    def take(self, keys: Iterable[str]) -> None:
        """Lease `keys` instead of the previous ones. Their entries may not exist yet."""
        path = self._folder / LEASES / f"{new_name()}.keys"
        with suppress(OSError, CacheError):
            make_folder(self._folder, LEASES)
            # A cleanup that has started has read the leases already: wait for its end.
            with collector_lock(self._folder):
                path.write_text("\n".join(keys), encoding="ascii")
                lock = file_lock(path.with_suffix(".lock"))
                lock.acquire(timeout=0)
            self.close()
            self.callback(lock.release)
            self.callback(_drop, path)


@contextmanager
def collector_lock(folder: Path) -> Iterator[None]:
    """Acquire the lock that every cleanup and every new lease needs.

    CacheError if the folder cannot be written, or another process keeps the lock for too long.
    """
    with writing(folder):
        try:
            held = file_lock(folder / "collector.lock").acquire(timeout=PATIENCE)
        except TimeoutError as error:
            raise CacheError(
                f"another process has been cleaning the cache {folder} for {PATIENCE:.0f} s"
            ) from error
    with held:
        yield


def leased_keys(folder: Path) -> set[str]:
    """Return the keys that running processes use, and remove the leases of ended processes.

    Requires `collector_lock`.
    """
    keys: set[str] = set()
    for path in sorted((folder / LEASES).glob("*.keys")):
        lock = file_lock(path.with_suffix(".lock"))
        try:
            lock.acquire(timeout=0)
        except OSError:
            with suppress(UserError):
                keys.update(read_bytes(path).decode("ascii").split())
            continue
        _drop(path)
        lock.release()
    return keys


def _drop(path: Path) -> None:
    for suffix in (".keys", ".lock"):
        with suppress(OSError):
            path.with_suffix(suffix).unlink()
