"""Folders of results that commands of this user made: what they name needs no `--trust-code`.

A note in the cache has, for each folder, the digest of its files that name code. Another folder at
its place, or a changed file, is as one from anybody.
"""

from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from stixel_cli.border import TYPED, Origin, write_whole
from stixel_cli.engine.cache_folder import make_folder
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.errors import UserError
from stixel_cli.files import read_bytes

NOTES = "folders"
"""Folder in the cache."""

FILES = ("config.yaml", "lineage.json", "sweep.yaml", "tune.yaml")
"""Those that name code, or have its digests."""


def note_made_here(folder: Path) -> None:
    """Note in the cache what a folder names now; nothing if there is no cache to write in."""
    if default_cache_folder().is_dir():
        with suppress(OSError, CacheError, UserError):
            note = make_folder(default_cache_folder(), NOTES) / _name(folder)
            write_whole(note, _digest(folder))


def origin_of(folder: Path, trusted: bool) -> Origin:
    """Where the names in a folder of results were written: here, or by somebody, who is `trusted`.

    Whether the code that they name is still the same is not checked.
    """
    with suppress(UserError):
        if read_bytes(default_cache_folder() / NOTES / _name(folder)) == _digest(folder).encode():
            return TYPED
    return Origin(str(folder), trusted)


def _name(folder: Path) -> str:
    return sha256(str(folder.resolve()).encode()).hexdigest()


def _digest(folder: Path) -> str:
    found = [name for name in FILES if (folder / name).exists()]
    digests = [f"{name} {sha256(read_bytes(folder / name)).hexdigest()}" for name in found]
    return sha256("\n".join(digests).encode()).hexdigest()
