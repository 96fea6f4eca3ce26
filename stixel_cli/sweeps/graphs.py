"""The runs of a sweep as one graph: what they share is there once."""

from collections.abc import Sequence
from dataclasses import dataclass

from stixel_cli.engine.graph import Graph, GraphBuilder, merge
from stixel_cli.engine.plan import Durations, plan
from stixel_cli.engine.store import Store
from stixel_cli.errors import ConfigurationError
from stixel_cli.experiment.stages import (
    CHUNK_SIZE,
    draws,
    picture_stages,
    pipeline_stages,
    scan_count,
)
from stixel_cli.sweeps.runs import SweepRun

SCORES = "scores"


@dataclass(frozen=True)
class PlannedRun:
    """A run with what it needs.

    Attributes:
        run: its configuration.
        graph: of it alone.
        targets: ids of the nodes that it asks for, that of the scores first.
    """

    run: SweepRun
    graph: Graph
    targets: tuple[str, ...]

    @property
    def scores(self) -> str:
        """Key of its scores."""
        return self.targets[0]

    @property
    def pictures(self) -> tuple[str, ...]:
        """Keys of its pictures, none unless it asks for them."""
        return tuple(key for key in self.targets if draws(self.graph.nodes[key].stage))

    @property
    def beside(self) -> tuple[str, ...]:
        """Keys of what it asks for that is in the store alone: neither scores nor pictures."""
        others = {self.scores, *self.pictures}
        return tuple(key for key in self.targets if key not in others)


@dataclass(frozen=True)
class StagePlan:
    """What a stage has to do for a sweep.

    Attributes:
        name: of the stage.
        nodes: how many the runs need, each counted once.
        cached, to_run: how many are there, and how many are not.
        seconds: that those to run will take on one worker, by what was recorded; None if nothing
            was.
    """

    name: str
    nodes: int
    cached: int
    to_run: int
    seconds: float | None


@dataclass(frozen=True)
class SweepPlan:
    """What a sweep would do.

    Attributes:
        runs: all of them.
        graph: of all of them.
        needed: ids of the nodes that they need.
        missing: ids of the nodes to run, each after those that it takes something from.
        stages: by stage, in the order of the data.
    """

    runs: tuple[PlannedRun, ...]
    graph: Graph
    needed: frozenset[str]
    missing: tuple[str, ...]
    stages: tuple[StagePlan, ...]

    def complete_runs(self) -> int:
        """How many runs need no node to run."""
        missing = set(self.missing)
        return sum(missing.isdisjoint(planned.targets) for planned in self.runs)

    def seconds(self, workers: int) -> float | None:
        """How long it will take, were the work to be had evenly by all workers."""
        known = [stage.seconds for stage in self.stages if stage.to_run]
        if any(seconds is None for seconds in known):
            return None
        return sum(known) / workers


def plan_runs(
    runs: Sequence[SweepRun], pictures: bool = False, steps: Sequence[str] = ()
) -> list[PlannedRun]:
    """The graphs of the runs; what they have in common is worked out once.

    Beside the scores each run asks for its pictures, where wanted, and for those of `steps` that
    its pipeline has.

    Raises:
        UserError: if the pipeline's file is wrong, or a file of the user's cannot be read.
    """
    builder = GraphBuilder()
    planned = []
    for run in runs:
        configuration = run.composition.configuration
        try:
            graph = builder.build(
                pipeline_stages(configuration), scan_count(configuration), CHUNK_SIZE
            )
        except OSError as error:
            raise ConfigurationError(
                f"{error.filename}: cannot be read: {error.strerror} (run {run.index}: {run.label})"
            ) from None
        names = [SCORES]
        if pictures:
            names += picture_stages(graph)
        names += [name for name in steps if name in graph.stages and name not in names]
        planned.append(PlannedRun(run, graph, tuple(graph.expand(names))))
    return planned


def plan_sweep(planned: Sequence[PlannedRun], store: Store) -> SweepPlan:
    """What `store` lacks for the runs. Entries are looked for, not read.

    Raises:
        CacheError: if the store cannot be read.
    """
    graph = merge(run.graph for run in planned)
    targets = list(dict.fromkeys(target for run in planned for target in run.targets))
    found = plan(graph, targets, store, verify=False)
    lacking = set(found.missing)
    durations = Durations(store.folder)
    stages = []
    for name in graph.stage_names:
        keys = [key for key in graph.stages[name] if key in found.needed]
        to_run = [graph.nodes[key] for key in keys if key in lacking]
        if keys:
            stages.append(
                StagePlan(
                    name=name,
                    nodes=len(keys),
                    cached=len(keys) - len(to_run),
                    to_run=len(to_run),
                    seconds=durations.estimate(to_run),
                )
            )
    return SweepPlan(tuple(planned), graph, found.needed, found.missing, tuple(stages))
