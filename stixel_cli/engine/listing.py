"""The entries of the cache as they lie on the disk, without a look into what they hold."""

import json
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.store import META, VALUE, Store

_KEY = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class Found:
    """An entry: its folder, its bytes, and when it was used last, in seconds since the epoch."""

    key: str
    path: Path
    size: int
    last_use: float


def scan(store: Store) -> list[Found]:
    """All entries, least recently used first, without a look into their notes."""
    found = []
    for folder in _folders(store.folder):
        if len(folder.name) != 2:
            continue
        for entry in _folders(Path(folder)):
            if not _KEY.fullmatch(entry.name):
                continue
            with suppress(OSError):
                last_use = entry.stat().st_mtime
                size = sum(_file_size(entry.path, name) for name in (META, VALUE))
                found.append(Found(entry.name, Path(entry.path), size, last_use))
    return sorted(found, key=lambda one: (one.last_use, one.key))


def _file_size(folder: str, name: str) -> int:
    """Bytes of a file; none where it is missing, which `verify_all` tells."""
    with suppress(OSError):
        return os.stat(os.path.join(folder, name)).st_size
    return 0


def _folders(folder: Path) -> list[os.DirEntry]:
    try:
        with os.scandir(folder) as inside:
            return [one for one in inside if one.is_dir(follow_symlinks=False)]
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise CacheError(f"cannot read the cache {folder}: {error.strerror or error}") from error


_HEAD = re.compile(rb'"stage": ("(?:[^"\\]|\\.)*")')
_LABEL = re.compile(rb'"label": ("(?:[^"\\]|\\.)*")')


def stage_and_label(path: Path) -> tuple[str, str]:
    """Stage and label from an entry's notes without a parse of the whole; "?" where unreadable."""
    with suppress(OSError):
        text = path.read_bytes()
        found = [expression.search(text) for expression in (_HEAD, _LABEL)]
        with suppress(ValueError):
            stage, label = (json.loads(one[1]) if one else "?" for one in found)
            return stage, label
    return "?", "?"
