"""Reading result folders: files that may be anybody's, checked before they are believed."""

import json
import math
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stixel_cli.errors import UserError

SERIES = ("centre_error", "orientation_error", "iou", "nees_position", "nis")
"""Errors over time that a folder may hold; units as in `evaluation.scores.Scores`."""

SWEEP_FILE = "sweep.yaml"
"""What marks the folder of a sweep."""

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREATEST_FILE = 64 * 2**20
_GREATEST_ARRAYS = 2**30
_MOST_SETTINGS, _DEEPEST = 50_000, 20
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True)
class RunFolder:
    """What a result folder tells of one run.

    Attributes:
        path: the folder.
        settings: dotted key to value as text, in the order of the configuration.
        manifest: what `manifest.json` says.
        metrics: name to value; None where there is none.
        times: (K,) s.
        series: name (of `SERIES`) to values (K,), NaN where there are none; missing ones left out.
        path_picture: PNG of the path seen from above, or None.
    """

    path: Path
    settings: dict[str, str]
    manifest: dict[str, Any]
    metrics: dict[str, float | int | None]
    times: np.ndarray
    series: dict[str, np.ndarray]
    path_picture: bytes | None


def read_folder(path: Path) -> RunFolder:
    """Read and check a result folder.

    Raises:
        UserError: if it is no result folder, or a file is missing or not what it must be.
    """
    check_folder(path)
    times, series = _read_series(path / "scores.npz")
    return RunFolder(
        path=path,
        settings=flat_settings(read_config(path)),
        manifest=read_manifest(path),
        metrics=read_metrics(path),
        times=times,
        series=series,
        path_picture=_read_picture(path / "figures" / "path.png"),
    )


def check_folder(path: Path) -> None:
    """Raise UserError unless `path` is the result folder of a run."""
    if not path.exists():
        raise UserError(f"{path}: there is no such folder")
    if not path.is_dir():
        raise UserError(f"{path}: not a folder; name the result folder of a run")
    if (path / SWEEP_FILE).is_file():
        point = path / "points" / "0000"
        raise UserError(f"{path}: the folder of a sweep; name one of its points, such as {point}")
    if not (path / "manifest.json").is_file():
        raise UserError(f"{path}: no result folder of a run (manifest.json is missing)")


def read_manifest(folder: Path) -> dict[str, Any]:
    """What a folder's `manifest.json` says; UserError if it is missing or no such file."""
    return read_json(folder / "manifest.json")


def read_metrics(folder: Path) -> dict[str, float | int | None]:
    """A folder's metrics, None where one has no value; UserError if the file is no such thing."""
    return _read_metrics(folder / "metrics.json")


def read_config(folder: Path) -> dict[str, Any]:
    """A folder's configuration as it stands in `config.yaml`, in plain types, not validated.

    Raises:
        UserError: if the file is missing, is no YAML, or is no configuration by its size.
    """
    file = folder / "config.yaml"
    try:
        content = yaml.load(read_text(file), _LOADER)
    except (yaml.YAMLError, RecursionError, ValueError):
        raise UserError(f"{file}: not valid YAML") from None
    if not isinstance(content, dict):
        raise UserError(f"{file}: must hold the groups of a configuration")
    _check_size(content, file)
    return content


def read_arrays(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a `.npz` file, none of which may hold objects.

    Raises:
        UserError: if it is missing, or is not a file of plain arrays.
    """
    if not file.is_file():
        raise UserError(f"{file.parent}: {file.name} is missing")
    try:
        with zipfile.ZipFile(file) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > _GREATEST_ARRAYS:
            raise UserError(f"{file}: too large for a file of a run")
        with np.load(file, allow_pickle=False) as arrays:
            return {name: np.asarray(arrays[name]) for name in arrays.files}
    except (
        OSError,
        ValueError,
        TypeError,
        EOFError,
        AttributeError,
        zipfile.BadZipFile,
        zlib.error,
    ):
        raise UserError(f"{file}: not a file of numeric arrays") from None


def _read_bytes(file: Path) -> bytes:
    try:
        if file.stat().st_size > _GREATEST_FILE:
            raise UserError(f"{file}: too large for a file of a run")
        return file.read_bytes()
    except FileNotFoundError:
        raise UserError(f"{file.parent}: {file.name} is missing") from None
    except OSError as error:
        raise UserError(f"{file}: cannot be read: {error.strerror}") from error


def read_text(file: Path) -> str:
    """The text of a file; UserError if it is missing, too large, or not in UTF-8."""
    try:
        return _read_bytes(file).decode("utf-8")
    except UnicodeDecodeError:
        raise UserError(f"{file}: not a text in UTF-8") from None


def read_json(file: Path) -> dict[str, Any]:
    """The names and values of a JSON file; UserError if it is missing or no such file."""
    try:
        content = json.loads(read_text(file))
    except (ValueError, RecursionError):
        raise UserError(f"{file}: not valid JSON") from None
    if not isinstance(content, dict):
        raise UserError(f"{file}: must hold names and values, not a {type(content).__name__}")
    return content


def _read_metrics(file: Path) -> dict[str, float | int | None]:
    metrics: dict[str, float | int | None] = {}
    for name, value in read_json(file).items():
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise UserError(f"{file}: {name} must be a number or null")
        metrics[name] = None if value is not None and not math.isfinite(value) else value
    return metrics


def flat_settings(content: dict[str, Any]) -> dict[str, str]:
    """Dotted key to value as text, in the order of `content`, as `read_config` gives it."""
    settings: dict[str, str] = {}
    _flatten(content, "", settings)
    return settings


def _check_size(content: Any, file: Path) -> None:
    """Refuse what would grow without end: YAML's aliases can refer to each other."""
    count, pending = 0, [(content, 0)]
    while pending:
        value, depth = pending.pop()
        count += 1
        if depth > _DEEPEST or count > _MOST_SETTINGS:
            raise UserError(f"{file}: too many settings to be a configuration")
        if isinstance(value, dict):
            pending += [(item, depth + 1) for item in value.values()]
        elif isinstance(value, list | tuple | set):
            pending += [(item, depth + 1) for item in value]


def _flatten(content: dict, prefix: str, settings: dict[str, str]) -> None:
    for key, value in content.items():
        if isinstance(value, dict):
            _flatten(value, f"{prefix}{key}.", settings)
        else:
            settings[f"{prefix}{key}"] = _setting_text(value)


def _setting_text(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and value.is_integer():
        return str(int(value))  # 3 and 3.0 are the same setting
    if isinstance(value, list):
        return f"[{', '.join(str(item) for item in value)}]"
    return str(value)


def _read_series(file: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    arrays = read_arrays(file)
    try:
        found = {n: arrays[n].astype(np.float64) for n in ("t", *SERIES) if n in arrays}
    except (ValueError, TypeError):
        raise UserError(f"{file}: not a file of numeric arrays") from None
    if "t" not in found:
        raise UserError(f"{file}: holds no times (t)")
    times = found.pop("t")
    for name, values in found.items():
        if values.ndim != 1 or values.shape != times.shape:
            raise UserError(f"{file}: {name} has shape {values.shape}, t has {times.shape}")
    return times, found


def _read_picture(file: Path) -> bytes | None:
    if not file.is_file():
        return None
    data = _read_bytes(file)
    if not data.startswith(PNG_SIGNATURE):
        raise UserError(f"{file}: not a PNG image")
    return data
