"""The cache: one folder for each result, found by its key, believed only if its digest is right.

An entry is written in a folder of its own beside the others and renamed into place when it is
complete, so that readers see all of it or nothing, and what a killed process leaves is never taken
for a result. Nothing is flushed to the disk by force: what a power cut tears fails its digest. The
notes on an entry hold the digest of its value, and begin with one of their own.
"""

import io
import json
import os
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import joblib

from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.locks import file_lock, unwritable
from stixel_cli.engine.parameters import CacheParameters
from stixel_cli.engine.units import parse_size

VALUE = "value.joblib"
META = "meta.json"


def default_cache_folder() -> Path:
    """The folder named by STIXEL_CACHE, else `stixel` in the platform's cache of the user."""
    named = os.environ.get("STIXEL_CACHE")
    if named:
        return Path(named).expanduser().absolute()
    import platformdirs

    return platformdirs.user_cache_path("stixel", appauthor=False)


def open_store(parameters: CacheParameters) -> "Store":
    """The store that the configuration names, with its limit; nothing is touched yet."""
    folder = parameters.folder
    limit = parameters.max_size
    return Store(
        default_cache_folder() if folder is None else Path(folder).expanduser().absolute(),
        None if limit is None else parse_size(limit),
    )


class Store:
    """Results in a folder that several processes may share; it is made when it is needed.

    `max_size` in bytes is kept by `execute`, see `stixel_cli.engine.upkeep`.
    """

    def __init__(self, folder: Path | str, max_size: int | None = None):
        self.folder = Path(folder)
        self.max_size = max_size

    def entry(self, key: str) -> Path:
        """The folder of a key's entry, whether there is one or not."""
        return self.folder / key[:2] / key

    def has(self, key: str) -> bool:
        """Whether there is an entry, with notes that are what was stored. Nothing is set aside.

        Its value is not looked at, see `verify`.
        """
        try:
            return _notes_fault((self.entry(key) / META).read_bytes(), key) is None
        except OSError:
            return False

    def load(self, key: str) -> Any:
        """The value of an entry, each time a new object.

        Raises:
            MissingEntry: there is none, or its content is not what was stored; then it is set
                aside, so that it counts as missing from now on.
            CacheError: it cannot be read.
        """
        content = self._content(key)
        with suppress(OSError):
            # The time of last use, by which entries are evicted. A cache may be read-only.
            os.utime(self.entry(key))
        return joblib.load(io.BytesIO(content))

    def meta(self, key: str) -> dict[str, Any]:
        """What was noted about an entry: stage, label, seconds, size, digest, ….

        Raises:
            MissingEntry, CacheError: as `load` does.
        """
        content = self._read(key, META)
        fault = _notes_fault(content, key)
        if fault is not None:
            raise self._set_aside(key, fault)
        return json.loads(content)

    def verify(self, key: str) -> bool:
        """Whether there is an entry with the content that was stored; if not, it is set aside."""
        try:
            self._content(key)
        except MissingEntry:
            return False
        return True

    def check(self, key: str) -> None:
        """Raise MissingEntry unless there is an entry with the content that was stored."""
        self._content(key)

    def save(self, key: str, value: Any, **notes: Any) -> int:
        """Store a value with notes (JSON) about it; its size in bytes.

        Raises:
            CacheError: it cannot be written; nothing is left of it.
        """
        partial = self.folder / "tmp" / f"{key[:16]}-{socket.gethostname()}-{os.getpid()}"
        partial = partial.with_name(f"{partial.name}-{time.monotonic_ns():x}")
        try:
            partial.mkdir(parents=True)
            with (partial / VALUE).open("wb") as file:
                writer = _HashingWriter(file)
                joblib.dump(value, writer)
            size = writer.tell()
            meta = {**notes, "key": key, "size": size, "digest": writer.digest()}
            (partial / META).write_bytes(_notes_content(meta))
            self._put_in_place(partial, self.entry(key))
        except OSError as error:
            shutil.rmtree(partial, ignore_errors=True)
            raise unwritable(self.folder, error) from error
        except BaseException:
            shutil.rmtree(partial, ignore_errors=True)
            raise
        return size

    @contextmanager
    def lock(self, key: str) -> Iterator[None]:
        """Hold the lock of a key: for one thread of one process at a time, freed if that is killed.

        Raises:
            CacheError: the folder cannot be written.
        """
        path = self.folder / "locks" / f"{key}.lock"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            lock = file_lock(path)
            lock.acquire()
        except OSError as error:
            raise unwritable(self.folder, error) from error
        try:
            yield
        finally:
            # Removed while it is held. Who waits for the removed file finds no name for it and
            # begins anew; were two to slip through, both would store the same result.
            with suppress(OSError):
                path.unlink()
            lock.release()

    def check_writable(self) -> None:
        """Raise CacheError if entries cannot be written or locked, before a stage runs in vain."""
        probe = self.folder / "tmp" / f"probe-{os.getpid()}-{time.monotonic_ns():x}"
        try:
            probe.parent.mkdir(parents=True, exist_ok=True)
            probe.touch()
            try:
                with file_lock(probe):
                    pass
            finally:
                probe.unlink()
        except OSError as error:
            raise unwritable(self.folder, error) from error

    def _content(self, key: str) -> bytes:
        meta = self.meta(key)
        content = self._read(key, VALUE)
        if len(content) != meta.get("size"):
            raise self._set_aside(key, f"it is cut short ({len(content)} bytes)")
        if sha256(content).hexdigest() != meta.get("digest"):
            raise self._set_aside(key, "its content is not what was stored")
        return content

    def _read(self, key: str, name: str) -> bytes:
        try:
            return (self.entry(key) / name).read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            if self.entry(key).is_dir():
                raise self._set_aside(key, f"{name} is missing") from None
            raise MissingEntry(key, "there is none") from None
        except IsADirectoryError:
            raise self._set_aside(key, f"{name} is a folder") from None
        except OSError as error:
            raise CacheError(
                f"cannot read the cache {self.folder}: {error.strerror or error}"
            ) from error

    def _set_aside(self, key: str, reason: str) -> MissingEntry:
        """Move a bad entry out of the way; the exception to raise."""
        aside = self.folder / "quarantine" / f"{key}-{time.time_ns()}"
        with suppress(OSError):
            # Where this fails, the entry stays, and whoever wants to replace it says why it cannot.
            aside.parent.mkdir(parents=True, exist_ok=True)
            self.entry(key).rename(aside)
            return MissingEntry(key, reason, set_aside=True)
        return MissingEntry(key, reason)

    def _put_in_place(self, partial: Path, entry: Path) -> None:
        try:
            _move(partial, entry)
        except OSError:
            if self.has(entry.name):
                # Someone else stored the same result first.
                shutil.rmtree(partial, ignore_errors=True)
                return
            # What is left of an entry that was not removed to the end, or was damaged.
            self._set_aside(entry.name, "it is not complete")
            _move(partial, entry)


