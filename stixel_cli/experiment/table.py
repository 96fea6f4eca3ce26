"""The table of all stages.

A definition names the function, the settings that each of its arguments takes, and how the stage
runs over the frames. Each node of `pipelines/*.yaml` names its stage and its inputs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from stixel_cli.config.annotations import kinds_of
from stixel_cli.config.schema import Renderer, Tracker


@dataclass(frozen=True)
class Definition:
    """One stage of the table.

    Attributes:
        functions: "module:function" to call, by the `kind` of the settings that `chosen_by` names;
            a stage with one implementation has the single key "".
        pattern: how it runs over the frames, see `stixel_cli.engine.keys.Stage`.
        reads: argument name to the dotted path of its settings in the configuration.
        chosen_by: dotted path of the settings whose `kind` selects the function; "" if there is no
            choice.
        seeded: whether it draws random numbers, and so needs the experiment's seed.
        files: dotted paths of the settings that are files, of those that the chosen option has.
            Their content, and that of the files they refer to, is part of the key.
        recorded: the files of the recording that the function gets as `files`, an attribute of
            `Recording`, before those of `files`; "" for no file.
        pictures: whether it draws: its result is a `Pictures`.
        code: dotted paths of the settings that name the user's own functions: their code is part of
            the key.
        calls: another stage whose function this one calls: it gets the function's name as
            `function` and its settings as `settings`; "" for no stage.
    """

    functions: Mapping[str, str]
    pattern: Literal["once", "map", "fold", "pick"]
    reads: Mapping[str, str] = field(default_factory=dict)
    chosen_by: str = ""
    seeded: bool = False
    files: tuple[str, ...] = ()
    recorded: str = ""
    pictures: bool = False
    code: tuple[str, ...] = ()
    calls: str = ""


def only(function: str) -> dict[str, str]:
    """The `functions` of a stage with one implementation."""
    return {"": f"stixel_cli.{function}"}


def by_kind(options: Any, name: str) -> dict[str, str]:
    """The function `name` of each option of a union, by kind.

    It is in `KIND.py`, in the folder of the option's parameters.
    """
    functions = {}
    for option in get_args(options):
        folder = option.__module__.rpartition(".")[0]
        functions |= {kind: f"{folder}.{kind}:{name}" for kind in kinds_of(option)}
    return functions


def same(*paths: str) -> dict[str, str]:
    """The `reads` of arguments with the names of their settings, `path.duration` of `duration`."""
    return {path.rpartition(".")[2]: path for path in paths}


FILES_OF_PRIOR = ("prior.class_file", "prior.outline")

TABLE: dict[str, Definition] = {
    "ego_motion": Definition(
        only("scene.ego:ego_motion"), "once", same("ego", "path.duration", "path.sample_time")
    ),
    "scenario": Definition(
        only("scene.path:build_scenario"),
        "once",
        same("road_user", "path"),
        files=("road_user.mesh",),
    ),
    "render": Definition(
        by_kind(Renderer, "render"),
        "map",
        same("road_user", "world", "rig", "renderer"),
        chosen_by="renderer",
        files=("road_user.mesh",),
    ),
    "add_sensor_noise": Definition(
        only("rendering.sensor_noise:add_sensor_noise"), "map", same("sensor", "rig"), seeded=True
    ),
    "match": Definition(only("stereo.matching:match"), "map", same("rig", "stereo")),
    "free_space": Definition(
        only("stixels.free_space:find_free_space"),
        "fold",
        same("rig", "road", "occupancy", "free_space"),
    ),
    "stixels": Definition(
        only("stixels.extraction:extract_stixels"), "map", same("rig", "height", "extraction")
    ),
    "recorded_motion": Definition(
        only("recordings.motion:recorded_motion"),
        "once",
        same(
            "rig", "recording.tables", "recording.count", "source.sample_time", "source.pose_scale"
        ),
        recorded="pose_files",
    ),
    "recorded_scenario": Definition(
        only("recordings.truth:recorded_scenario"),
        "once",
        same("rig", "recording.tables", "recording.target"),
        recorded="truth_files",
    ),
    "read_pairs": Definition(
        only("recordings.stereo_images:read_pairs"),
        "map",
        same("recording.calibration.rectification", "recording.messages"),
        recorded="images",
    ),
    "read_left": Definition(
        only("recordings.stereo_images:read_left"),
        "pick",
        same("recording.calibration.rectification", "recording.messages"),
        recorded="left",
    ),
    "objects": Definition(
        only("measurements.objects:find_objects"), "map", same("measurement.gates")
    ),
    "gather_scans": Definition(
        only("measurements.stixels:gather_scans"), "once", same("measurement", "rig")
    ),
    "fabricate_scans": Definition(
        only("measurements.fabricated:fabricate_scans"),
        "once",
        same("rig", "measurement"),
        seeded=True,
    ),
    "cast_lidar": Definition(
        only("measurements.lidar_casting:cast_lidar"),
        "once",
        same("road_user", "world", "measurement.scanner") | {"camera_field": "rig.field_of_view"},
        files=("road_user.mesh",),
    ),
    "lidar_scans": Definition(
        only("measurements.lidar:lidar_scans"),
        "once",
        same("measurement", "field_of_view"),
        seeded=True,
    ),
    "read_scans": Definition(
        only("measurements.file:read_scans"),
        "once",
        same(
            "measurement.path",
            "measurement.ego",
            "measurement.range_std",
            "measurement.horizontal_fov",
            "measurement.time_unit",
            "measurement.angle_unit",
            "measurement.shared_errors",
            "measurement.road_z",
        ),
        files=("measurement.path", "measurement.ego"),
    ),
    "read_truth": Definition(
        only("measurements.file_truth:read_truth"),
        "once",
        same("measurement.truth", "measurement.time_unit", "measurement.angle_unit"),
        files=("measurement.truth",),
    ),
    "own_scans": Definition(
        only("measurements.own:own_scans"),
        "once",
        same("measurement.function", "measurement.parameters"),
        seeded=True,
        code=("measurement.function",),
    ),
    "disturb_scans": Definition(
        only("measurements.disturbance:disturb_scans"),
        "once",
        same("measurement.dropout", "measurement.clutter_rate", "range_max"),
        seeded=True,
    ),
    "truth_start": Definition(
        only("tracking.start:noisy_start"), "once", same("start"), seeded=True
    ),
    "scans_start": Definition(
        only("tracking.start_scans:start_from_scans"), "once", same("start", "prior")
    ),
    "find_tracks": Definition(
        only("tracking.several.clusters:find_tracks"), "once", same("prior", "start.std")
    ),
    "track": Definition(
        by_kind(Tracker, "track"),
        "once",
        same("prior", "tracker"),
        chosen_by="tracker",
        files=(*FILES_OF_PRIOR, "tracker.path"),
    ),
    "track_each": Definition(only("tracking.several.track_each:track_each"), "once", calls="track"),
    "label_truths": Definition(
        only("recordings.truth:label_truths"),
        "once",
        same("rig", "recording.tables"),
        recorded="label_files",
    ),
    "label_scores": Definition(
        only("evaluation.label_scores:score_tracks"), "once", {"road_user": "road_user.kind"}
    ),
    "scores": Definition(only("evaluation.evaluate:evaluate"), "once", {"road_user": "true_class"}),
    "stage_errors": Definition(
        only("validation.stage_errors:stage_errors"),
        "map",
        same("rig", "road", "occupancy", "free_space"),
    ),
    "point_errors": Definition(only("validation.point_errors:point_errors"), "once", same("rig")),
    "track_points": Definition(
        only("calibration.track_points:track_points"),
        "once",
        same("rig", "stereo", "source.by_motion"),
    ),
    "calibrate_rig": Definition(
        only("calibration.motion_fit:calibrate_rig"),
        "once",
        same("rig", "recording.tables", "source.by_motion"),
        recorded="pose_files",
    ),
    "calibrated_rig": Definition(only("calibration.calibrated_rig:calibrated_rig"), "once"),
    "occupancy": Definition(
        only("stixels.displayed_grid:picture_grid"), "pick", same("rig", "road", "occupancy")
    ),
    "camera_pictures": Definition(
        only("pictures.camera:camera_pictures"), "pick", same("rig"), pictures=True
    ),
    "camera_frames": Definition(
        only("pictures.camera:camera_frames"), "map", same("rig", "road", "occupancy")
    ),
    "track_pictures": Definition(
        only("pictures.birds_eye:track_pictures"),
        "pick",
        same("field_of_view", "tracker"),
        pictures=True,
    ),
    "moving_pictures": Definition(
        only("pictures.birds_eye:moving_pictures"), "pick", same("field_of_view"), pictures=True
    ),
    "rig_pictures": Definition(only("pictures.over_time:rig_pictures"), "once", pictures=True),
    "run_pictures": Definition(
        only("pictures.over_time:run_pictures"), "once", same("field_of_view"), pictures=True
    ),
}

REPLAYED: dict[str, Definition] = {
    "ego_motion": Definition(
        only("recordings.motion:replayed_motion"),
        "once",
        same("recording.tables", "recording.count", "path.sample_time"),
        recorded="pose_files",
    ),
    "scenario": Definition(
        only("recordings.replay:replayed_scenario"),
        "once",
        same("road_user", "recording.tables", "path.target", "path.smoothing"),
        files=("road_user.mesh",),
        recorded="truth_files",
    ),
}
"""The stages that replace those of `TABLE` with `path=recorded`."""

OWN: dict[str, Definition] = {
    "track": Definition(
        only("tracking.own:track"),
        "once",
        same("prior", "tracker.function", "tracker.parameters"),
        files=FILES_OF_PRIOR,
        code=("tracker.function",),
    ),
    "scores": Definition(
        only("evaluation.own_metrics:evaluate_with_own"),
        "once",
        same("metrics") | {"road_user": "true_class"},
        code=("metrics",),
    ),
}
"""The stages that replace those of `TABLE` where the user chooses own functions."""

PICTURES = tuple(name for name, stage in TABLE.items() if stage.pictures)
"""The stages that draw; their nodes have the same names."""


def readers(name: str) -> list[str]:
    """The stages that read a group or a key, given by its name with dots."""

    def reads(stage: Definition) -> bool:
        paths = [*stage.reads.values(), *stage.files, *stage.code]
        paths += ["seed"] * stage.seeded + ["pictures.frames"] * (stage.pattern == "pick")
        return any(
            f"{path}.".startswith(f"{name}.") or name.startswith(f"{path}.") for path in paths
        )

    rows = [row for table in (TABLE, OWN, REPLAYED) for row in table.items()]
    return list(dict.fromkeys(name for name, stage in rows if reads(stage)))
