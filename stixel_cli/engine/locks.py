"""Locks on files of the cache, which the system frees when the process that holds them ends."""

import errno
from pathlib import Path

from filelock import FileLock

from stixel_cli.engine.errors import CacheError

_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)


def file_lock(path: Path) -> FileLock:
    """A lock, not held yet, on the file `path`, which is made.

    To acquire it raises OSError on a file system that knows no locks. What the library would take
    in their place, a file that is there while its process runs, outlives one that is killed.
    """
    return FileLock(path, fallback_to_soft=False)


def unwritable(folder: Path, error: OSError) -> CacheError:
    """What is said of the cache at `folder` when a file of it cannot be written or locked."""
    if error.errno in _NO_LOCKS:
        return CacheError(
            f"the file system of the cache {folder} knows no locks (flock): mount it with them, or "
            "take another folder"
        )
    return CacheError(f"cannot write in the cache {folder}: {error.strerror or error}")
