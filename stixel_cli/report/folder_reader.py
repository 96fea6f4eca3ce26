"""Reading result folders: files that may be anybody's, checked before they are believed."""

import json
import math
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stixel_cli.errors import UserError

SERIES = ("centre_error", "orientation_error", "iou", "nees_position", "nis")
"""Errors over time that a folder may hold; units as in `evaluation.scores.Scores`."""

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREATEST_FILE = 64 * 2**20
_MOST_SETTINGS, _DEEPEST = 5000, 20


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
    if not path.exists():
        raise UserError(f"{path}: there is no such folder")
    if not path.is_dir():
        raise UserError(f"{path}: not a folder; name the result folder of a run")
    if not (path / "manifest.json").is_file():
        raise UserError(f"{path}: no result folder of a run (manifest.json is missing)")
    times, series = _read_series(path / "scores.npz")
    return RunFolder(
        path=path,
        settings=_read_settings(path / "config.yaml"),
        manifest=_read_json(path / "manifest.json"),
        metrics=_read_metrics(path / "metrics.json"),
        times=times,
        series=series,
        path_picture=_read_picture(path / "figures" / "path.png"),
    )


def _read_bytes(file: Path) -> bytes:
    try:
        if file.stat().st_size > _GREATEST_FILE:
            raise UserError(f"{file}: too large for a file of a run")
        return file.read_bytes()
    except FileNotFoundError:
        raise UserError(f"{file.parent}: {file.name} is missing") from None
    except OSError as error:
        raise UserError(f"{file}: cannot be read: {error.strerror}") from error


def _read_text(file: Path) -> str:
    try:
        return _read_bytes(file).decode("utf-8")
    except UnicodeDecodeError:
        raise UserError(f"{file}: not a text in UTF-8") from None


def _read_json(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(_read_text(file))
    except (ValueError, RecursionError):
        raise UserError(f"{file}: not valid JSON") from None
    if not isinstance(content, dict):
        raise UserError(f"{file}: must hold names and values, not a {type(content).__name__}")
    return content


def _read_metrics(file: Path) -> dict[str, float | int | None]:
    metrics: dict[str, float | int | None] = {}
    for name, value in _read_json(file).items():
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise UserError(f"{file}: {name} must be a number or null")
        metrics[name] = None if value is not None and not math.isfinite(value) else value
    return metrics


def _read_settings(file: Path) -> dict[str, str]:
    try:
        content = yaml.safe_load(_read_text(file))
    except (yaml.YAMLError, RecursionError, ValueError):
        raise UserError(f"{file}: not valid YAML") from None
    if not isinstance(content, dict):
        raise UserError(f"{file}: must hold the groups of a configuration")
    settings: dict[str, str] = {}
    _flatten(content, "", settings, file, 0)
    return settings


def _flatten(content: dict, prefix: str, settings: dict[str, str], file: Path, depth: int) -> None:
    # A file may refer to itself (YAML's aliases), so both size and depth have an end.
    if depth > _DEEPEST or len(settings) > _MOST_SETTINGS:
        raise UserError(f"{file}: too many settings to be a configuration")
    for key, value in content.items():
        if isinstance(value, dict):
            _flatten(value, f"{prefix}{key}.", settings, file, depth + 1)
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
    if not file.is_file():
        raise UserError(f"{file.parent}: {file.name} is missing")
    found: dict[str, np.ndarray] = {}
    try:
        with np.load(file, allow_pickle=False) as arrays:
            for name in ("t", *SERIES):
                if name in arrays.files:
                    found[name] = np.asarray(arrays[name], dtype=np.float64)
    except (OSError, ValueError, TypeError, EOFError, AttributeError, zipfile.BadZipFile):
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
