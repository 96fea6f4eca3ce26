"""The stages of one experiment: the entries of the table, wired by the pipeline's file."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.border.files import read_yaml, remembered
from stixel_cli.config.compose import Composition
from stixel_cli.config.folders import real_image_parameters, shipped_folder
from stixel_cli.config.schema import Configuration
from stixel_cli.engine.cache_folder import Lease
from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.execute import Execution, execute
from stixel_cli.engine.graph import Graph, GraphBuilder
from stixel_cli.engine.keys import Stage
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import Store, open_store
from stixel_cli.errors import UserError
from stixel_cli.evaluation.scores import Scores
from stixel_cli.experiment.table import OWN, REPLAYED, TABLE
from stixel_cli.measurements.parameters import Disturbance, undisturbed
from stixel_cli.scene.mesh_file import referred_files

if TYPE_CHECKING:
    from stixel_cli.recordings.types import Recording
    from stixel_cli.stereo.rectification import Rows

RESULTS = ("scenario", "scans", "track", "scores")
"""Stages whose results are those of the experiment; every pipeline but one has a single track."""

CHUNK_SIZE = 10
"""Frames per chunk: few enough to keep two workers busy, enough to share a background."""


def pipeline_stages(composition: Composition) -> list[Stage]:
    """The stages of one experiment, wired by the pipeline of its kind of measurement.

    UserError if the pipeline names an unknown stage, or a file is missing or not valid.
    """
    configuration, recording = composition.configuration, composition.recording
    rendered = configuration.source.kind == "rendered"
    kind = configuration.measurement.kind if rendered else "recording"
    if recording is not None and recording.auto:
        kind = "moving_objects"
        if configuration.metrics:
            raise UserError("metrics: score one track; with source.target=auto there are several")
    path = shipped_folder("pipelines") / f"{kind}.yaml"
    pipeline = _read(path)
    if undisturbed(configuration.measurement) != configuration.measurement:
        # `disturb_scans` comes between the sensor's scans and all that use them.
        pipeline = {("clean_scans" if n == "scans" else n): own for n, own in pipeline.items()}
        pipeline["scans"] = {"stage": "disturb_scans", "scans": "clean_scans"}
    setting, count = partial(_setting, configuration, recording), composition.scan_count
    return [_stage(setting, count, path, name, wiring or {}) for name, wiring in pipeline.items()]


_read = remembered(read_yaml)


def _stage(
    setting: Callable[[str], Any], count: int, path: Path, name: str, wiring: dict[str, Any]
) -> Stage:
    """The stage of a node `name` of the pipeline's file at `path`, for `count` scans.

    `setting` gives the values of settings by their dotted paths, see `_setting`.
    """
    inputs = dict(wiring)
    if inputs and all(isinstance(value, dict) for value in inputs.values()):
        inputs = dict(inputs[setting(f"{name}.kind")])
    stage = inputs.pop("stage", name)
    if stage not in TABLE:
        raise UserError(f"{path}: {name}: no stage {stage!r}; the tables have {', '.join(TABLE)}")
    definition = TABLE[stage]
    if stage in REPLAYED and setting("path.kind") == "recorded":
        definition = REPLAYED[stage]
    if stage in OWN and setting("tracker.kind") == "own":
        definition = OWN[stage]
    names = [setting(path) for path in definition.code]
    functions = [f for name in names for f in ((name,) if isinstance(name, str) else name)]
    kind = setting(f"{definition.chosen_by}.kind") if definition.chosen_by else ""
    called = _stage(setting, count, path, definition.calls, {}) if definition.calls else None
    named = [path.rpartition(".") for path in definition.files]
    given = [getattr(setting(group), key, None) for group, _, key in named]
    files = [Path(name) for name in given if name is not None]
    # Of a stage of images, the megapixels of one.
    rig, of_images = setting("rig"), "rig" in definition.reads.values()
    of_frame = 1e-6 * rig.width * rig.height if of_images else 1.0
    made = Stage(
        name=name,
        amount=count if definition.pattern == "once" else of_frame,
        function=definition.functions[kind],
        pattern=definition.pattern,
        inputs=inputs,
        # Of a recording, the calibrated rig is an input.
        settings={n: setting(p) for n, p in definition.reads.items() if n not in inputs},
        modules=tuple(f.partition(":")[0] for f in functions),
        folders=tuple(map(Path, setting("code_folders"))) if functions else (),
        own=bool(functions),
        seed=setting("seed") if definition.seeded else None,
        frames=setting("pictures").frames_of(count) if definition.pattern == "pick" else (),
        files=(
            *(setting(f"recording.{definition.recorded}") if definition.recorded else ()),
            *(path for file in files for path in (file, *referred_files(file))),
        ),
        gives_files=bool(definition.recorded),
        keys=definition.reads,
    )
    if called is None:
        return made
    return replace(
        made,
        settings=made.settings | {"function": called.function, "settings": dict(called.settings)},
        modules=(*made.modules, called.function.partition(":")[0], *called.modules),
        folders=called.folders,
        files=(*made.files, *called.files),
        own=called.own,
    )


def _setting(configuration: Configuration, recording: "Recording | None", path: str) -> Any:
    """A value of the configuration, or one that the files of the recording give."""
    if path == "true_class" and configuration.source.kind != "rendered":
        path = "recording.road_user"
    if path.startswith("recording."):
        return attrgetter(path.removeprefix("recording."))(recording)
    value = attrgetter(path)(configuration)
    return undisturbed(value) if isinstance(value, Disturbance) else value


def experiment_graph(composition: Composition, builder: GraphBuilder | None = None) -> Graph:
    """The graph of an experiment's nodes; several experiments may share a `builder`."""
    stages = pipeline_stages(composition)
    builder = builder or GraphBuilder(open_store(composition.configuration.cache).folder)
    return builder.build(stages, composition.scan_count, CHUNK_SIZE)


