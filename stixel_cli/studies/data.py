"""The data of a study's report: its runs, as objects and as one pandas frame."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.config.schema import Configuration
from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.graph import Graph
from stixel_cli.engine.store import Store
from stixel_cli.errors import UserError
from stixel_cli.evaluation.scores import SERIES, Scores
from stixel_cli.results.reader import read_series
from stixel_cli.studies.entry import SweepEntry
from stixel_cli.sweeps.folder import SweepFolder
from stixel_cli.sweeps.results import SweepResult

if TYPE_CHECKING:
    import pandas as pd

STIXELS, LIDAR, BASELINE = "stixels", "lidar", "point"
"""Kinds of measurement and of tracker that the questions name."""

GROUPS = ("road_user", "path", "measurement", "tracker")
"""Groups of the configuration that a frame of runs always has as columns."""


@dataclass(frozen=True)
class StudyRun:
    """One run of a sweep.

    Attributes:
        index: its number in the sweep.
        setting: keys that differ between the sweep's runs, without the seed, to values as typed.
        seed: of its random numbers.
        configuration: of the run.
        metrics: name to value; None for a missing value.
        scores: errors over time.
        cpu_seconds: stage to the CPU seconds that its results took; NaN if they are not recorded.
        variant: name of the sweep's variant; "" if it has none.
        load: returns the result of a stage that the sweep's `results` names, or the list of the
            results of its chunks. It reads the store at each call.
    """

    index: int
    setting: Mapping[str, str]
    seed: int
    configuration: Configuration
    metrics: Mapping[str, float | int | None]
    scores: Scores
    cpu_seconds: Mapping[str, float]
    load: Callable[[str], Any]
    variant: str = ""


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


def run_frame(runs: Iterable[StudyRun]) -> "pd.DataFrame":
    """One row for each run: `run` itself, its setting, `seed` and metrics.

    Columns of the setting: `GROUPS`, each option as typed, or its kind if it is not swept;
    `measurement_kind` and `tracker_kind`; the other swept keys, as typed. `measurement` and
    `tracker` have the names of the field ("stixels", "GP-EKF"), followed by the other swept keys
    that distinguish them. Metrics are floats, NaN for a missing value.
    """
    import pandas as pd

    runs = list(runs)
    names = {
        "measurement": _distinct_names(runs, "measurement", measurement_name),
        "tracker": _distinct_names(runs, "tracker", tracker_name),
    }
    rows = [
        {
            **{group: _option(run, group) for group in GROUPS},
            **run.setting,
            **{group: found[_setting(run, group)] for group, found in names.items()},
            "measurement_kind": run.configuration.measurement.kind,
            "tracker_kind": run.configuration.tracker.kind,
            "variant": run.variant,
            "seed": run.seed,
            "run": run,
            **run.metrics,
        }
        for run in runs
    ]
    columns = (
        None if rows else [*GROUPS, "measurement_kind", "tracker_kind", "variant", "seed", "run"]
    )
    frame = pd.DataFrame(rows, columns=columns)
    return frame.astype({name: float for run in runs for name in run.metrics})


def measurement_name(option: str, configuration: Configuration) -> str:
    """The field's name of a measurement: stixels, fabricated rays, a lidar with its layers."""
    measurement = configuration.measurement
    if measurement.kind == LIDAR:
        return f"{measurement.scanner.layers}-layer lidar"
    return {STIXELS: "stixels", "fabricated": "fabricated rays"}.get(measurement.kind, option)


def tracker_name(option: str, configuration: Configuration) -> str:
    """The field's name of a tracker, or else the option."""
    return {"gp_ekf": "GP-EKF", BASELINE: "point tracker"}.get(configuration.tracker.kind, option)


def _distinct_names(
    runs: Sequence[StudyRun], group: str, name: Callable[[str, Configuration], str]
) -> dict[tuple, str]:
    """Setting of a group to a name; different settings have different names."""
    found: dict[tuple, tuple[str, str]] = {}
    for run in runs:
        key = _setting(run, group)
        if key not in found:
            option = _option(run, group)
            found[key] = (name(option, run.configuration), option)
    # Two options of one kind have the same name; the other swept keys do not make them two.
    options: dict[str, set[str]] = defaultdict(set)
    for text, option in found.values():
        options[text].add(option)
    return {
        key: ", ".join(
            [
                text if len(options[text]) == 1 else f"{text} ({option})",
                *(f"{name} {value}" for name, value in key[1:]),
            ]
        )
        for key, (text, option) in found.items()
    }


def _option(run: StudyRun, group: str) -> str:
    return run.setting.get(group, getattr(run.configuration, group).kind)


def _setting(run: StudyRun, group: str) -> tuple:
    """A group's option and other swept keys: the tracker's keys for it, the rest for the scans."""
    rest = [
        (key, value)
        for key, value in run.setting.items()
        if key not in GROUPS and key.startswith("tracker.") == (group == "tracker")
    ]
    return (run.setting.get(group), *rest)


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
        planned = run = one.planned
        runs.append(
            StudyRun(
                index=run.index,
                setting=run.setting,
                seed=run.seed,
                configuration=run.composition.configuration,
                metrics=one.metrics,
                scores=_scores(folder.run(run.index), one.metrics),
                cpu_seconds=seconds.by_stage([(planned.graph, planned.targets)]),
                load=_loader(planned.graph, store),
                variant=entry.variant_of(run.setting),
            )
        )
    keys = tuple(result.runs[0].planned.settings)
    return StudySweep(entry.name, keys, tuple(runs))


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
