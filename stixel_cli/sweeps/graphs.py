"""The points of a sweep as one graph: what they share is there once."""

from collections.abc import Sequence
from dataclasses import dataclass

from stixel_cli.engine.durations import Durations
from stixel_cli.engine.graph import Graph, GraphBuilder, merge
from stixel_cli.engine.plan import plan
from stixel_cli.engine.store import Store
from stixel_cli.errors import ConfigurationError
from stixel_cli.experiment.stages import (
    CHUNK_SIZE,
    draws,
    picture_stages,
    pipeline_stages,
    scan_count,
)
from stixel_cli.sweeps.points import Point

SCORES = "scores"


@dataclass(frozen=True)
class PlannedPoint:
    """A point with what it needs.

    Attributes:
        point: its configuration.
        graph: of it alone.
        targets: ids of the nodes that it asks for, that of the scores first.
    """

    point: Point
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
        nodes: how many the points need, each counted once.
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
        points: all of them.
        graph: of all of them.
        needed: ids of the nodes that they need.
        missing: ids of the nodes to run, each after those that it takes something from.
        stages: by stage, in the order of the data.
    """

    points: tuple[PlannedPoint, ...]
    graph: Graph
    needed: frozenset[str]
    missing: tuple[str, ...]
    stages: tuple[StagePlan, ...]

    def complete_points(self) -> int:
        """How many points need no node to run."""
        missing = set(self.missing)
        return sum(missing.isdisjoint(planned.targets) for planned in self.points)

    def seconds(self, workers: int) -> float | None:
        """How long it will take, were the work to be had evenly by all workers."""
        known = [stage.seconds for stage in self.stages if stage.to_run]
        if any(seconds is None for seconds in known):
            return None
        return sum(known) / workers


def plan_points(
    points: Sequence[Point], pictures: bool = False, steps: Sequence[str] = ()
) -> list[PlannedPoint]:
    """The graphs of the points; what they have in common is worked out once.

    Beside the scores each point asks for its pictures, where wanted, and for those of `steps` that
    its pipeline has.

    Raises:
        UserError: if the pipeline's file is wrong, or a file of the user's cannot be read.
    """
    builder = GraphBuilder()
    planned = []
    for point in points:
        configuration = point.composition.configuration
        try:
            graph = builder.build(
                pipeline_stages(configuration), scan_count(configuration), CHUNK_SIZE
            )
        except OSError as error:
            raise ConfigurationError(
                f"{error.filename}: cannot be read: {error.strerror} "
                f"(point {point.index}: {point.label})"
            ) from None
        names = [SCORES]
        if pictures:
            names += picture_stages(graph)
        names += [name for name in steps if name in graph.stages and name not in names]
        planned.append(PlannedPoint(point, graph, tuple(graph.expand(names))))
    return planned


def plan_sweep(planned: Sequence[PlannedPoint], store: Store) -> SweepPlan:
    """What `store` lacks for the points. Entries are looked for, not read.

    Raises:
        CacheError: if the store cannot be read.
    """
    graph = merge(point.graph for point in planned)
    targets = list(dict.fromkeys(target for point in planned for target in point.targets))
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
