"""Results of reading files, remembered while the files are the same."""

import os
from collections.abc import Callable
from functools import lru_cache, wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

P, T = ParamSpec("P"), TypeVar("T")


def remembered(read: Callable[P, T]) -> Callable[P, T]:
    """`read`, which reads files again only after their time, size or inode has changed.

    Its paths are arguments of their own. Every call returns the same object: do not change it.
    """

    @lru_cache(maxsize=1024)
    def read_once(arguments: tuple[Any, ...], states: tuple[Any, ...]) -> T:
        return read(*arguments)

    @wraps(read)
    def read_if_changed(*arguments: Any) -> T:
        files = [argument for argument in arguments if isinstance(argument, Path)]
        return read_once(arguments, tuple(map(_state, files)))

    return read_if_changed


def _state(file: Path) -> tuple[int, int, int] | None:
    """What changes when a file changes; None if it cannot be read, which its reader reports."""
    try:
        stat = os.stat(file)
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size, stat.st_ino
