"""The data of a study's report: its complete sweeps with their runs."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from stixel_cli.config.folders import shipped_folder
from stixel_cli.engine.store import Store
from stixel_cli.errors import MissingData
from stixel_cli.results.result import RunResult, read_scored_run
from stixel_cli.studies.entry import SweepEntry
from stixel_cli.sweeps.folder import SweepFolder
from stixel_cli.sweeps.results import SweepResult

DATA = "STIXEL_DATA"
"""Environment variable that names the folder of the user's recordings."""


def data_folder(contents: str, needed: str = "") -> Path:
    """The folder that `DATA` names, or the folder `needed` in it; `contents` says what it has.

    Raises:
        MissingData: if there is no such folder.
    """
    named = os.environ.get(DATA, "")
    folder = Path(named, needed)
    if not named or not folder.is_dir():
        raise MissingData(f"{DATA}: must name a folder that has {contents}, got {named!r}")
    return folder.absolute()


def shipped_meshes(name: str) -> list[dict[str, list]]:
    """Axes: the meshes in a folder of the shipped studies, each in the folder of its road user."""
    files = sorted((shipped_folder("pipelines") / "studies" / name).glob("*/*.obj"))
    users = [file.parent.name for file in files]
    return [{"road_user": users, "road_user.mesh": list(map(str, files))}]


@dataclass(frozen=True)
class StudyData:
    """Input of a study's report: the complete sweeps by name, in the order of the study's file.

    Their runs also have `scores`, `load` and `variant`.
    """

    sweeps: Mapping[str, SweepResult]


def with_stages(result: SweepResult, entry: SweepEntry, store: Store) -> SweepResult:
    """A complete sweep, whose runs have what a report reads of their stages.

    Raises:
        UserError: if a run's folder cannot be read.
    """

    def with_results(run: RunResult) -> RunResult:
        def load(step: str) -> Any:
            nodes = run.graph.of_stage(step)
            values = [store.load(node.key) for node in nodes]
            return values[0] if nodes[0].stage.pattern == "once" else values

        return replace(
            run,
            scores=read_scored_run(SweepFolder(result.folder).run(run.index)).scores,
            load=load,
            variant=entry.variant_of(run.setting),
        )

    return replace(result, runs=tuple(map(with_results, result.runs)))
