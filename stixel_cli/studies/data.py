"""The data of a study's report: its complete sweeps with their runs."""

import math
import os
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.graph import Graph
from stixel_cli.engine.store import Store
from stixel_cli.errors import MissingData, UserError
from stixel_cli.evaluation.scores import SERIES, Scores
from stixel_cli.report.run_frame import StudyRun
from stixel_cli.results.reader import read_series
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


@dataclass(frozen=True)
class StudySweep:
    """A complete sweep; `keys` are those of its axes, including the seed if it is swept."""

    name: str
    keys: tuple[str, ...]
    runs: tuple[StudyRun, ...]


@dataclass(frozen=True)
class StudyData:
    """Input of a study's report: the sweeps by name, in the order of the study's file."""

    name: str
    title: str
    question: str
    sweeps: Mapping[str, StudySweep]


class NodeSeconds:
    """Recorded CPU seconds of nodes in a store, each read once."""

    def __init__(self, store: Store):
        self._store = store
        self._known: dict[str, float] = {}

    def of(self, key: str) -> float:
        """CPU seconds of one node; NaN if they are not recorded or its result was removed."""
        if key not in self._known:
            try:
                self._known[key] = float(self._store.meta(key).get("cpu_seconds", math.nan))
            except MissingEntry:
                self._known[key] = math.nan
        return self._known[key]

    def by_stage(self, graphs: Sequence[tuple[Graph, Sequence[str]]]) -> dict[str, float]:
        """CPU seconds by stage of the nodes that the targets of graphs need, each counted once.

        NaN for a stage with a node whose CPU seconds are unknown.
        """
        stage_of: dict[str, str] = {}
        for graph, targets in graphs:
            needed = graph.ancestors(targets)
            for name, keys in graph.stages.items():
                stage_of.update((key, name) for key in keys if key in needed)
        total: dict[str, float] = defaultdict(float)
        for key, name in stage_of.items():
            total[name] += self.of(key)
        return dict(total)


def study_sweep(
    entry: SweepEntry, result: SweepResult, store: Store, seconds: NodeSeconds
) -> StudySweep:
    """The data of a complete sweep.

    Raises:
        UserError: if a run's folder cannot be read.
    """
    folder = SweepFolder(result.folder)
    runs = []
    for one in result.runs:
        planned = one.planned
        runs.append(
            StudyRun(
                index=planned.index,
                setting=planned.setting,
                seed=planned.seed,
                configuration=planned.composition.configuration,
                metrics=one.metrics,
                scores=_scores(folder.run(planned.index), one.metrics),
                cpu_seconds=seconds.by_stage([(planned.graph, planned.targets)]),
                load=_loader(planned.graph, store),
                variant=entry.variant_of(planned.setting),
            )
        )
    return StudySweep(entry.name, tuple(result.runs[0].planned.settings), tuple(runs))


def _scores(folder: Path, metrics: Mapping[str, float | int | None]) -> Scores:
    file = folder / "scores.npz"
    times, series = read_series(file)
    missing = [name for name in SERIES if name not in series]
    if missing:
        raise UserError(f"{file}: {missing[0]} is missing")
    return Scores(times=times, **series, metrics=dict(metrics))


def _loader(graph: Graph, store: Store) -> Callable[[str], Any]:
    def load(step: str) -> Any:
        nodes = graph.of_stage(step)
        values = [store.load(node.key) for node in nodes]
        return values[0] if nodes[0].stage.pattern == "once" else values

    return load
