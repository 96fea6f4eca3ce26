"""The runs of a sweep as one graph: runs share the nodes that they have in common."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

from stixel_cli.engine.graph import Graph, GraphBuilder, merge
from stixel_cli.engine.plan import Durations, plan
from stixel_cli.engine.store import Store, open_store
from stixel_cli.errors import ConfigurationError
from stixel_cli.experiment.stages import CHUNK_SIZE, pipeline_stages, scan_count
from stixel_cli.experiment.table.table import picture_stages
from stixel_cli.sweeps.design import SEED
from stixel_cli.sweeps.runs import PlannedRun


@dataclass(frozen=True)
class StagePlan:
    """The work of one stage in a sweep.

    Attributes:
        name: of the stage.
        nodes: number of nodes that the runs need, each counted once.
        cached, to_run: number of nodes in the store, and number of missing ones.
        seconds: estimated time of the missing nodes on one worker, from recorded durations; None
            if there are no records.
    """

    name: str
    nodes: int
    cached: int
    to_run: int
    seconds: float | None


@dataclass(frozen=True)
class SweepPlan:
    """The work of a sweep.

    Attributes:
        runs: all runs.
        graph: of all runs.
        needed: ids of the nodes that the runs need.
        missing: ids of the nodes to compute, each after its inputs.
        stages: by stage, in the order of the data.
        notes: on axes that the stages of some runs ignore.
    """

    runs: tuple[PlannedRun, ...]
    graph: Graph
    needed: frozenset[str]
    missing: tuple[str, ...]
    stages: tuple[StagePlan, ...]
    notes: tuple[str, ...] = ()

    def complete_runs(self) -> int:
        """Number of runs whose results are all in the store."""
        missing = set(self.missing)
        return sum(missing.isdisjoint(planned.targets) for planned in self.runs)

    def seconds(self, workers: int) -> float | None:
        """Estimated time if the work divides evenly among the workers; None if unknown."""
        known = [stage.seconds for stage in self.stages if stage.to_run]
        if any(seconds is None for seconds in known):
            return None
        return sum(known) / workers


def plan_runs(
    runs: Sequence[PlannedRun], pictures: bool = False, nodes: Sequence[str] = ()
) -> list[PlannedRun]:
    """The graphs of the runs; common parts are built once.

    Each run requires its scores; with `pictures` also its pictures; and the results of those
    `nodes` that its pipeline has.

    Raises:
        UserError: if the pipeline's file is wrong, or an input file cannot be read.
    """
    cache = runs[0].composition.configuration.cache
    builder = GraphBuilder(open_store(cache).folder)
    planned = []
    for run in runs:
        composition = run.composition
        stages = pipeline_stages(composition)
        graph = builder.build(stages, scan_count(composition), CHUNK_SIZE)
        wanted = ["scores", *(picture_stages(graph) if pictures else ()), *nodes]
        names = [name for name in dict.fromkeys(wanted) if name in graph.stages]
        planned.append(replace(run, graph=graph, targets=tuple(graph.expand(names))))
    return planned


def plan_sweep(planned: Sequence[PlannedRun], store: Store, notes: Sequence[str] = ()) -> SweepPlan:
    """The nodes of the runs that `store` lacks. It looks entries up without reading them.

    Raises:
        CacheError: if the store cannot be read.
    """
    graph = merge(one.graph for one in planned)
    targets = list(dict.fromkeys(target for one in planned for target in one.targets))
    found = plan(graph, targets, store, verify=False)
    missing = set(found.missing)
    durations = Durations(store.folder)
    stages = []
    for name in graph.stages:
        keys = [key for key in graph.stages[name] if key in found.needed]
        to_run = [graph.nodes[key] for key in keys if key in missing]
        if keys:
            counts = (len(keys), len(keys) - len(to_run), len(to_run))
            stages.append(StagePlan(name, *counts, durations.estimate(to_run)))
    return SweepPlan(
        tuple(planned), graph, found.needed, found.missing, tuple(stages), tuple(notes)
    )


def check_axes(planned: Sequence[PlannedRun]) -> list[str]:
    """Refuse an axis that no stage reads; return notes on axes that the stages of some runs ignore.

    Runs whose results have the same keys give the same results, whatever their settings are.

    Raises:
        ConfigurationError: in one line that names the axis.
    """
    notes = []
    keys = list(planned[0].settings)
    for key in keys:
        if key.partition(".")[0] in ("executor", "cache"):
            raise ConfigurationError(f"{key}: it does not affect results, so it cannot be swept")
    for key in keys:
        groups: dict[tuple, list[tuple[str, ...]]] = defaultdict(list)
        for one in planned:
            others = tuple(v for name, v in one.settings.items() if name != key)
            groups[others].append(one.targets)
        several = {others: targets for others, targets in groups.items() if len(targets) > 1}
        if not several:
            # Zipped with another key, which is checked in its place.
            continue
        idle = [others for others, targets in several.items() if len(set(targets)) == 1]
        if len(idle) == len(several) and key.startswith("pictures"):
            raise ConfigurationError(
                f"{key}: no stage reads it: a sweep draws pictures only with --pictures"
            )
        if len(idle) == len(several):
            choices = planned[0].composition.choices
            raise ConfigurationError(
                f"{key}: no stage reads it with measurement={choices.get('measurement')} and "
                f"path={choices.get('path')}: all runs would be equal"
            )
        if idle and key != SEED:
            labels = (name for name in keys if name != key)
            first = " ".join(f"{k}={v}" for k, v in zip(labels, idle[0], strict=True))
            notes.append(
                f"{key}: no stage reads it in {len(idle)} of {len(several)} settings of the other "
                f"axes ({first}), so their runs give equal results"
            )
    return notes or _equal_runs(planned)


def _equal_runs(planned: Sequence[PlannedRun]) -> list[str]:
    seen: dict[tuple[str, ...], PlannedRun] = {}
    for one in planned:
        other = seen.setdefault(one.targets, one)
        if other is not one:
            return [
                f"runs {other.index} and {one.index} give equal results: "
                f"{other.label} and {one.label}"
            ]
    return []
