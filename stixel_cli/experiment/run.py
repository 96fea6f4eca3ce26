"""One experiment from its configuration to its results, without a command line."""

from dataclasses import dataclass
from typing import Any

from stixel_cli.config.schema import Configuration
from stixel_cli.engine.execute import execute
from stixel_cli.engine.graph import Graph, build_graph
from stixel_cli.engine.plan import Plan, plan
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import Store
from stixel_cli.evaluation.scores import Scores
from stixel_cli.experiment.stages import CHUNK_SIZE, pipeline_stages, scan_count
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track

RESULTS = ("scenario", "scans", "track", "scores")
"""Steps that every pipeline has, and whose results are an experiment's."""


@dataclass(frozen=True)
class Outcome:
    """What an experiment gives.

    Attributes:
        scenario, scans, track, scores: the results of the steps of these names.
        pictures: path below the figures' folder to the file's bytes.
        stages: a record a step: name, key, status ("computed" or "cached"), seconds, nodes,
            nodes_computed.
    """

    scenario: Scenario
    scans: Scans
    track: Track
    scores: Scores
    pictures: dict[str, bytes]
    stages: list[dict[str, Any]]


def plan_experiment(configuration: Configuration, store: Store) -> Plan:
    """What an experiment would compute, given what `store` holds.

    Raises:
        UserError: if the pipeline's file is wrong.
        CacheError: if the store cannot be read.
    """
    graph = experiment_graph(configuration)
    return plan(graph, _targets(graph), store)


def experiment_graph(configuration: Configuration) -> Graph:
    """The graph of nodes that an experiment asks for."""
    return build_graph(pipeline_stages(configuration), scan_count(configuration), CHUNK_SIZE)


def run_experiment(
    configuration: Configuration,
    store: Store,
    workers: int = 2,
    progress: Progress | None = None,
) -> Outcome:
    """Compute what `store` does not hold yet of an experiment, and load its results.

    Raises:
        StageFailure: if a stage fails; what was finished stays in the store.
        CacheError: if the store cannot be read or written.
    """
    graph = experiment_graph(configuration)
    execution = execute(graph, _targets(graph), store, workers=workers, progress=progress)
    results = {name: store.load(graph.of_stage(name)[0].key) for name in RESULTS}
    pictures = {
        path: data
        for name in _picture_steps(graph)
        for node in graph.of_stage(name)
        for path, data in store.load(node.key).files.items()
    }
    return Outcome(**results, pictures=pictures, stages=execution.stage_records())


def _targets(graph: Graph) -> list[str]:
    return [*RESULTS, *_picture_steps(graph)]


def _picture_steps(graph: Graph) -> list[str]:
    return [name for name in graph.stage_names if name.endswith("_pictures")]
