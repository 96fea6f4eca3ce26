"""Read and list result folders, and the text of their files.

Files may come from anybody, so each is checked.
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stixel_cli.errors import UserError, printable_path
from stixel_cli.evaluation.scores import SERIES
from stixel_cli.files import read_arrays, read_bytes, read_json, read_yaml

MANIFEST = "manifest.json"
"""The file that marks the folder of a run."""

SWEEP_FILE = "sweep.yaml"
"""The file that marks the folder of a sweep."""

DEEPEST = 4
"""Depth of the search below the folder."""


def check_folder(path: Path) -> None:
    """Raise UserError unless `path` is the result folder of a run."""
    if not path.exists():
        raise UserError(f"{printable_path(path)}: no such folder")
    if not path.is_dir():
        raise UserError(f"{path}: not a folder; give the result folder of a run")
    if (path / SWEEP_FILE).exists():
        run = path / "runs" / "0000"
        raise UserError(
            f"{path}: a sweep's folder; give the folder of one of its runs, such as {run}"
        )
    if not (path / MANIFEST).exists():
        raise UserError(
            f"{printable_path(path)}: not the result folder of a run ({MANIFEST} is missing)"
        )


def read_manifest(folder: Path) -> dict[str, Any]:
    """Content of a folder's `manifest.json`; UserError if it is missing or not valid."""
    return read_json(folder / MANIFEST)


def read_metrics(folder: Path) -> dict[str, float | int | None]:
    """Metrics of a folder, None for one without a value; UserError if the file is not valid."""
    file = folder / "metrics.json"
    metrics = read_json(file)
    for name, value in metrics.items():
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise UserError(f"{file}: {name[:60]} must be a number or null")
    return metrics


def read_config(folder: Path) -> dict[str, Any]:
    """Content of a folder's `config.yaml`, not validated; UserError if it is no configuration."""
    file = folder / "config.yaml"
    content = read_yaml(file)
    if not isinstance(content, dict) or not all(isinstance(key, str) for key in content):
        raise UserError(f"{file}: must contain the groups of a configuration")
    return content


def flat_settings(content: dict[str, Any], prefix: str = "") -> dict[str, str]:
    """Dotted key to value as text, in the order of `content`, as `read_config` gives it."""
    settings: dict[str, str] = {}
    for name, value in content.items():
        key = f"{prefix}{name}"
        match value:
            case dict():
                settings |= flat_settings(value, f"{key}.")
            case None:
                settings[key] = "null"
            case bool():
                settings[key] = str(value).lower()
            case float() if value.is_integer():
                settings[key] = str(int(value))  # 3 and 3.0 are the same setting
            case list():
                settings[key] = f"[{', '.join(map(str, value))}]"
            case _:
                settings[key] = str(value)
    return settings


def read_series(file: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The times (K,), s, of a file of scores, and the `SERIES` that it has, each (K,).

    UserError if it is missing or not valid, or the shapes of its arrays differ.
    """
    arrays = read_arrays(file)
    if "t" not in arrays:
        raise UserError(f"{file}: the times (t) are missing")
    found = {name: arrays[name].astype(np.float64) for name in SERIES if name in arrays}
    times = arrays["t"].astype(np.float64)
    if times.ndim != 1:
        raise UserError(f"{file}: t has shape {times.shape}, must have one dimension")
    for name, values in found.items():
        if values.shape != times.shape:
            raise UserError(f"{file}: {name} has shape {values.shape}, t has {times.shape}")
    return times, found


def read_png(file: Path) -> bytes:
    """The content of a picture; UserError if it is not a PNG image."""
    data = read_bytes(file)
    if not data.startswith(b"\x89PNG\r\n\x1a\n"):
        raise UserError(f"{file}: not a PNG image")
    return data


def find_folders(root: Path) -> list[Path]:
    """The folders of runs and sweeps below `root`, without the runs of sweeps.

    UserError if the folder does not exist or cannot be read.
    """
    if not root.is_dir():
        raise UserError(f"{printable_path(root)}: no such folder")
    if not os.access(root, os.R_OK | os.X_OK):
        raise UserError(f"{root}: not a readable folder")
    found = []
    for place, folders, files in os.walk(root):
        depth, inside = len(Path(place).relative_to(root).parts), {*folders, *files}
        is_result = MANIFEST in inside or (SWEEP_FILE in inside and depth > 0)
        found += [Path(place)] * is_result
        # A name that begins with a dot is unfinished or of another program.
        further = [name for name in sorted(folders) if not name.startswith(".")]
        folders[:] = further if depth < DEEPEST and not is_result else []
    return found


_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def json_text(value: Any) -> str:
    """JSON with two spaces of indent and a newline at its end; NaN is refused."""
    return json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def yaml_text(content: Any) -> str:
    """YAML in the order of the keys."""
    return yaml.dump(content, Dumper=_DUMPER, sort_keys=False, allow_unicode=True)


def listed(parts: Sequence[object]) -> str:
    """a, b and c."""
    texts = [str(part) for part in parts]
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)
