"""The table of stages: it joins the functions of the science with the engine.

A definition names the function, the settings that each of its arguments takes, and how the stage
runs over the frames. Each node of `pipelines/*.yaml` names its stage and its inputs.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, get_args

import yaml

from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.keys import kind_of
from stixel_cli.config.schema import Configuration, Renderer, StereoParameters, Tracker
from stixel_cli.engine.graph import Graph
from stixel_cli.engine.keys import Stage
from stixel_cli.errors import UserError
from stixel_cli.experiment.user_scans import check_files, file_scans
from stixel_cli.measurements.disturbance_parameters import (
    Disturbance,
    is_disturbed,
    undisturbed,
)
from stixel_cli.measurements.file_parameters import FileParameters
from stixel_cli.own_code import OwnCode
from stixel_cli.recordings.find import find_recording
from stixel_cli.recordings.replay import find_replay
from stixel_cli.recordings.types import Recording
from stixel_cli.scene.ego import Parked
from stixel_cli.scene.mesh_file import referred_files
from stixel_cli.scene.path_parameters import ReplayedPath

CHUNK_SIZE = 10
"""Frames per chunk: few enough to keep two workers busy, enough to share a background."""


@dataclass(frozen=True)
class Definition:
    """One stage of the table.

    Attributes:
        functions: "module:function" to call, by the `kind` of the settings that `chosen_by` names;
            a stage with one implementation has the single key "".
        pattern: how it runs over the frames, see `stixel_cli.engine.keys.Stage`.
        reads: argument name to the dotted path of its settings in the configuration.
        modules: code that no import statement leads to, see `Stage.modules`.
        chosen_by: dotted path of the settings whose `kind` selects the function; "" if there is no
            choice.
        seeded: whether it draws random numbers, and so needs the experiment's seed.
        files: dotted paths of the settings that are files. Their content, and that of the files
            they refer to, is part of the key.
        recorded: the files of the recording that the function gets as `files`, an attribute of
            `Recording`, before those of `files`; "" for none.
        pictures: whether it draws: its result is a `Pictures`.
        code: dotted paths of the settings that name the user's own functions: their code is part of
            the key.
        calls: another stage whose function this one calls: it gets the function's name as
            `function` and its settings as `settings`; "" for none.
    """

    functions: Mapping[str, str]
    pattern: Literal["once", "map", "fold", "pick"]
    reads: Mapping[str, str] = field(default_factory=dict)
    modules: tuple[str, ...] = ()
    chosen_by: str = ""
    seeded: bool = False
    files: tuple[str, ...] = ()
    recorded: str = ""
    pictures: bool = False
    code: tuple[str, ...] = ()
    calls: str = ""


def _only(function: str) -> dict[str, str]:
    return {"": f"stixel_cli.{function}"}


def _by_kind(options: Any, name: str) -> dict[str, str]:
    """The function `name` of each option of a union, by kind.

    It is in the module of the option's parameters, or in `NAME.py` for `NAME_parameters.py`.
    """
    return {
        kind_of(option): f"{option.__module__.removesuffix('_parameters')}:{name}"
        for option in get_args(options)
    }


def _same(*names: str) -> dict[str, str]:
    return {name: name for name in names}


TABLE: dict[str, Definition] = {
    "ego_motion": Definition(
        _only("scene.ego:ego_motion"),
        "once",
        {"ego": "ego", "duration": "path.duration", "sample_time": "path.sample_time"},
    ),
    "scenario": Definition(
        _only("scene.build:build_scenario"),
        "once",
        _same("road_user", "path"),
        files=("road_user.mesh",),
    ),
    "render": Definition(
        _by_kind(Renderer, "render"),
        "map",
        _same("road_user", "world", "rig", "renderer"),
        chosen_by="renderer",
        files=("road_user.mesh",),
    ),
    "add_sensor_noise": Definition(
        _only("rendering.sensor_noise:add_sensor_noise"),
        "map",
        _same("sensor"),
        seeded=True,
    ),
    "recorded_motion": Definition(
        _only("recordings.motion:recorded_motion"),
        "once",
        {
            "rig": "rig",
            "first": "recording.first",
            "count": "recording.count",
            "sample_time": "source.sample_time",
            "layout": "recording.table_layout",
        },
        recorded="pose_files",
    ),
    "recorded_scenario": Definition(
        _only("recordings.scenario:recorded_scenario"),
        "once",
        {
            "rig": "rig",
            "first": "recording.first",
            "left_camera": "recording.left_camera",
            "target": "recording.target",
            "layout": "recording.table_layout",
        },
        recorded="truth_files",
    ),
    "read_pairs": Definition(
        _only("recordings.pairs:read_pairs"),
        "map",
        {"rectification": "recording.rectification"},
        recorded="images",
    ),
    "read_left": Definition(
        _only("recordings.colour:read_left"),
        "pick",
        {"rectification": "recording.rectification"},
        recorded="left",
    ),
    "match": Definition(
        _by_kind(StereoParameters, "match"),
        "map",
        _same("rig", "stereo"),
        chosen_by="stereo",
    ),
    "free_space": Definition(
        _only("stixels.free_space:find_free_space"),
        "fold",
        _same("rig", "road", "occupancy", "free_space"),
    ),
    "stixels": Definition(
        _only("stixels.extraction:extract_stixels"),
        "map",
        _same("rig", "height", "extraction"),
    ),
    "objects": Definition(
        _only("measurements.objects:find_objects"), "map", {"gates": "measurement.gates"}
    ),
    "gather_scans": Definition(
        _only("measurements.simulated:gather_scans"), "once", _same("measurement")
    ),
    "fabricate_scans": Definition(
        _only("measurements.fabricated:fabricate_scans"),
        "once",
        _same("rig", "measurement"),
        seeded=True,
    ),
    "cast_lidar": Definition(
        _only("measurements.lidar_casting:cast_lidar"),
        "once",
        {
            "road_user": "road_user",
            "world": "world",
            "scanner": "measurement.scanner",
            "camera_field": "rig.field_of_view",
        },
        files=("road_user.mesh",),
    ),
    "lidar_scans": Definition(
        _only("measurements.lidar:lidar_scans"), "once", _same("measurement"), seeded=True
    ),
    "read_scans": Definition(
        _only("measurements.file:read_scans"),
        "once",
        {
            "path": "measurement.path",
            "ego": "measurement.ego",
            "range_std": "measurement.range_std",
        },
        files=("measurement.path", "measurement.ego"),
    ),
    "read_truth": Definition(
        _only("measurements.file_truth:read_truth"),
        "once",
        {"truth": "measurement.truth"},
        files=("measurement.truth",),
    ),
    "own_scans": Definition(
        _only("measurements.own:own_scans"),
        "once",
        {"function": "measurement.function", "parameters": "measurement.parameters"},
        seeded=True,
        code=("measurement.function",),
    ),
    "disturb_scans": Definition(
        _only("measurements.disturbance:disturb_scans"),
        "once",
        {
            "dropout": "measurement.dropout",
            "clutter_rate": "measurement.clutter_rate",
            "field_of_view": "field_of_view",
            "range_max": "range_max",
        },
        seeded=True,
    ),
    "truth_start": Definition(
        _only("tracking.start:noisy_start"), "once", _same("start"), seeded=True
    ),
    "scans_start": Definition(
        _only("tracking.start_scans:start_from_scans"), "once", _same("start", "prior")
    ),
    "find_tracks": Definition(
        _only("tracking.clusters:find_tracks"), "once", {"prior": "prior", "std": "start.std"}
    ),
    "found_start": Definition(_only("tracking.start_found:start_from_found"), "once"),
    "track": Definition(
        _by_kind(Tracker, "track"),
        "once",
        _same("prior", "tracker"),
        chosen_by="tracker",
    ),
    "track_each": Definition(_only("tracking.several:track_each"), "once", calls="track"),
    "ceilings": Definition(
        _only("evaluation.ceilings:find_ceilings"),
        "once",
        _same("road_user", "measurement"),
        files=("road_user.mesh",),
    ),
    "label_truths": Definition(
        _only("recordings.label_truths:label_truths"),
        "once",
        {
            "rig": "rig",
            "first": "recording.first",
            "left_camera": "recording.left_camera",
            "layout": "recording.table_layout",
        },
        recorded="label_files",
    ),
    "label_scores": Definition(
        _only("evaluation.label_scores:score_tracks"), "once", {"road_user": "road_user.kind"}
    ),
    "scores": Definition(_only("evaluation.evaluate:evaluate"), "once"),
    "stage_errors": Definition(
        _only("validation.stage_errors:stage_errors"),
        "map",
        _same("rig", "road", "occupancy", "free_space"),
    ),
    "point_errors": Definition(_only("validation.point_errors:point_errors"), "once", _same("rig")),
    "label_errors": Definition(
        _only("validation.label_errors:label_errors"),
        "once",
        {
            "rig": "rig",
            "first": "recording.first",
            "left_camera": "recording.left_camera",
            "layout": "recording.table_layout",
        },
        recorded="label_files",
    ),
    "track_points": Definition(
        _only("validation.motion_errors:track_points"),
        "once",
        {"rig": "rig", "first": "recording.first", "layout": "recording.table_layout"},
        recorded="pose_files",
    ),
    "align_truth": Definition(
        _only("validation.truth_alignment:align_truth"),
        "once",
        _same("rig"),
        recorded="true_disparities",
    ),
    "occupancy": Definition(
        _only("stixels.displayed_grid:picture_grid"),
        "pick",
        _same("rig", "road", "occupancy"),
    ),
    "camera_pictures": Definition(
        _only("report.camera:camera_pictures"),
        "pick",
        _same("rig"),
        pictures=True,
    ),
    "camera_frames": Definition(
        _only("report.camera_frames:camera_frames"),
        "map",
    ),
    "track_pictures": Definition(
        _only("report.birds_eye:track_pictures"),
        "pick",
        _same("field_of_view"),
        pictures=True,
    ),
    "run_pictures": Definition(
        _only("report.over_time:run_pictures"),
        "once",
        _same("field_of_view"),
        pictures=True,
    ),
}


OWN: dict[str, Definition] = {
    "track": Definition(
        _only("tracking.own:track"),
        "once",
        {
            "prior": "prior",
            "function": "tracker.function",
            "parameters": "tracker.parameters",
        },
        code=("tracker.function",),
    ),
    "scores": Definition(
        _only("evaluation.own_metrics:evaluate_with_own"),
        "once",
        _same("metrics"),
        code=("metrics",),
    ),
}
"""The stages that replace those of `TABLE` where the user chooses own functions."""


REPLAYED: dict[str, Definition] = {
    "ego_motion": Definition(
        _only("recordings.replayed_motion:replayed_motion"),
        "once",
        {
            "first": "recording.first",
            "count": "recording.count",
            "sample_time": "path.sample_time",
        },
        recorded="pose_files",
    ),
    "scenario": Definition(
        _only("recordings.replayed_scenario:replayed_scenario"),
        "once",
        {
            "road_user": "road_user",
            "first": "recording.first",
            "left_camera": "recording.left_camera",
            "target": "path.target",
            "smoothing": "path.smoothing",
        },
        files=("road_user.mesh",),
        recorded="truth_files",
    ),
}
"""The stages that replace those of `TABLE` with `path=recorded`."""


def readers(name: str) -> list[str]:
    """The stages that read a group or a key, given by its name with dots."""

    def reads(stage: Definition) -> bool:
        paths = [*stage.reads.values(), *stage.files, *stage.code]
        paths += ["seed"] * stage.seeded + ["pictures.frames"] * (stage.pattern == "pick")
        return any(
            f"{path}.".startswith(f"{name}.") or name.startswith(f"{path}.") for path in paths
        )

    found = [
        stage for table in (TABLE, OWN, REPLAYED) for stage, its in table.items() if reads(its)
    ]
    return list(dict.fromkeys(found))


_DRAWING = {f for stage in TABLE.values() if stage.pictures for f in stage.functions.values()}


def draws(stage: Stage) -> bool:
    """Whether the result of a stage is a `Pictures`."""
    return stage.function in _DRAWING


def picture_stages(graph: Graph) -> list[str]:
    """Names of the stages of a graph that draw."""
    return [
        name
        for name in graph.stage_names
        if any(draws(node.stage) for node in graph.of_stage(name))
    ]


def pipeline_stages(configuration: Configuration) -> list[Stage]:
    """The stages of one experiment, wired by the pipeline of its kind of measurement.

    Raises:
        UserError: if the pipeline's file is missing or names an unknown stage, or if a file of the
            recording is missing or not valid.
    """
    check_files(configuration.measurement)
    recording = recording_of(configuration)
    kind = configuration.measurement.kind if recording is None else "recording"
    if isinstance(configuration.path, ReplayedPath):
        recording = find_replay(configuration.path)
    path = shipped_folder("pipelines") / f"{kind}.yaml"
    pipeline = _read(path)
    if recording is not None and recording.auto:
        pipeline = _with_tracks(pipeline)
    if is_disturbed(configuration.measurement):
        pipeline = _with_disturbance(pipeline)
    return [
        _stage(configuration, recording, path, name, wiring or {})
        for name, wiring in pipeline.items()
    ]


def _with_disturbance(
    pipeline: Mapping[str, dict[str, str] | None],
) -> dict[str, dict[str, str] | None]:
    """The pipeline with `disturb_scans` between the sensor's scans and all that use them."""
    clean = {("clean_scans" if name == "scans" else name): own for name, own in pipeline.items()}
    return clean | {"scans": {"stage": "disturb_scans", "scans": "clean_scans"}}


