"""The folder of a sweep.

sweep.yaml             the request: the axes, and the overrides of every run
runs.csv               one row for each run
summary.csv .md        the options with their means, and the paired differences from the best
index.html             the page of the sweep
play.html              the player of its runs, if asked for
runs/0000/ …           config.yaml, manifest.json, metrics.json, scores.npz, lineage.json
code/                  code digests to which the runs' lineage.json refer
failed/0007/ …         config.yaml, failure.json, traceback.txt
"""

import shlex
import shutil
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from stixel_cli.border import check_below, write_below, written
from stixel_cli.config.folders import PRESETS, of_the_machine
from stixel_cli.config.messages import validated
from stixel_cli.config.texts import split_override
from stixel_cli.errors import UserError, printable, printable_path
from stixel_cli.files import read_json, read_yaml
from stixel_cli.parameters import parameters
from stixel_cli.results.folder import write_whole_folder
from stixel_cli.results.reader import SWEEP_FILE, read_metrics, yaml_text
from stixel_cli.results.result import FAILED, MISSING, SKIPPED, RunResult, listed_run
from stixel_cli.sweeps.design import NOT_GIVEN, SEED

TABLE = "runs.csv"
SUMMARIES = ("summary.csv", "summary.md", "index.html")
PLAYER = "play.html"
RUNS = "runs"


@parameters
class SweepRequest:
    """The content of `sweep.yaml`.

    Attributes:
        working_directory: to which relative file names in the overrides refer.
        pictures: whether pictures are drawn.
        nodes: of the pipelines; their results are required in addition to the scores.
        axes: the keys of each axis.
        runs: overrides of each run, in the order of their indices.
        notes: command, time, revision, versions, machine; and `resumed`, the times of each resume.
        over: keys of the axes that means are over; older folders have none.
    """

    working_directory: str
    pictures: bool
    nodes: tuple[str, ...]
    axes: tuple[tuple[str, ...], ...]
    runs: tuple[tuple[str, ...], ...]
    notes: dict[str, Any]
    over: tuple[str, ...] = (SEED,)

    @property
    def keys(self) -> list[str]:
        """Every key that differs between runs."""
        return [key for axis in self.axes for key in axis]

    @property
    def text(self) -> str:
        """As YAML: the notes, then the other attributes."""
        content = {**self.notes, **vars(self)}
        del content["notes"]
        return yaml_text(content)

    def check(self) -> None:
        """Raise ValueError for a request without runs, or an axis that none has, or no result."""
        given = {split_override(text)[0] for run in self.runs for text in run}
        if not given or not given.issuperset(self.keys) or any(map(of_the_machine, self.keys)):
            raise ValueError("axes: must be keys of the runs that affect results")


_ENTRIES = [field.name for field in fields(SweepRequest) if field.name != "notes"]


class SweepFolder:
    """Writes and reads the folder at `path`; raises UserError for every disk failure."""

    def __init__(self, path: Path):
        self.path = path

    def create(self, request: SweepRequest) -> None:
        """Create the folder with its `sweep.yaml`, with the errors of `whole_folder`."""
        write_whole_folder(self.path, {SWEEP_FILE: request.text})

    def request(self) -> SweepRequest:
        """The content of `sweep.yaml`; UserError if this is not the folder of a sweep."""
        file = self.path / SWEEP_FILE
        if not self.path.is_dir():
            raise UserError(f"{printable_path(self.path)}: no such folder")
        if not file.exists():
            raise UserError(
                f"{printable_path(self.path)}: not the folder of a sweep ({SWEEP_FILE} is missing)"
            )
        content = read_yaml(file)
        if not isinstance(content, dict):
            raise UserError(f"{file}: must have the entries {', '.join(_ENTRIES)}")
        own = {name: content.pop(name) for name in _ENTRIES if name in content}
        return validated(SweepRequest, own | {"notes": content}, file)

    def resume_command(self, overrides: Iterable[str]) -> str:
        """The command line that resumes the sweep, with those of a run's overrides it needs."""
        machine = [text for text in overrides if of_the_machine(text)]
        return shlex.join(
            ["stixel", "sweep", "--resume", str(self.path), *machine, *PRESETS.option]
        )

    def run(self, index: int) -> Path:
        """The folder of a run; it may not exist."""
        return self.path / RUNS / f"{index:04d}"

    def runs(self, request: SweepRequest) -> list[RunResult]:
        """The runs in the order of their indices; those that are not done have no metrics."""
        runs = []
        for index, overrides in enumerate(request.runs):
            given = dict(map(split_override, overrides))
            swept = {key: given.get(key, NOT_GIVEN) for key in request.keys}
            manifest = {"run": index, "seed": swept.pop(SEED, ""), "swept": swept}
            run = RunResult(manifest=manifest, folder=self.run(index))
            try:
                runs.append(replace(run, metrics=read_metrics(run.folder)))
            except UserError:
                runs.append(replace(run, **self._failure(index)))
        return runs

    def _failure(self, index: int) -> dict[str, Any]:
        """Status and failure of a run that is not done."""
        file = self.path / FAILED / f"{index:04d}" / "failure.json"
        if not file.exists():
            return {"status": MISSING}
        content = read_json(file)
        status = SKIPPED if content.get("status") == SKIPPED else FAILED
        return {"status": status, "failure": UserError(printable(str(content.get("error")), 500))}

    def finished(self, count: int) -> dict[int, RunResult]:
        """The complete ones of `count` runs by index, with manifest and metrics."""
        runs = {index: listed_run(self.run(index)) for index in range(count)}
        return {i: run for i, run in runs.items() if isinstance(run.manifest.get("results"), list)}

    def write_run(self, index: int, files: Mapping[str, str | bytes], kind: str = RUNS) -> None:
        """Write the folder of a run atomically, or that of its failure (`FAILED`).

        It replaces an older one of either kind.
        """
        check_below(self.path, [f"{kind}/{index:04d}"])
        write_whole_folder(self.path / kind / f"{index:04d}", files, replace=True)
        with suppress(OSError):
            shutil.rmtree(self.path / (FAILED if kind == RUNS else RUNS) / f"{index:04d}")
            # An empty folder would look as if a run had failed.
            (self.path / FAILED).rmdir()

    def write(self, files: Mapping[str, str | bytes]) -> None:
        """Write files of the folder, by path below it, each atomically."""
        with written(self.path):
            write_below(self.path, files)

    def remove(self, patterns: Iterable[str]) -> None:
        """Remove outdated files and folders, by their paths with wildcards."""
        for path in [path for pattern in patterns for path in self.path.glob(pattern)]:
            with suppress(OSError):
                shutil.rmtree(path) if path.is_dir() else path.unlink()
