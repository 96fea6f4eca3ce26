"""The data of a study's report: its complete sweeps with their runs."""

import math
import os
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from stixel_cli.config.folders import shipped_folder
from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.store import Store
from stixel_cli.errors import MissingData, UserError
from stixel_cli.evaluation.scores import SERIES, Scores
from stixel_cli.results.reader import read_series
from stixel_cli.results.result import RunResult
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

    Their runs also have `scores`, `cpu_seconds`, `load` and `variant`.
    """

    name: str
    title: str
    question: str
    sweeps: Mapping[str, SweepResult]


class NodeSeconds(dict[str, float]):
    """Recorded CPU seconds of nodes in a store, each read once; NaN for one without a record."""

    def __init__(self, store: Store):
        super().__init__()
        self._store = store

    def __missing__(self, key: str) -> float:
        """Read those of a node; its result may have been removed."""
        try:
            self[key] = float(self._store.meta(key).get("cpu_seconds", math.nan))
        except MissingEntry:
            self[key] = math.nan
        return self[key]

    def by_stage(self, runs: Iterable[RunResult]) -> dict[str, float]:
        """CPU seconds by stage of the nodes that runs of sweeps need, each counted once.

        NaN for a stage with a node whose CPU seconds are unknown.
        """
        stage_of: dict[str, str] = {}
        for graph, targets in ((run.planned.graph, run.planned.targets) for run in runs):
            needed = graph.ancestors(targets)
            for name, keys in graph.stages.items():
                stage_of.update((key, name) for key in keys if key in needed)
        total: dict[str, float] = defaultdict(float)
        for key, name in stage_of.items():
            total[name] += self[key]
        return dict(total)


def with_stages(
    result: SweepResult, entry: SweepEntry, store: Store, seconds: NodeSeconds
) -> SweepResult:
    """A complete sweep, whose runs have what a report reads of their stages.

    Raises:
        UserError: if a run's folder cannot be read.
    """

    def with_results(run: RunResult) -> RunResult:
        def load(step: str) -> Any:
            nodes = run.planned.graph.of_stage(step)
            values = [store.load(node.key) for node in nodes]
            return values[0] if nodes[0].stage.pattern == "once" else values

        file = SweepFolder(result.folder).run(run.index) / "scores.npz"
        times, series = read_series(file)
        missing = [name for name in SERIES if name not in series]
        if missing:
            raise UserError(f"{file}: {missing[0]} is missing")
        return replace(
            run,
            scores=Scores(times=times, **series, metrics=dict(run.metrics)),
            cpu_seconds=seconds.by_stage([run]),
            load=load,
            variant=entry.variant_of(run.setting),
        )

    return replace(result, runs=tuple(map(with_results, result.runs)))
