"""One experiment from its configuration to its results, without a command line."""

from dataclasses import dataclass
from typing import Any

from stixel_cli.config.schema import Configuration
from stixel_cli.engine.execute import execute
from stixel_cli.engine.graph import Graph, build_graph
from stixel_cli.engine.locks import lease
from stixel_cli.engine.plan import Plan, plan
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import Store
from stixel_cli.evaluation.scores import Scores
from stixel_cli.experiment.stages import CHUNK_SIZE, pipeline_stages, scan_count
from stixel_cli.measurements.scans import Scans
from stixel_cli.report.types import CameraFrames
from stixel_cli.results.lineage import Lineage, lineage_of
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track

RESULTS = ("scenario", "scans", "track", "scores")
"""Steps that every pipeline has, and whose results are an experiment's."""

CAMERA = "camera_frames"
"""The step that pipelines with a camera have for the page on which a run is played back."""


@dataclass(frozen=True)
class Outcome:
    """What an experiment gives.

    Attributes:
        scenario, scans, track, scores: the results of the steps of these names.
        pictures: path below the figures' folder to the file's bytes.
        camera: chunks of the camera's frames, in order; none where there is no camera.
        stages: a record a step: name, key, status ("computed" or "cached"), seconds, nodes,
            nodes_computed.
        lineage: what the steps were made of.
    """

    scenario: Scenario
    scans: Scans
    track: Track
    scores: Scores
    pictures: dict[str, bytes]
    camera: tuple[CameraFrames, ...]
    stages: list[dict[str, Any]]
    lineage: Lineage


def plan_experiment(configuration: Configuration, store: Store) -> Plan:
    """What an experiment would compute, given what `store` holds.

    Raises:
        UserError: if the pipeline's file is wrong.
        CacheError: if the store cannot be read.
    """
    graph = experiment_graph(configuration)
    return plan(graph, targets(graph), store)


def experiment_graph(configuration: Configuration) -> Graph:
    """The graph of nodes that an experiment asks for."""
    return build_graph(pipeline_stages(configuration), scan_count(configuration), CHUNK_SIZE)


def run_experiment(
    configuration: Configuration,
    store: Store,
    progress: Progress | None = None,
    pictures: bool = True,
    camera: bool | None = None,
) -> Outcome:
    """Compute what `store` does not hold yet of an experiment, and load its results.

    It runs on the executor that the configuration names; `pictures` tells whether to draw any,
    `camera` whether to have the camera's frames for the page (None: if there are pictures).

    Raises:
        StageFailure: if a stage fails; what was finished stays in the store.
        CacheError: if the store cannot be read or written.
    """
    graph = experiment_graph(configuration)
    with_camera = (pictures if camera is None else camera) and CAMERA in graph.stages
    wanted = targets(graph, pictures, with_camera)
    # Held until all is loaded: another process, or the size limit, may tidy up in between.
    with lease(store.folder, sorted(graph.ancestors(graph.expand(wanted)))):
        execution = execute(
            graph, wanted, store, executor=configuration.executor, progress=progress
        )
        results = {name: store.load(graph.of_stage(name)[0].key) for name in RESULTS}
        files = {
            path: data
            for name in (_picture_steps(graph) if pictures else ())
            for node in graph.of_stage(name)
            for path, data in store.load(node.key).files.items()
        }
        frames = tuple(
            store.load(node.key) for node in (graph.of_stage(CAMERA) if with_camera else ())
        )
        lineage = lineage_of(graph, execution.records, store)
    return Outcome(
        **results,
        pictures=files,
        camera=frames,
        stages=execution.stage_records(),
        lineage=lineage,
    )


def targets(graph: Graph, pictures: bool = True, camera: bool | None = None) -> list[str]:
    """Names of the stages whose results are an experiment's: `RESULTS`, pictures and the camera's.

    `camera` is None for those of an experiment with pictures, or without.
    """
    wanted = [*RESULTS, *(_picture_steps(graph) if pictures else ())]
    if (pictures if camera is None else camera) and CAMERA in graph.stages:
        wanted.append(CAMERA)
    return wanted


def _picture_steps(graph: Graph) -> list[str]:
    return [name for name in graph.stage_names if name.endswith("_pictures")]