def _move(partial: Path, entry: Path) -> None:
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        partial.rename(entry)
    except FileNotFoundError:
        # A collector removed the folder in between, empty as it was.
        entry.parent.mkdir(parents=True, exist_ok=True)
        partial.rename(entry)


_OWN_DIGEST = b'{\n "notes_digest": "'
_OWN_DIGEST_END = b'",'


def _notes_content(meta: dict[str, Any]) -> bytes:
    """Notes as they are stored: JSON whose first entry is the digest of the text that follows."""
    rest = json.dumps(meta, indent=1).encode("ascii").removeprefix(b"{")
    return _OWN_DIGEST + sha256(rest).hexdigest().encode() + _OWN_DIGEST_END + rest


def _notes_fault(content: bytes, key: str) -> str | None:
    """What is wrong with the stored notes of a key's entry, or None."""
    begin = len(_OWN_DIGEST)
    stop = begin + 64 + len(_OWN_DIGEST_END)
    if not content.startswith(_OWN_DIGEST) or content[stop - 2 : stop] != _OWN_DIGEST_END:
        return "its notes are damaged, or of an older version"
    rest = content[stop:]
    if content[begin : begin + 64] != sha256(rest).hexdigest().encode():
        return "its notes are not what was stored"
    if f'\n "key": "{key}",'.encode() not in rest:
        return "it is the entry of another key"
    return None


class _HashingWriter:
    """A binary file that hashes what is written to it."""

    def __init__(self, file: io.BufferedWriter):
        self._file = file
        self._hash = sha256()
        self._size = 0

    def write(self, content: bytes | memoryview) -> int:
        self._hash.update(content)
        self._size += len(memoryview(content).cast("B"))
        return self._file.write(content)

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        self._file.flush()

    def digest(self) -> str:
        return self._hash.hexdigest()
