"""Write result folders, all that is needed to read a run and to repeat it; name files beside them.

What a folder names that this user's own command made needs no `--trust-code`: a note in the cache
has the digest of its files that name code. Another folder at its place, or a changed file, is as
one from anybody.
"""

import io
import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from hashlib import sha256
from itertools import chain, count
from pathlib import Path

import numpy as np

from stixel_cli.border.files import read_bytes
from stixel_cli.border.origins import TYPED, Origin, write_below, write_whole, written
from stixel_cli.engine.cache_folder import make_folder
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.errors import FolderTaken, UserError
from stixel_cli.results import lineage
from stixel_cli.results.result import RunResult, json_text, yaml_text

PAGE = "index.html"
"""The playback page of a run."""

MOST_CHARACTERS = 200
"""Limit of a folder's name; its temporary name is longer, and file systems allow 255."""

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+=,-]*")


def new_folder(
    results: Path, name: str | None, stem: str, moment: datetime, write: Callable[[Path], object]
) -> Path:
    """Write a new folder: `results` / `name`, or an unused one named by stem and time.

    `write` writes the folder at a path, and raises FolderTaken if another process was faster.
    FolderTaken if the name exists; `check_results` says so earlier.
    """
    for number in count(1):
        more = f"-{number}" if number > 1 else ""
        folder = results / (name or f"{stem}-{moment:%Y%m%d-%H%M%S}{more}")
        if name is None and os.path.lexists(folder):
            continue
        try:
            write(folder)
            note_made_here(folder)
            return folder
        except FolderTaken:
            # Another run of the same second took the name; there are more default names.
            if name is not None:
                raise


def check_results(results: Path, name: str | None) -> None:
    """Raise UserError if `name` is not a plain folder name or exists, or `results` is not writable.

    A folder `results` that did not exist before is removed again.
    """
    if name is not None:
        check_plain_name(name)
        if os.path.lexists(results / name):
            raise UserError(f"--name: {results / name} exists; choose another --name")
    writable = os.path.isdir(results) and os.access(results, os.W_OK | os.X_OK)
    if os.path.exists(results) and not writable:
        raise UserError(f"--results: {results}: not a writable folder; name another")
    missing = [path for path in (results, *results.parents) if not os.path.exists(path)]
    try:
        results.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--results: {results}: cannot be created: {error.strerror}") from error
    finally:
        for path in missing:
            # Another process may have put something into it.
            with suppress(OSError):
                path.rmdir()


def check_plain_name(name: str) -> None:
    """Raise UserError if a given name is not a plain folder name."""
    if not _NAME.fullmatch(name):
        raise UserError(
            f"--name: {name!r} is not a valid folder name: use letters, digits and _ . + = , -"
        )
    if len(name) > MOST_CHARACTERS:
        raise UserError(f"--name: {name[:20]}…: at most {MOST_CHARACTERS} characters")


@contextmanager
def whole_folder(folder: Path, replace: bool = False) -> Iterator[Path]:
    """Context with a partial folder, which at the end becomes `folder`: complete, or not at all.

    FolderTaken if `folder` exists by now, unless `replace`. UserError if it cannot be written (disk
    full, no permission).
    """
    partial = folder.with_name(f".{folder.name}.partial-{os.getpid()}")
    with written(folder):
        try:
            partial.mkdir(parents=True)
            yield partial
            if replace and folder.exists():
                shutil.rmtree(folder)
            # A rename onto an empty folder would succeed; mkdir reserves the name for this process.
            try:
                folder.mkdir()
            except FileExistsError:
                raise FolderTaken(f"{folder}: was created by another process meanwhile") from None
            try:
                partial.rename(folder)
            except OSError:
                folder.rmdir()
                raise
        finally:
            shutil.rmtree(partial, ignore_errors=True)


def write_whole_folder(
    folder: Path, files: Mapping[str, str | bytes], replace: bool = False
) -> None:
    """Write files, by path below the folder, as `whole_folder` does, which has the errors."""
    with whole_folder(folder, replace) as partial:
        write_below(partial, files)


def write_folder(folder: Path, run: RunResult, page: str) -> None:
    """Write the whole folder of a computed run, with complete manifest and playback page."""
    sources = lineage.stored_sources(run.lineage.sources)
    files = {
        "config.yaml": yaml_text(dict(run.settings)),
        "manifest.json": json_text(run.manifest),
        "metrics.json": json_text(run.metrics),
        lineage.FILE: json_text(lineage.lineage_tree(run.lineage)),
        PAGE: page,
        **{f"{stem}.csv": csv_text(columns) for stem, columns in run.tables.items()},
        **{f"{stem}.npz": arrays_content(columns) for stem, columns in run.arrays.items()},
        **figure_files(run.pictures),
        **{f"{lineage.CODE_FOLDER}/{name}": source for name, source in sources.items()},
    }
    write_whole_folder(folder, files)


def arrays_content(arrays: Mapping[str, np.ndarray]) -> bytes:
    """An NPZ file of arrays by name."""
    # Not compressed: that takes longer than all else here, and saves a third.
    np.savez(buffer := io.BytesIO(), **arrays)
    return buffer.getvalue()


def figure_files(pictures: Mapping[str, bytes]) -> dict[str, bytes]:
    """Pictures by path below the folder of a run."""
    return {f"figures/{path}": data for path, data in sorted(pictures.items())}


def csv_text(columns: Mapping[str, Sequence]) -> str:
    """Comma-separated columns, with enough digits to read numbers back exactly; texts in quotes."""
    arrays = map(np.asarray, columns.values())
    texts = [map(_cell if one.dtype.kind in "OU" else repr, one.tolist()) for one in arrays]
    # The writer of the module `csv` takes half as long again.
    return "\n".join([",".join(columns), *map(",".join, zip(*texts, strict=True)), ""])


def _cell(value: float | str) -> str:
    return '"' + value.replace('"', '""') + '"' if isinstance(value, str) else repr(value)


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


_LONGEST_NAME = 150


def run_labels(folders: Sequence[Path]) -> list[str]:
    """Name of each run: its folder's name, with the parents' names where that is not unique.

    UserError if a folder is named twice.
    """
    paths = [folder.resolve() for folder in folders]
    for parts in range(1, max(len(path.parts) for path in paths) + 1):
        labels = ["/".join(path.parts[-parts:]) for path in paths]
        if len(set(labels)) == len(labels):
            return labels
    raise UserError("two arguments name the same folder; give each folder once")


def default_page(folders: Sequence[Path], what: str = "report", suffix: str = "html") -> Path:
    """An unused file next to the first folder, named by `what` and the folders' names."""
    first, *others = (folder.resolve().name for folder in folders)
    stem = "-".join([what, first, *others])
    if len(stem) > _LONGEST_NAME:
        stem = f"{what}-{first}"[:_LONGEST_NAME] + f"-and-{len(others)}-more"
    parent = folders[0].parent if folders[0].name not in ("", "..") else folders[0].resolve().parent
    return unused_page(parent / f"{stem}.{suffix}")


def unused_page(page: Path) -> Path:
    """The file, or one with a number at the end of its name if it exists."""
    numbered = (page.with_name(f"{page.stem}-{number}{page.suffix}") for number in count(2))
    return next(file for file in chain([page], numbered) if not file.exists())