def _with_tracks(
    pipeline: Mapping[str, dict[str, str] | None],
) -> dict[str, dict[str, str] | None]:
    """The pipeline with the tracks of all that moves, and their scores; the run's own starts at one
    of them."""
    found = {
        "found_tracks": {"stage": "find_tracks", "scans": "scans"},
        "start": {"stage": "found_start", "found": "found_tracks"},
        "tracks": {"stage": "track_each", "found": "found_tracks", "scans": "scans"},
    }
    # As they are read after tracking, labels do not change a track.
    scored = {
        "label_truths": {"stage": "label_truths", "ego_motion": "ego_motion"},
        "label_scores": {
            "stage": "label_scores",
            "tracks": "tracks",
            "truths": "label_truths",
        },
        "scores": {**pipeline["scores"], "labels": "label_scores"},
    }
    drawn = {"track_pictures": {**pipeline["track_pictures"], "tracks": "tracks"}}
    return {**pipeline, **found, **scored, **drawn}


def recording_of(configuration: Configuration) -> Recording | None:
    """The files that the configuration's `source` names; None if the images are rendered.

    Raises:
        UserError: if a file is missing or not valid.
    """
    source = configuration.source
    if source.kind == "rendered":
        return None
    recording = find_recording(source)
    if isinstance(configuration.ego, Parked):
        recording = replace(recording, pose_files=())
    return recording


