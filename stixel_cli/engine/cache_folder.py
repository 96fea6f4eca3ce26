"""The folder of the cache: who made it, which names the store makes in it, how its files are read.

Whoever creates the folder marks it with a file `CACHEDIR.TAG` (https://bford.info/cachedir/), whose
second line names this program. A folder of the user's with other files is never used, so that no
cleanup can remove them; and only names that the store makes are ever removed.
"""

import re
import stat
from contextlib import suppress
from hashlib import file_digest
from pathlib import Path

from stixel_cli.engine.errors import CacheError
from stixel_cli.errors import printable
from stixel_cli.files import write_whole

MARK = "CACHEDIR.TAG"
_SIGNATURE = "Signature: 8a477f597d28d172789f06886806bc55"
_OWNER = "stixel cache"

NOTES_LIMIT = 64 * 2**20
"""Bytes of a file of the cache that is no value; larger ones count as damaged."""

_KEY = r"[0-9a-f]{64}"
_MADE = {
    r"[0-9a-f]{2}": _KEY,
    "configurations": rf"{_KEY}(\.json|-\d+-\d+\.partial)",
    "leases": r".+-\d+-[0-9a-f]+\.(keys|lock)",
    "locks": rf"{_KEY}\.lock",
    "quarantine": rf"{_KEY}-\d+",
    "sources": r"[0-9a-f]{32}\.py|digests-[0-9a-f]{16}\.json|(digests|[0-9a-f]{32})-.+\.part",
    "tmp": r"[0-9a-f]{16}-.+-\d+-[0-9a-f]+|gone-.+-\d+-[0-9a-f]{16}|probe-\d+-[0-9a-f]+|limit-.+",
}
"""Folders that the store makes, and the names in each."""

_FILES = rf"\.{MARK}\.partial-\d+|collector\.lock|evicted\.jsonl(-\d+)?|durations(-\d+)?\.json"


class NotARegularFile(OSError):
    """A folder, FIFO, socket, device or too large a file in the place of a file."""


def read_file(path: Path, greatest: int = NOTES_LIMIT) -> bytes:
    """Read a regular file. Other kinds are not opened: a FIFO or a device could block.

    Raises:
        NotARegularFile: it is of another kind, or larger than `greatest` bytes.
        OSError: it cannot be read.
    """
    _check_regular(path, greatest)
    return path.read_bytes()


def _check_regular(path: Path, greatest: int) -> None:
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        raise NotARegularFile("not a regular file")
    if found.st_size > greatest:
        raise NotARegularFile(f"larger than {greatest} bytes")


def digest_of_file(path: Path, greatest: int) -> tuple[int, str]:
    """Size and SHA-256 of a regular file that is not read into memory; errors as `read_file`."""
    _check_regular(path, greatest)
    with path.open("rb") as file:
        return path.stat().st_size, file_digest(file, "sha256").hexdigest()


def is_marked(folder: Path) -> bool:
    """Whether the folder says that it is a cache of this program."""
    with suppress(OSError):
        lines = read_file(folder / MARK, 10_000).splitlines()
        return lines[:2] == [_SIGNATURE.encode(), _OWNER.encode()]
    return False


def made_here(path: Path) -> bool:
    """Whether the store makes such a name in the folder of `path`."""
    return any(
        re.fullmatch(folder, path.parent.name) and re.fullmatch(names, path.name)
        for folder, names in _MADE.items()
    )


def check_owner(folder: Path) -> None:
    """Raise CacheError if the folder has files that the store does not make.

    An unmarked folder that holds only names of the store is a cache of an earlier version.
    """
    if is_marked(folder):
        return
    # A folder that is missing or cannot be read is reported where it is used.
    with suppress(OSError):
        foreign = _foreign(folder)
        # Another process may have marked the folder since.
        if foreign is not None and not is_marked(folder):
            name = printable(str(foreign.relative_to(folder)))
            raise CacheError(
                f"the cache {folder} has files that stixel did not make, such as {name}: choose a "
                "new folder (cache.folder or STIXEL_CACHE)"
            )


def make_folder(root: Path, name: str) -> Path:
    """The folder `name` of the cache `root`, created if it is missing. A new cache gets its mark.

    Raises:
        CacheError: as `check_owner` does.
        OSError: it cannot be written.
    """
    mark = root / MARK
    if not mark.exists():
        check_owner(root)
        root.mkdir(parents=True, exist_ok=True)
        write_whole(mark, f"{_SIGNATURE}\n{_OWNER}\n")
    path = root / name
    path.mkdir(parents=True, exist_ok=True)
    return path


def _foreign(folder: Path) -> Path | None:
    """A file or folder that the store does not make; None if there is none."""
    for path in folder.iterdir():
        if path.is_symlink() or not path.is_dir():
            if not re.fullmatch(_FILES, path.name):
                return path
        elif not any(re.fullmatch(name, path.name) for name in _MADE):
            return path
        else:
            for inside in path.iterdir():
                if not made_here(inside):
                    return inside
    return None
