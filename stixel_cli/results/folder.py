"""The result folder: everything it takes to read an experiment, and to make it again."""

import csv
import io
import os
import re
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stixel_cli.errors import FolderTaken, UserError
from stixel_cli.evaluation.scores import Scores
from stixel_cli.experiment.run import Outcome
from stixel_cli.measurements.scans import Scans
from stixel_cli.results import lineage
from stixel_cli.results.text import json_text
from stixel_cli.tracking.track import Track

PAGE = "index.html"
"""The page that plays a run back."""

MOST_CHARACTERS = 200
"""Of a folder's name: with what is put round it while it is written, disks take 255."""

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+=,-]*")


def reserve_folder(results: Path, name: str | None, default_name: str) -> Path:
    """The folder to write: `results` / `name`, or one of the default name that is free.

    Nothing is written but the folder `results` itself.

    Raises:
        UserError: if the name is no plain folder name or is taken, or `results` is not writable.
    """
    check_results(results, name)
    try:
        results.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--results: {results}: cannot be made: {error.strerror}") from error
    if name is not None:
        return results / name
    folder, number = results / default_name, 2
    while os.path.lexists(folder):
        folder, number = results / f"{default_name}-{number}", number + 1
    return folder


def check_results(results: Path, name: str | None) -> None:
    """Raise UserError if `name` is no plain folder name or is taken, or `results` not writable.

    Nothing is left of the try to make `results` where it is not there.
    """
    check_name(results, name)
    if results.is_dir() and not os.access(results, os.W_OK | os.X_OK):
        raise UserError(f"--results: {results}: not writable; name another folder")
    missing = [path for path in (results, *results.parents) if not path.exists()]
    try:
        results.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--results: {results}: cannot be made: {error.strerror}") from error
    finally:
        for path in missing:
            # Another process may have put something into it.
            with suppress(OSError):
                path.rmdir()


def check_name(results: Path, name: str | None) -> None:
    """Raise UserError if a name that was given is no plain folder name, or is taken."""
    try:
        results.exists()
    except OSError as error:
        raise UserError(f"--results: {results}: cannot be made: {error.strerror}") from error
    if name is None:
        return
    check_plain_name(name)
    if os.path.lexists(results / name):
        raise UserError(f"--name: {results / name} exists, and is not written over")


def check_plain_name(name: str) -> None:
    """Raise UserError if a name that was given is no plain folder name."""
    if not _NAME.fullmatch(name):
        raise UserError(f"--name: {name!r} is no folder name: use letters, digits and _ . + = , -")
    if len(name) > MOST_CHARACTERS:
        raise UserError(f"--name: {name[:20]}…: at most {MOST_CHARACTERS} characters")


def write_folder(
    folder: Path,
    outcome: Outcome,
    resolved: Mapping[str, Any],
    manifest: Mapping[str, Any],
    page: str,
) -> None:
    """Write a result folder: it appears whole, under its name, or not at all.

    `page` is what plays the run back.

    Raises:
        FolderTaken: if there is a folder of its name by now.
        UserError: if it cannot be written (disk full, no permission).
    """
    partial = folder.with_name(f".{folder.name}.partial-{os.getpid()}")
    try:
        _write_files(partial, outcome, resolved, manifest, page)
        # A rename onto an empty folder would succeed; mkdir claims the name for us alone.
        try:
            folder.mkdir()
        except FileExistsError:
            raise FolderTaken(f"{folder}: was made by another process meanwhile") from None
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


def _write_files(
    folder: Path,
    outcome: Outcome,
    resolved: Mapping[str, Any],
    manifest: Mapping[str, Any],
    page: str,
) -> None:
    folder.mkdir(parents=True)
    text = yaml.safe_dump(dict(resolved), sort_keys=False, allow_unicode=True)
    (folder / "config.yaml").write_text(text, encoding="utf-8")
    (folder / "manifest.json").write_text(json_text(manifest), encoding="utf-8")
    (folder / "metrics.json").write_text(json_text(outcome.scores.metrics), encoding="utf-8")
    (folder / lineage.FILE).write_text(
        json_text(lineage.lineage_tree(outcome.lineage)), encoding="utf-8"
    )
    (folder / PAGE).write_text(page, encoding="utf-8")
    for stem, columns in (
        ("scans", scan_columns(outcome.scans)),
        ("track", track_columns(outcome.track)),
        ("scores", score_columns(outcome.scores)),
    ):
        (folder / f"{stem}.csv").write_text(_csv_text(columns), encoding="utf-8")
    np.savez_compressed(folder / "scans.npz", **scan_columns(outcome.scans))
    np.savez_compressed(folder / "track.npz", **track_arrays(outcome.track))
    np.savez_compressed(folder / "scores.npz", **score_columns(outcome.scores))
    for path, data in sorted(outcome.pictures.items()):
        file = folder / "figures" / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)


def scan_columns(scans: Scans) -> dict[str, np.ndarray]:
    """The scans as a table, one row a point: k, t (s), x, y (m), variances (m²)."""
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    return {
        "k": k,
        "t": scans.times[k],
        "x": scans.points_world[:, 0],
        "y": scans.points_world[:, 1],
        "var_xx": scans.covariances_world[:, 0, 0],
        "var_xy": scans.covariances_world[:, 0, 1],
        "var_yy": scans.covariances_world[:, 1, 1],
    }


def track_columns(track: Track) -> dict[str, np.ndarray]:
    """The track as a table, one row a scan: pose, rates, their standard deviations, points used."""
    names = ("x", "y", "heading", "x_rate", "y_rate", "heading_rate")
    std = np.sqrt(np.diagonal(track.covariances, axis1=1, axis2=2)[:, :6])
    return {
        "k": np.arange(len(track.times)),
        "t": track.times,
        **{name: track.means[:, i] for i, name in enumerate(names)},
        **{f"std_{name}": std[:, i] for i, name in enumerate(names)},
        "points_used": np.diff(track.used_offsets),
        "nis": track.nis,
        "nis_degrees_of_freedom": track.nis_degrees_of_freedom,
    }


def score_columns(scores: Scores) -> dict[str, np.ndarray]:
    """The errors as a table, one row a scan; units as in `Scores`."""
    return {
        "k": np.arange(len(scores.times)),
        "t": scores.times,
        "centre_error": scores.centre_error,
        "orientation_error": scores.orientation_error,
        "iou": scores.iou,
        "nees_position": scores.nees_position,
        "nis": scores.nis,
    }


def track_arrays(track: Track) -> dict[str, np.ndarray]:
    """All arrays of the track by name; shapes as in `Track`."""
    return {name: value for name, value in vars(track).items() if isinstance(value, np.ndarray)}


def _csv_text(columns: Mapping[str, Sequence]) -> str:
    """Comma-separated columns; floats with as many digits as it takes to read them back."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(
        zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
    )
    return buffer.getvalue()