def scan_count(configuration: Configuration) -> int:
    """Number K of scans: of the file, or duration / sample time, rounded, and at least one.

    Raises:
        UserError: if the file of the scans is missing or not valid.
    """
    if isinstance(configuration.measurement, FileParameters):
        return len(file_scans(configuration.measurement))
    return max(1, round(configuration.path.duration / configuration.path.sample_time))


def pictured_frames(configuration: Configuration) -> tuple[int, ...]:
    """The frames to draw: those of the configuration, or four spread evenly over the run."""
    chosen = configuration.pictures.frames
    last = scan_count(configuration) - 1
    if chosen is not None:
        if chosen and max(chosen) > last:
            raise UserError(
                f"pictures.frames: must be <= {last}, the last frame, got {max(chosen)}"
            )
        return tuple(sorted(set(chosen)))
    return tuple(sorted({round(last * share / 4) for share in (0.5, 1.5, 2.5, 3.5)}))


def _read(path: Path) -> dict[str, dict[str, str] | None]:
    try:
        stat = path.stat()
        return _parse(path, stat.st_mtime_ns, stat.st_size)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except yaml.YAMLError as error:
        raise UserError(f"{path}: not a YAML file: {str(error).splitlines()[0]}") from error


@lru_cache(maxsize=16)
def _parse(path: Path, *state: int) -> dict[str, dict[str, str] | None]:
    """Content of the file, parsed once per process while its `state` is the same."""
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def _stage(
    configuration: Configuration,
    recording: Recording | None,
    path: Path,
    name: str,
    wiring: dict[str, str],
) -> Stage:
    inputs = dict(wiring)
    if inputs and all(isinstance(value, dict) for value in inputs.values()):
        inputs = dict(inputs[_value(configuration, f"{name}.kind")])
    stage = inputs.pop("stage", name)
    if stage not in TABLE:
        raise UserError(f"{path}: {name}: no stage {stage!r}; the table has {', '.join(TABLE)}")
    definition = _definition(configuration, stage)
    names = [_value(configuration, path) for path in definition.code]
    functions = [f for name in names for f in ((name,) if isinstance(name, str) else name)]
    kind = _value(configuration, f"{definition.chosen_by}.kind") if definition.chosen_by else ""
    made = Stage(
        name=name,
        function=definition.functions[kind],
        pattern=definition.pattern,
        inputs=inputs,
        settings={a: _setting(configuration, recording, p) for a, p in definition.reads.items()},
        modules=(*definition.modules, *(f.partition(":")[0] for f in functions)),
        folders=tuple(map(Path, configuration.code_folders)) if functions else (),
        own=bool(functions),
        seed=configuration.seed if definition.seeded else None,
        frames=pictured_frames(configuration) if definition.pattern == "pick" else (),
        files=(
            *(getattr(recording, definition.recorded) if definition.recorded else ()),
            *_files(_value(configuration, p) for p in definition.files),
        ),
        gives_files=bool(definition.recorded),
        keys=definition.reads,
    )
    if not definition.calls:
        return made
    called = _stage(configuration, recording, path, definition.calls, {})
    return replace(
        made,
        settings=made.settings | {"function": called.function, "settings": dict(called.settings)},
        modules=(*made.modules, called.function.partition(":")[0], *called.modules),
        folders=called.folders,
        own=called.own,
    )


def _definition(configuration: Configuration, stage: str) -> Definition:
    """The definition of a stage, or that which replaces it."""
    if stage in REPLAYED and isinstance(configuration.path, ReplayedPath):
        return REPLAYED[stage]
    own = (stage == "track" and isinstance(configuration.tracker, OwnCode)) or (
        stage == "scores" and configuration.metrics
    )
    return OWN[stage] if own else TABLE[stage]


def _files(names: Iterable[str | None]) -> tuple[Path, ...]:
    """The files of these names and the files that they refer to."""
    files = [Path(name) for name in names if name is not None]
    return tuple(file for own in files for file in (own, *referred_files(own)))


def _setting(configuration: Configuration, recording: Recording | None, path: str) -> Any:
    """A value of the configuration, or one that the files of the recording give."""
    name, _, attribute = path.partition(".")
    if name == "recording":
        return getattr(recording, attribute)
    value = _value(configuration, path)
    return undisturbed(value) if isinstance(value, Disturbance) else value


def _value(configuration: Configuration, path: str) -> Any:
    value: Any = configuration
    for part in path.split("."):
        value = getattr(value, part)
    return value