def compared_rows(composition: Composition, note: Callable[[str], Any]) -> "Rows | None":
    """As `calibration.road_pose.compared_rows`; None without recorded images.

    `note` is called with what is wrong with the images, or with the rig that is set for them.
    """
    source, rig = composition.configuration.source, composition.configuration.rig
    if source.kind == "rendered":
        return None
    from stixel_cli.calibration.road_pose import compared_rows, contradiction

    rows = compared_rows(composition.recording, rig.far_disparity, source.check_rectification)
    stereo, road = real_image_parameters().stereo, composition.configuration.road
    told = contradiction(composition.recording, rig, road, stereo)
    for text in filter(None, (rows and rows.fault, told)):
        note(text)
    return rows


@contextmanager
def computed_stages(
    composition: Composition,
    wanted: Sequence[str],
    progress: Progress | None = None,
    on_scores: Callable[[Scores], None] | None = None,
    store: Store | None = None,
) -> Iterator[tuple[Execution, Callable[[str], list[Any]]]]:
    """Compute the missing results of stages, and give a function that loads those of a stage.

    That function gives one result for each chunk of frames that `wanted` needs: none if the
    pipeline has no such stage. Inside the context no other process, and no size limit, removes
    results.

    Args:
        wanted: names of stages, without effect where the pipeline has no such stage.
        on_scores: called with the scores as soon as `RESULTS`, the first, are computed.
        store: the cache; None for that of the configuration.

    UserError for any error that the user can fix. StageFailure if a stage fails for another reason;
    finished nodes stay in the store.
    """
    configuration = composition.configuration
    try:
        graph = experiment_graph(composition)
        store = open_store(configuration.cache) if store is None else store
        while composition.files.notes and progress is not None:
            progress.note(composition.files.notes.pop(0))
        wanted = [name for name in wanted if name in graph.stages]
        needed = graph.ancestors(wanted)

        def load(name: str) -> list[Any]:
            return [store.load(key) for key in graph.stages.get(name, ()) if key in needed]

        with Lease(store.folder, sorted(needed)):
            first = [name for name in RESULTS if name in wanted]
            report = on_scores and (lambda: on_scores(load("scores")[0]))
            execution = execute(
                graph, wanted, store, configuration.executor, progress, first=first, on_first=report
            )
            yield execution, load
    except StageFailure as failure:
        if failure.is_about_input:
            raise UserError(f"{failure.label}: {failure.cause}") from failure
        raise
