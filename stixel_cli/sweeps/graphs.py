"""The plan of a sweep: its runs as one graph, in which they share the nodes they have in common."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from stixel_cli.config.compose import Composer, Composition
from stixel_cli.config.folders import of_the_machine
from stixel_cli.engine.graph import Graph, GraphBuilder, merge
from stixel_cli.engine.parameters import Executor
from stixel_cli.engine.plan import Durations, plan
from stixel_cli.engine.store import Store, open_store
from stixel_cli.errors import ConfigurationError, counted
from stixel_cli.experiment.run import CAMERA, OBJECTS, TRACKS
from stixel_cli.experiment.stages import RESULTS, experiment_graph
from stixel_cli.experiment.table import PICTURES
from stixel_cli.results.result import RunResult
from stixel_cli.sweeps.design import SEED, Design, design_runs, equal_runs, planned_as


@dataclass(frozen=True)
class SweepPlan:
    """The work of a sweep."""

    runs: tuple[RunResult, ...]
    """All runs."""
    pictures: bool
    """Whether each run requires its pictures."""
    nodes: tuple[str, ...]
    """Of the pipelines, whose results are required, too."""
    graph: Graph
    """Of all runs."""
    needed: frozenset[str]
    """Ids of the nodes that the runs need."""
    missing: tuple[str, ...]
    """Ids of the nodes to compute, each after its inputs."""
    store: Store
    """Where results are."""
    durations: Durations
    """Of the stages, as measured so far."""
    design: Design = field(default_factory=lambda: Design((), ()))
    """Of the runs, by `plan_sweep`."""
    notes: tuple[str, ...] = ()
    """On runs that give equal results."""

    @property
    def executor(self) -> Executor:
        """Where its nodes run."""
        return self.runs[0].composition.configuration.executor

    @property
    def stages(self) -> list[dict[str, Any]]:
        """The work by stage, in the order of the data: `name`, and numbers of nodes, each once.

        These are `nodes` that are needed, `cached` in the store, and missing (`to_run`). `seconds`
        is the estimated time of the missing ones on one worker, without those whose function was
        never measured; None if none was.
        """
        missing, stages = set(self.missing), []
        for name, all_keys in self.graph.stages.items():
            keys = [key for key in all_keys if key in self.needed]
            to_run = [self.graph.nodes[key] for key in keys if key in missing]
            if keys:
                seconds, unknown = self.durations.estimate(to_run)
                counts = {"cached": len(keys) - len(to_run), "to_run": len(to_run)}
                known = round(seconds, 2) if seconds or not unknown else None
                stages.append({"name": name, "nodes": len(keys), **counts, "seconds": known})
        return stages

    @property
    def targets(self) -> list[str]:
        """Keys of the nodes whose results the runs require, each once."""
        return list(dict.fromkeys(target for run in self.runs for target in run.targets))


def plan_runs(
    runs: Sequence[RunResult],
    pictures: bool = False,
    nodes: Sequence[str] = (),
    builders: Callable[[Path], GraphBuilder] = GraphBuilder,
) -> SweepPlan:
    """The nodes that the store of the runs' settings lacks; entries are not read.

    Each run requires its scores; with `pictures` also its pictures; and the results of those
    `nodes` that its pipeline has. `builders` makes the builder of a store's folder. UserError if a
    pipeline or an input file is wrong. CacheError if the store is damaged.
    """
    store = open_store(runs[0].composition.configuration.cache)
    wanted = dict.fromkeys(["scores", *(PICTURES if pictures else ()), *nodes])
    builder, planned = builders(store.folder), []
    for run in runs:
        own = experiment_graph(run.composition, builder)
        keys = own.expand([name for name in wanted if name in own.stages])
        planned.append(replace(run, graph=own, targets=tuple(keys)))
    graph = merge(run.graph for run in planned)
    targets = [target for run in planned for target in run.targets]
    found = plan(graph, targets, store, verify=False)
    durations = Durations(store.folder)
    return SweepPlan(
        tuple(planned), pictures, tuple(nodes), graph, found.needed, found.missing, store, durations
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
            chosen = f"measurement={choices.get('measurement')} and path={choices.get('path')}"
            why = f" with {chosen}: all runs would be equal"
            if key.startswith("pictures"):
                why = ": a sweep draws pictures only with --pictures"
            raise ConfigurationError(f"{key}: no stage reads it{why}")
    equal = [*equal_runs(planned, lambda run: run.targets)]
    if not equal:
        return []
    one, other = equal[0]
    more = f" (and {counted(len(equal) - 1, 'more pair')})" if len(equal) > 1 else ""
    labels = f"{one.label} and {other.label}"
    return [f"runs {one.index} and {other.index} give equal results: {labels}{more}"]


def plan_sweep(
    design: Design,
    pictures: bool = False,
    nodes: Sequence[str] = (),
    composer: Composer | None = None,
    builders: Callable[[Path], GraphBuilder] = GraphBuilder,
) -> SweepPlan:
    """The plan of a design, as `plan_runs`, with a note on runs with equal results.

    Sweeps that share `composer` and `builders` read files and code once.

    ConfigurationError for an invalid run, or if no stage reads an axis.
    """
    runs = design_runs(design, composer or Composer())
    found = plan_runs(runs, pictures, nodes, builders)
    return replace(found, design=design, notes=tuple(check_axes(found.runs)))


def planned_run(composition: Composition, pictures: bool = True) -> SweepPlan:
    """The plan of one run with all that its folder has, as `plan_runs`."""
    nodes = (*RESULTS, OBJECTS, TRACKS, *((CAMERA,) if pictures else ()))
    return plan_runs([planned_as(0, {}, composition)], pictures, nodes)
