"""Write result folders: everything needed to read a run and to repeat it."""

import os
import re
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import numpy as np

from stixel_cli.errors import FolderTaken, UserError
from stixel_cli.results import lineage
from stixel_cli.results.result import RunResult, track_arrays, truth_arrays
from stixel_cli.results.text import json_text, yaml_text

PAGE = "index.html"
"""The playback page of a run."""

MOST_CHARACTERS = 200
"""Limit of a folder's name; its temporary name is longer, and file systems allow 255."""

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+=,-]*")


def reserve_folder(results: Path, name: str | None, default_name: str) -> Path:
    """The folder to write: `results` / `name`, or an unused one of the default name.

    Only the folder `results` itself is created.

    Raises:
        UserError: if the name is not a plain folder name, or exists, or `results` is not writable.
    """
    check_results(results, name)
    try:
        results.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--results: {results}: cannot be created: {error.strerror}") from error
    if name is not None:
        return results / name
    folder, number = results / default_name, 2
    while os.path.lexists(folder):
        folder, number = results / f"{default_name}-{number}", number + 1
    return folder


def stamp(moment: datetime) -> str:
    """Date and time at the end of a folder's name."""
    return f"{moment:%Y%m%d-%H%M%S}"


def check_results(results: Path, name: str | None) -> None:
    """Raise UserError if `name` is not a plain folder name or exists, or `results` is not writable.

    A folder `results` that did not exist before is removed again.
    """
    check_name(results, name)
    if results.is_dir() and not os.access(results, os.W_OK | os.X_OK):
        raise UserError(f"--results: {results}: not writable; name another folder")
    missing = [path for path in (results, *results.parents) if not path.exists()]
    try:
        results.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--results: {results}: cannot be created: {error.strerror}") from error
    finally:
        for path in missing:
            # Another process may have put something into it.
            with suppress(OSError):
                path.rmdir()


def check_name(results: Path, name: str | None) -> None:
    """Raise UserError if a given name is not a plain folder name, or exists."""
    try:
        results.exists()
    except OSError as error:
        raise UserError(f"--results: {results}: cannot be created: {error.strerror}") from error
    if name is None:
        return
    check_plain_name(name)
    if os.path.lexists(results / name):
        raise UserError(f"--name: {results / name} exists; choose another --name")


def check_plain_name(name: str) -> None:
    """Raise UserError if a given name is not a plain folder name."""
    if not _NAME.fullmatch(name):
        raise UserError(
            f"--name: {name!r} is not a valid folder name: use letters, digits and _ . + = , -"
        )
    if len(name) > MOST_CHARACTERS:
        raise UserError(f"--name: {name[:20]}…: at most {MOST_CHARACTERS} characters")


def write_folder(folder: Path, run: RunResult, page: str) -> None:
    """Write a result folder: it appears complete, under its name, or not at all.

    Args:
        folder: path of the new folder.
        run: a computed run, with its complete manifest.
        page: HTML of the playback page.

    Raises:
        FolderTaken: if a folder of that name exists by now.
        UserError: if it cannot be written (disk full, no permission).
    """
    partial = folder.with_name(f".{folder.name}.partial-{os.getpid()}")
    try:
        _write_files(partial, run, page)
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
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror}") from error
    finally:
        with suppress(OSError):
            shutil.rmtree(partial)


def _write_files(folder: Path, run: RunResult, page: str) -> None:
    folder.mkdir(parents=True)
    texts = {
        "config.yaml": yaml_text(dict(run.settings)),
        "manifest.json": json_text(run.manifest),
        "metrics.json": json_text(run.metrics),
        lineage.FILE: json_text(lineage.lineage_tree(run.lineage)),
        PAGE: page,
        **{f"{stem}.csv": csv_text(columns) for stem, columns in run.tables.items()},
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    tables = run.tables | {"track": track_arrays(run.track)}
    if "truth" in tables:
        tables["truth"] = truth_arrays(run.scenario)
    # Not compressed: that takes longer than all else here, and saves a third.
    for stem, arrays in tables.items():
        np.savez(folder / f"{stem}.npz", **arrays)
    for path, data in sorted(run.pictures.items()):
        file = folder / "figures" / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)


def csv_text(columns: Mapping[str, Sequence]) -> str:
    """Comma-separated columns, with enough digits to read numbers back exactly; texts in quotes."""
    texts = [map(_cell, np.asarray(column).tolist()) for column in columns.values()]
    # The writer of the module `csv` takes half as long again.
    return "\n".join([",".join(columns), *map(",".join, zip(*texts, strict=True)), ""])


def _cell(value: float | str) -> str:
    return '"' + value.replace('"', '""') + '"' if isinstance(value, str) else repr(value)
