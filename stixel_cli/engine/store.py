"""The store of results: one folder per key, with the value, notes, and digests of both.

An entry is written in a temporary folder and then renamed, so that readers see all of it or
nothing, also after a process was killed. Nothing is flushed to disk by force: after a power cut the
digest reveals an incomplete entry. The notes have the digest of the value, and one of their own.
"""

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from stixel_cli.border.files import GREATEST_TEXT, content_digest, file_state, read_bytes
from stixel_cli.border.origins import cached
from stixel_cli.engine import cache_folder
from stixel_cli.engine.errors import CacheError, MissingEntry, writing
from stixel_cli.engine.parameters import CacheParameters, default_cache_folder, parse_size
from stixel_cli.errors import UserError

VALUE = "value.joblib"
META = "meta.json"


def open_store(parameters: CacheParameters) -> "Store":
    """The store that the configuration names, with its limit. The folder is not created yet.

    CacheError if the folder exists, and is not a cache.
    """
    name, limit = parameters.folder, parameters.max_size
    folder = default_cache_folder() if name is None else Path(name).expanduser().absolute()
    cache_folder.check_owner(folder)
    return Store(folder, None if limit is None else parse_size(limit))


class Store:
    """Results in a folder that several processes may share. `save` creates the folder.

    `execute` keeps the limit `max_size`, in bytes: see `stixel_cli.engine.entries`.
    """

    def __init__(self, folder: Path | str, max_size: int | None = None):
        self.folder = Path(folder)
        self.max_size = max_size
        self._checked: dict[str, object] = {}  # State of each file whose digest was right.

    def entry(self, key: str) -> Path:
        """The folder of a key's entry, which may not exist."""
        return self.folder / f"{key[:2]}/{key}"

    def has(self, key: str) -> bool:
        """Whether an entry with valid notes exists. Its value is not read, see `verify`."""
        file = self.entry(key) / META
        with suppress(UserError):
            return os.path.exists(file) and _notes_fault(read_bytes(file), key) is None
        return False

    def load(self, key: str) -> Any:
        """Read the value of an entry, as a new object each time.

        MissingEntry if there is no entry, or a damaged one, which is removed; CacheError if it
        cannot be read.
        """
        content = self.checked(key)
        with suppress(OSError):
            # The time of last use, for the cleanup. A cache may be read-only.
            os.utime(self.entry(key))
        return cached(content)

    def meta(self, key: str) -> dict[str, Any]:
        """Read the notes of an entry: stage, label, seconds, size, digest, ….

        MissingEntry, CacheError as `load` does.
        """
        content = self._read(key, META)
        fault = _notes_fault(content, key)
        if fault is not None:
            raise self._damaged(key, fault)
        return json.loads(content)

    def verify(self, key: str) -> bool:
        """Whether an undamaged entry exists. A damaged one is removed."""
        with suppress(MissingEntry):
            self.checked(key)
            return True
        return False

    def save(self, key: str, value: Any, **notes: Any) -> int:
        """Store a value with notes (JSON); return the size of the value in bytes.

        CacheError if it cannot be written. Nothing of it remains.
        """
        import joblib

        partial = self.folder / "tmp" / f"{key[:16]}-{cache_folder.new_name()}"
        with writing(self.folder), ExitStack() as end:
            # It is in its place by then, or of no use.
            end.callback(shutil.rmtree, partial, ignore_errors=True)
            cache_folder.make_folder(self.folder, "tmp")
            partial.mkdir()
            joblib.dump(value, partial / VALUE)
            size = (partial / VALUE).stat().st_size
            digest = content_digest(partial / VALUE, size)
            meta = {**notes, "key": key, "size": size, "digest": digest}
            (partial / META).write_bytes(_notes_content(meta))
            self._put_in_place(partial, self.entry(key))
        return size

    @contextmanager
    def lock(self, key: str) -> Iterator[None]:
        """Acquire the lock of a key, for one thread of one process at a time.

        CacheError if the folder cannot be written.
        """
        with writing(self.folder):
            path = cache_folder.make_folder(self.folder, "locks") / f"{key}.lock"
            lock = cache_folder.file_lock(path)
            lock.acquire()
        try:
            yield
        finally:
            # Remove the file before the release: a process that waits for the removed file finds
            # it without a name and retries. Two that get the lock would store the same result.
            with suppress(OSError):
                path.unlink()
            lock.release()

    def check_writable(self) -> None:
        """Raise CacheError if entries cannot be written or locked."""
        with writing(self.folder):
            name = f"probe-{cache_folder.new_name()}"
            probe = cache_folder.make_folder(self.folder, "tmp") / name
            probe.touch()
            try:
                with cache_folder.file_lock(probe):
                    pass
            finally:
                probe.unlink()

    def remove(self, key: str) -> bool:
        """Remove an entry; False if it cannot be removed.

        It is renamed first, so that no reader sees half of it.
        """
        try:
            gone = cache_folder.make_folder(self.folder, "tmp") / f"gone-{cache_folder.new_name()}"
            self.entry(key).rename(gone)
        except (OSError, CacheError):
            return False
        shutil.rmtree(gone, ignore_errors=True)
        return True

    def checked(self, key: str) -> bytes:
        """The bytes of a value, with checks and errors as of `load`.

        The digest of a file that has not changed since is not computed again.
        """
        meta, state = self.meta(key), file_state(self.entry(key) / VALUE)
        content = self._read(key, VALUE, meta.get("size", 0))
        unchanged = self._checked.get(key, ()) == state
        if not unchanged and sha256(content).hexdigest() != meta.get("digest"):
            raise self._damaged(key, "its content has changed")
        self._checked[key] = state
        return content

    def _read(self, key: str, name: str, greatest: int = GREATEST_TEXT) -> bytes:
        file = self.entry(key) / name
        try:
            return read_bytes(file, greatest)
        except UserError as error:
            if isinstance(error.__cause__, OSError) and file.is_file():
                reason = error.__cause__.strerror or error.__cause__
                raise CacheError(f"cannot read the cache {self.folder}: {reason}") from error
            if self.entry(key).is_dir():
                reason = str(error).removeprefix(f"{file}: ").removeprefix(f"{file.parent}: ")
                raise self._damaged(key, reason) from None
            raise MissingEntry(key, "not found") from None

    def _damaged(self, key: str, reason: str) -> MissingEntry:
        """Remove a damaged entry; return the exception to raise.

        If it cannot be removed, `save` reports why it cannot replace it.
        """
        return MissingEntry(key, reason, removed=self.remove(key))

    def _put_in_place(self, partial: Path, entry: Path) -> None:
        for is_last in (False, False, True):
            # A cleanup may remove the folder while it is empty.
            entry.parent.mkdir(parents=True, exist_ok=True)
            try:
                partial.rename(entry)
                return
            except OSError:
                if self.has(entry.name):
                    # Another process stored the same result first.
                    return
                if is_last:
                    raise
                # A damaged entry, or one that was removed in part.
                self.remove(entry.name)


_OWN_DIGEST = b'{\n "notes_digest": "'
_OWN_DIGEST_END = b'",'


def _notes_content(meta: dict[str, Any]) -> bytes:
    """Encode notes as JSON whose first entry is the digest of the text that follows."""
    # A line for each note. `json.dumps` of all with an indent would be written in Python.
    lines = (f"\n {json.dumps(name)}: {json.dumps(value)}" for name, value in meta.items())
    rest = f"{','.join(lines)}\n}}".encode("ascii")
    return _OWN_DIGEST + sha256(rest).hexdigest().encode() + _OWN_DIGEST_END + rest


def _notes_fault(content: bytes, key: str) -> str | None:
    """Return what is wrong with the stored notes of a key, or None."""
    begin = len(_OWN_DIGEST)
    stop = begin + 64 + len(_OWN_DIGEST_END)
    if not content.startswith(_OWN_DIGEST) or content[stop - 2 : stop] != _OWN_DIGEST_END:
        return "its notes are damaged or of an older version"
    rest = content[stop:]
    if content[begin : begin + 64] != sha256(rest).hexdigest().encode():
        return "its notes have changed"
    if f'\n "key": "{key}",'.encode() not in rest:
        return "it belongs to another key"
    return None
