"""The folder of a sweep.

sweep.yaml             the request: the axes, and the overrides of every run
runs.csv               one row for each run
summary.csv .md .tex   statistics over the seeds of each complete setting
figures/               one figure for each axis, of the same settings
runs/0000/ …           config.yaml, manifest.json, metrics.json, scores.npz, lineage.json
code/                  code digests to which the runs' lineage.json refer
failed/0007/ …         config.yaml, failure.json, traceback.txt
"""

import shutil
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stixel_cli.config.folders import of_the_machine
from stixel_cli.config.texts import split_override
from stixel_cli.errors import UserError, printable_path
from stixel_cli.files import read_yaml, write_whole, written
from stixel_cli.results.folder import Content, write_whole_folder
from stixel_cli.results.reader import read_manifest, read_metrics, yaml_text
from stixel_cli.results.result import MISSING, RunResult
from stixel_cli.sweeps.design import SEED

PLAN = "sweep.yaml"
TABLE = "runs.csv"
SUMMARIES = ("summary.csv", "summary.md", "summary.tex")
RUNS, FAILED, FIGURES = "runs", "failed", "figures"


@dataclass(frozen=True)
class SweepRequest:
    """The content of `sweep.yaml`.

    Attributes:
        axes: the keys of each axis.
        runs: overrides of each run, in the order of their indices.
        shuffle: seed of the order of execution; None for the order of the indices.
        pictures: whether pictures are drawn.
        nodes: of the pipelines; their results are required in addition to the scores.
        working_directory: to which relative file names in the overrides refer.
        notes: command, time, revision, versions, machine; and `resumed`, the times of each resume.
    """

    axes: tuple[tuple[str, ...], ...]
    runs: tuple[tuple[str, ...], ...]
    shuffle: int | None
    pictures: bool
    nodes: tuple[str, ...]
    working_directory: str
    notes: Mapping[str, Any]

    @property
    def keys(self) -> list[str]:
        """Every key that differs between runs."""
        return [key for axis in self.axes for key in axis]

    @property
    def text(self) -> str:
        """As YAML."""
        content = {
            **self.notes,
            "working_directory": self.working_directory,
            "shuffle": self.shuffle,
            "pictures": self.pictures,
            "nodes": list(self.nodes),
            "axes": [list(keys) for keys in self.axes],
            "runs": [list(overrides) for overrides in self.runs],
        }
        return yaml_text(content)


class SweepFolder:
    """Writes and reads the folder at `path`; raises UserError for every disk failure."""

    def __init__(self, path: Path):
        self.path = path

    def create(self, request: SweepRequest) -> None:
        """Create the folder with its `sweep.yaml`.

        Raises:
            FolderTaken: if a folder of this name exists.
            UserError: if it cannot be written.
        """
        write_whole_folder(self.path, {PLAN: request.text})

    def request(self) -> SweepRequest:
        """The content of `sweep.yaml`.

        Raises:
            UserError: if this is not the folder of a sweep.
        """
        file = self.path / PLAN
        if not self.path.is_dir():
            raise UserError(f"{printable_path(self.path)}: no such folder")
        if not file.exists():
            raise UserError(
                f"{printable_path(self.path)}: not the folder of a sweep ({PLAN} is missing)"
            )
        content = read_yaml(file)
        try:
            axes = tuple(tuple(map(str, keys)) for keys in content.pop("axes"))
            runs = tuple(tuple(map(str, overrides)) for overrides in content.pop("runs"))
            shuffle, pictures = content.pop("shuffle"), content.pop("pictures")
            nodes = tuple(map(str, content.pop("nodes")))
            working_directory = str(content.pop("working_directory"))
        except (AttributeError, KeyError, TypeError):
            raise UserError(f"{file}: not a valid {PLAN} of this version of stixel") from None
        swept = [key for keys in axes for key in keys]
        typed = isinstance(shuffle, int | None) and isinstance(pictures, bool)
        if not runs or not typed or any(map(of_the_machine, swept)):
            raise UserError(f"{file}: not a valid {PLAN} of this version of stixel")
        for index, overrides in enumerate(runs):
            given = {split_override(text)[0] for text in overrides}
            for key in (key for key in swept if key not in given):
                raise UserError(f"{file}: run {index} has no value for {key[:60]}, an axis")
        return SweepRequest(axes, runs, shuffle, pictures, nodes, working_directory, content)

    def run(self, index: int) -> Path:
        """The folder of a run; it may not exist."""
        return self.path / RUNS / f"{index:04d}"

    def runs(self, request: SweepRequest) -> list[RunResult]:
        """The runs in the order of their indices; without metrics those that are not done."""
        runs = []
        for index, overrides in enumerate(request.runs):
            given = dict(map(split_override, overrides))
            swept = {key: given[key] for key in request.keys}
            manifest = {"run": index, "seed": swept.pop(SEED, ""), "swept": swept}
            folder = self.run(index)
            try:
                run = RunResult(manifest=manifest, metrics=read_metrics(folder), folder=folder)
            except UserError:
                run = RunResult(manifest=manifest, folder=folder, status=MISSING)
            runs.append(run)
        return runs

    def finished(self, count: int) -> dict[int, RunResult]:
        """The complete ones of `count` runs by index, with manifest and metrics."""
        runs = {}
        for index in range(count):
            folder = self.run(index)
            with suppress(UserError):
                manifest, metrics = read_manifest(folder), read_metrics(folder)
                if isinstance(manifest.get("results"), list):
                    runs[index] = RunResult(manifest=manifest, metrics=metrics, folder=folder)
        return runs

    def write_run(self, index: int, files: Mapping[str, Content], kind: str = RUNS) -> None:
        """Write the folder of a run atomically, or that of its failure (`FAILED`).

        It replaces an older one of either kind.
        """
        write_whole_folder(self.path / kind / f"{index:04d}", files, replace=True)
        with suppress(OSError):
            shutil.rmtree(self.path / (FAILED if kind == RUNS else RUNS) / f"{index:04d}")
            # An empty folder would look as if a run had failed.
            (self.path / FAILED).rmdir()

    def write(self, files: Mapping[str, str | bytes]) -> None:
        """Write files of the folder, by path below it, each atomically."""
        with written(self.path):
            for name, content in files.items():
                write_whole(self.path / name, content)

    def remove(self, patterns: Iterable[str]) -> None:
        """Remove outdated files and folders, by their paths with wildcards."""
        for path in [path for pattern in patterns for path in self.path.glob(pattern)]:
            with suppress(OSError):
                shutil.rmtree(path) if path.is_dir() else path.unlink()
