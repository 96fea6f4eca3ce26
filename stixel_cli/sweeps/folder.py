"""The folder of a sweep: what was asked for, a row and a small folder a point, and the summary.

sweep.yaml         what was asked for, and the overrides of every point
runs.csv           one row a point
summary.csv .md .tex   statistics over the seeds of each setting, once all points are there
figures/           one an axis, once all points are there
points/0000/ …     config.yaml, manifest.json, metrics.json, scores.npz
failed/0007/ …     config.yaml, failure.json, traceback.txt
"""

import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from stixel_cli.errors import UserError

PLAN = "sweep.yaml"
RUNS = "runs.csv"
POINTS, FAILED, FIGURES = "points", "failed", "figures"

_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True)
class SweepRequest:
    """What was asked for, as `sweep.yaml` holds it.

    Attributes:
        axes: the keys of each axis.
        points: overrides of each point, in the order of their indices.
        shuffle: seed of the order in which they run; None for theirs.
        pictures: whether pictures are drawn.
        notes: command, time, revision, versions, machine.
    """

    axes: tuple[tuple[str, ...], ...]
    points: tuple[tuple[str, ...], ...]
    shuffle: int | None
    pictures: bool
    notes: Mapping[str, Any]

    @property
    def keys(self) -> list[str]:
        """Every key that differs between points."""
        return [key for axis in self.axes for key in axis]


class SweepFolder:
    """Writes and reads the folder at `path`; every failure of the disk is a UserError."""

    def __init__(self, path: Path):
        self.path = path

    def create(self, request: SweepRequest) -> None:
        """Make the folder, and say in it what was asked for."""
        with self._written():
            self.path.mkdir(parents=True)
            content = {
                **request.notes,
                "shuffle": request.shuffle,
                "pictures": request.pictures,
                "axes": [list(keys) for keys in request.axes],
                "points": [list(overrides) for overrides in request.points],
            }
            self._write(PLAN, yaml_text(content))

    def request(self) -> SweepRequest:
        """What was asked for.

        Raises:
            UserError: if this is no folder of a sweep.
        """
        file = self.path / PLAN
        if not self.path.is_dir():
            raise UserError(f"{self.path}: there is no such folder")
        try:
            content = yaml.load(file.read_text(encoding="utf-8"), _LOADER)
            axes = tuple(tuple(map(str, keys)) for keys in content.pop("axes"))
            points = tuple(tuple(map(str, overrides)) for overrides in content.pop("points"))
            shuffle, pictures = content.pop("shuffle"), content.pop("pictures")
        except FileNotFoundError:
            raise UserError(f"{self.path}: no folder of a sweep ({PLAN} is missing)") from None
        except OSError as error:
            raise UserError(f"{file}: cannot be read: {error.strerror}") from None
        except (yaml.YAMLError, AttributeError, KeyError, TypeError, ValueError):
            raise UserError(f"{file}: not what a sweep was asked for") from None
        if not points or not isinstance(shuffle, int | None) or not isinstance(pictures, bool):
            raise UserError(f"{file}: not what a sweep was asked for")
        return SweepRequest(axes, points, shuffle, pictures, content)

    def point(self, index: int) -> Path:
        """The folder of a point, whether it is there or not."""
        return self.path / POINTS / f"{index:04d}"

    def stored(self, index: int, results: Sequence[str]) -> dict[str, Any] | None:
        """The metrics of a point that is complete with these results, by their keys; else None."""
        folder = self.point(index)
        try:
            manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
            metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        if not isinstance(manifest, dict) or not isinstance(metrics, dict):
            return None
        return metrics if manifest.get("results") == list(results) else None

    def write_point(
        self, index: int, files: Mapping[str, str | bytes | Callable[[Path], None]]
    ) -> None:
        """Write a point's folder: whole, in place of an older one, or not at all."""
        self._write_folder(self.point(index), files)
        with suppress(OSError):
            shutil.rmtree(self.path / FAILED / f"{index:04d}")

    def write_failure(self, index: int, files: Mapping[str, str]) -> None:
        """Write what became of a point that failed, and take away what an older run left of it."""
        self._write_folder(self.path / FAILED / f"{index:04d}", files)
        with suppress(OSError):
            shutil.rmtree(self.point(index))

    def write_table(self, name: str, text: str) -> None:
        """Write a file of the folder: whole, or not at all."""
        with self._written():
            self._write(name, text)

    def write_figures(self, figures: Mapping[str, bytes]) -> None:
        """Write the figures."""
        with self._written():
            (self.path / FIGURES).mkdir(exist_ok=True)
            for name, data in figures.items():
                (self.path / FIGURES / name).write_bytes(data)

    def remove(self, names: Iterable[str]) -> None:
        """Take away files or folders that do not hold any more."""
        for name in names:
            path = self.path / name
            with suppress(OSError):
                shutil.rmtree(path) if path.is_dir() else path.unlink()

    def remove_unfinished(self) -> None:
        """Take away what a killed process left of a point's folder."""
        for name in (POINTS, FAILED):
            for path in (self.path / name).glob(".*.partial-*"):
                shutil.rmtree(path, ignore_errors=True)

    def _write_folder(
        self, folder: Path, files: Mapping[str, str | bytes | Callable[[Path], None]]
    ) -> None:
        partial = folder.with_name(f".{folder.name}.partial-{os.getpid()}")
        try:
            with self._written():
                partial.mkdir(parents=True)
                for name, content in files.items():
                    file = partial / name
                    if "/" in name:
                        file.parent.mkdir(parents=True, exist_ok=True)
                    if isinstance(content, str):
                        file.write_text(content, encoding="utf-8")
                    elif isinstance(content, bytes):
                        file.write_bytes(content)
                    else:
                        content(file)
                if folder.exists():
                    shutil.rmtree(folder)
                partial.rename(folder)
        finally:
            if partial.exists():
                shutil.rmtree(partial, ignore_errors=True)

    def _write(self, name: str, text: str) -> None:
        partial = self.path / f".{name}.partial-{os.getpid()}"
        try:
            partial.write_text(text, encoding="utf-8")
            partial.replace(self.path / name)
        finally:
            partial.unlink(missing_ok=True)

    @contextmanager
    def _written(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise UserError(f"{self.path}: cannot be written: {error.strerror or error}") from error


def yaml_text(content: Any) -> str:
    """YAML in the order of the keys."""
    return yaml.dump(content, Dumper=_DUMPER, sort_keys=False, allow_unicode=True)
