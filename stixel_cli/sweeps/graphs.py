"""The plan of a sweep: its runs as one graph, in which they share the nodes they have in common."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

from stixel_cli.config.compose import Composition
from stixel_cli.config.folders import of_the_machine
from stixel_cli.engine.graph import Graph, GraphBuilder, merge
from stixel_cli.engine.parameters import Executor
from stixel_cli.engine.plan import Durations, plan, probe
from stixel_cli.engine.store import Store, open_store
from stixel_cli.errors import ConfigurationError, counted
from stixel_cli.experiment.run import CAMERA, OBJECTS, TRACKS
from stixel_cli.experiment.stages import RESULTS, experiment_graph
from stixel_cli.experiment.table import PICTURES
from stixel_cli.results.result import RunResult
from stixel_cli.sweeps.design import SEED
from stixel_cli.sweeps.runs import equal_runs, planned_as


@dataclass(frozen=True)
class StagePlan:
    """The nodes of one stage in a sweep, each counted once: needed, in the store, and missing.

    `seconds` is the estimated time of the missing ones on one worker, without those whose function
    was never measured; None if none was.
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
        store: where results are.
        durations: of the stages, as measured so far.
        notes: on runs that give equal results.
    """

    runs: tuple[RunResult, ...]
    graph: Graph
    needed: frozenset[str]
    missing: tuple[str, ...]
    stages: tuple[StagePlan, ...]
    store: Store
    durations: Durations
    notes: tuple[str, ...] = ()

    @property
    def executor(self) -> Executor:
        """Where its nodes run."""
        return self.runs[0].composition.configuration.executor

    @property
    def targets(self) -> list[str]:
        """Keys of the nodes whose results the runs require, each once."""
        return list(dict.fromkeys(target for run in self.runs for target in run.targets))

    def complete_runs(self) -> int:
        """Number of runs whose results are all in the store."""
        missing = set(self.missing)
        return sum(missing.isdisjoint(run.targets) for run in self.runs)


def plan_sweep(
    runs: Sequence[RunResult],
    pictures: bool = False,
    nodes: Sequence[str] = (),
    store: Store | None = None,
) -> SweepPlan:
    """The nodes that the store lacks; entries are not read.

    Each run requires its scores; with `pictures` also its pictures; and the results of those
    `nodes` that its pipeline has. The store is by default that of the runs' settings.

    Raises:
        UserError: if a pipeline or an input file is wrong.
        CacheError: if the store is damaged.
    """
    store = open_store(runs[0].composition.configuration.cache) if store is None else store
    wanted = dict.fromkeys(["scores", *(PICTURES if pictures else ()), *nodes])
    builder, planned = GraphBuilder(store.folder), []
    for run in runs:
        own = experiment_graph(run.composition, builder)
        keys = own.expand([name for name in wanted if name in own.stages])
        planned.append(replace(run, graph=own, targets=tuple(keys)))
    graph = merge(run.graph for run in planned)
    targets = list(dict.fromkeys(target for run in planned for target in run.targets))
    found = plan(graph, targets, store, verify=False)
    missing, durations, stages = set(found.missing), Durations(store.folder), []
    for name, all_keys in graph.stages.items():
        keys = [key for key in all_keys if key in found.needed]
        to_run = [graph.nodes[key] for key in keys if key in missing]
        if keys:
            seconds, unknown = durations.estimate(to_run)
            known = seconds if seconds or not unknown else None
            stages.append(StagePlan(name, len(keys), len(keys) - len(to_run), len(to_run), known))
    return SweepPlan(
        tuple(planned),
        graph,
        found.needed,
        found.missing,
        tuple(stages),
        store,
        durations,
    )


def estimated(plans: Sequence[SweepPlan]) -> tuple[float | None, list[str]]:
    """Seconds of plans that share results, and the names of stages that were never measured.

    The work divides evenly among the workers. The time is that of the other stages; None if all
    are unmeasured.
    """
    nodes = {key: plan.graph.nodes[key] for plan in plans for key in plan.missing}
    seconds, unmeasured = plans[0].durations.estimate(nodes.values())
    known = seconds / plans[0].executor.workers if seconds or not unmeasured else None
    return known, unmeasured


def check_axes(planned: Sequence[RunResult]) -> list[str]:
    """Refuse an axis that no stage reads; return a note on runs that give equal results.

    Runs whose results have the same keys give the same results, whatever their settings are.
    """
    settings = [run.setting | {SEED: run.seed} for run in planned]
    keys = [*settings[0]]
    for key in filter(of_the_machine, keys):
        raise ConfigurationError(f"{key}: it does not affect results, so it cannot be swept")
    for key in keys:
        groups: dict[tuple, list[tuple[str, ...]]] = defaultdict(list)
        for one, own in zip(planned, settings, strict=True):
            others = tuple(value for name, value in own.items() if name != key)
            groups[others].append(one.targets)
        several = [targets for targets in groups.values() if len(targets) > 1]
        # Without several, the key is zipped with another one, which is checked in its place.
        if several and all(len({*targets}) == 1 for targets in several):
            choices = planned[0].composition.choices
            why = (
                ": a sweep draws pictures only with --pictures"
                if key.startswith("pictures")
                else f" with measurement={choices.get('measurement')} and "
                f"path={choices.get('path')}: all runs would be equal"
            )
            raise ConfigurationError(f"{key}: no stage reads it{why}")
    equal = [*equal_runs(planned, lambda run: run.targets)]
    if not equal:
        return []
    one, other = equal[0]
    more = f" (and {counted(len(equal) - 1, 'more pair')})" if len(equal) > 1 else ""
    labels = f"{one.label} and {other.label}"
    return [f"runs {one.index} and {other.index} give equal results: {labels}{more}"]


def planned_sweep(
    runs: Sequence[RunResult], pictures: bool, nodes: Sequence[str] = ()
) -> SweepPlan:
    """The plan of runs, as `plan_sweep`, with a note on equal ones.

    ConfigurationError if no stage reads an axis.
    """
    found = plan_sweep(runs, pictures, nodes)
    return replace(found, notes=tuple(check_axes(found.runs)))


def planned_run(composition: Composition, pictures: bool = True) -> SweepPlan:
    """The plan of one run with all that its folder has, as `plan_sweep`."""
    nodes = (*RESULTS, OBJECTS, TRACKS, *((CAMERA,) if pictures else ()))
    return plan_sweep([planned_as(0, {}, composition)], pictures, nodes)


def check_computable(plan: SweepPlan) -> None:
    """Raise UserError for an unusable cache or scheduler, before a folder is created."""
    probe(len(plan.missing), plan.store, plan.executor)
