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
    """One stage of the table."""

    functions: Mapping[str, str]
    """The "module:function" to call, by the `kind` of the settings that `chosen_by` names; a stage
    with one implementation has the single key ""."""
    pattern: Literal["once", "map", "fold", "pick"]
    """How it runs over the frames, see `stixel_cli.engine.keys.Stage`."""
    reads: Mapping[str, str] = field(default_factory=dict)
    """Argument name to the dotted path of its settings in the configuration."""
    chosen_by: str = ""
    """Dotted path of the settings whose `kind` selects the function; "" if there is no choice."""
    seeded: bool = False
    """Whether it draws random numbers, and so needs the experiment's seed."""
    files: tuple[str, ...] = ()
    """Dotted paths of the settings that are files, of those that the chosen option has. Their
    content, and that of the files they refer to, is part of the key."""
    recorded: str = ""
    """The files of the recording that the function gets as `files`, an attribute of `Recording`,
    before those of `files`; "" for no file."""
    pictures: bool = False
    """Whether it draws: its result is a `Pictures`."""
    code: tuple[str, ...] = ()
    """Dotted paths of the settings that name the user's own functions: their code is part of the
    key."""
    calls: str = ""
    """Another stage whose function this one calls: it gets the function's name as `function` and
    its settings as `settings`; "" for no stage."""


def by_kind(options: Any, name: str) -> dict[str, str]:
    """The function `name` of each option of a union, by kind: the `functions` of a stage.

    It is in `KIND.py`, in the folder of the option's parameters.
    """
    functions = {}
    for option in get_args(options):
        folder = option.__module__.rpartition(".")[0]
        functions |= {kind: f"{folder}.{kind}:{name}" for kind in kinds_of(option)}
    return functions


def stage(
    functions: str | Mapping[str, str], reads: str = "", pattern: str = "once", **others: Any
) -> Definition:
    """A definition.

    `functions` may be the one "module:function", below our package. `reads` are the paths of the
    settings: `path.duration` is the argument `duration`; `name=path` is the argument `name`.
    """
    if isinstance(functions, str):
        functions = {"": f"stixel_cli.{functions}"}
    pairs = [(read.split("=")[0], read.split("=")[-1]) for read in reads.split()]
    arguments = {name.rpartition(".")[2]: path for name, path in pairs}
    return Definition(functions, pattern, arguments, **others)


FILES_OF_PRIOR = ("prior.class_file", "prior.outline")
MESH = ("road_user.mesh",)
RECORDED_IMAGES = "recording.calibration.rectification recording.messages"

TABLE: dict[str, Definition] = {
    "ego_motion": stage("scene.ego:ego_motion", "ego path.duration path.sample_time"),
    "scenario": stage("scene.path:build_scenario", "road_user path", files=MESH),
    "render": stage(
        by_kind(Renderer, "render"),
        "road_user world rig renderer",
        "map",
        chosen_by="renderer",
        files=MESH,
    ),
    "add_sensor_noise": stage(
        "rendering.sensor_noise:add_sensor_noise", "sensor rig", "map", seeded=True
    ),
    "match": stage("stereo.matching:match", "rig stereo", "map"),
    "free_space": stage(
        "stixels.free_space:find_free_space", "rig road occupancy free_space", "fold"
    ),
    "stixels": stage("stixels.extraction:extract_stixels", "rig height extraction", "map"),
    "recorded_motion": stage(
        "recordings.truth:recorded_motion",
        "rig recording.tables recording.count source.sample_time source.pose_scale",
        recorded="pose_files",
    ),
    "recorded_scenario": stage(
        "recordings.truth:recorded_scenario",
        "rig recording.tables recording.target",
        recorded="truth_files",
    ),
    "read_pairs": stage(
        "recordings.stereo_images:read_pairs", RECORDED_IMAGES, "map", recorded="images"
    ),
    "read_left": stage(
        "recordings.stereo_images:read_left", RECORDED_IMAGES, "pick", recorded="left"
    ),
    "objects": stage("measurements.objects:find_objects", "measurement.gates", "map"),
    "gather_scans": stage("measurements.stixels:gather_scans", "measurement rig"),
    "fabricate_scans": stage(
        "measurements.fabricated:fabricate_scans", "rig measurement", seeded=True
    ),
    "cast_lidar": stage(
        "measurements.lidar_casting:cast_lidar",
        "road_user world measurement.scanner camera_field=rig.field_of_view",
        files=MESH,
    ),
    "lidar_scans": stage(
        "measurements.lidar:lidar_scans", "measurement field_of_view", seeded=True
    ),
    "read_scans": stage(
        "measurements.file:read_scans",
        "measurement.path measurement.ego measurement.range_std measurement.horizontal_fov "
        "measurement.time_unit measurement.angle_unit measurement.shared_errors measurement.road_z",
        files=("measurement.path", "measurement.ego"),
    ),
    "read_truth": stage(
        "measurements.file_truth:read_truth",
        "measurement.truth measurement.time_unit measurement.angle_unit",
        files=("measurement.truth",),
    ),
    "own_scans": stage(
        "measurements.own:own_scans",
        "measurement.function measurement.parameters",
        seeded=True,
        code=("measurement.function",),
    ),
    "disturb_scans": stage(
        "measurements.disturbance:disturb_scans",
        "measurement.dropout measurement.clutter_rate range_max",
        seeded=True,
    ),
    "truth_start": stage("tracking.start:noisy_start", "start", seeded=True),
    "scans_start": stage("tracking.several:start_from_scans", "start prior"),
    "find_tracks": stage("tracking.several:find_tracks", "prior start"),
    "track": stage(
        by_kind(Tracker, "track"),
        "prior tracker",
        chosen_by="tracker",
        files=(*FILES_OF_PRIOR, "tracker.path"),
    ),
    "track_each": stage("tracking.several:track_each", calls="track"),
    "label_truths": stage(
        "recordings.truth:label_truths", "rig recording.tables", recorded="label_files"
    ),
    "label_scores": stage("evaluation.label_scores:score_tracks", "road_user=road_user.kind"),
    "scores": stage(
        "evaluation.evaluate:evaluate", "own=metrics road_user=true_class", code=("metrics",)
    ),
    "stage_errors": stage(
        "validation.stage_errors:stage_errors", "rig road occupancy free_space", "map"
    ),
    "point_errors": stage("validation.point_errors:point_errors", "rig"),
    "track_points": stage("calibration.track_points:track_points", "rig stereo source.by_motion"),
    "calibrate_rig": stage(
        "calibration.motion_fit:calibrate_rig",
        "rig recording.tables source.by_motion",
        recorded="pose_files",
    ),
    "calibrated_rig": stage("calibration.calibrated_rig:calibrated_rig"),
    "camera_pictures": stage(
        "pictures.camera:camera_pictures", "rig road occupancy", "pick", pictures=True
    ),
    "camera_frames": stage("pictures.camera:camera_frames", "rig road occupancy", "map"),
    "track_pictures": stage(
        "pictures.birds_eye:track_pictures", "field_of_view tracker", "pick", pictures=True
    ),
    "moving_pictures": stage(
        "pictures.birds_eye:moving_pictures", "field_of_view", "pick", pictures=True
    ),
    "rig_pictures": stage("pictures.over_time:rig_pictures", pictures=True),
    "path_pictures": stage("pictures.path_figure:path_pictures", "field_of_view", pictures=True),
    "error_pictures": stage("pictures.over_time:error_pictures", pictures=True),
}

REPLAYED: dict[str, Definition] = {
    "ego_motion": stage(
        "recordings.truth:recorded_motion",
        "recording.tables recording.count path.sample_time",
        recorded="pose_files",
    ),
    "scenario": stage(
        "recordings.replay:replayed_scenario",
        "road_user recording.tables path.target path.smoothing",
        files=MESH,
        recorded="truth_files",
    ),
}
"""The stages that replace those of `TABLE` with `path=recorded`."""

OWN: dict[str, Definition] = {
    "track": stage(
        "tracking.own:track",
        "prior tracker.function tracker.parameters",
        files=FILES_OF_PRIOR,
        code=("tracker.function",),
    ),
}
"""The stage that replaces that of `TABLE` where the tracker is the user's own function."""

PICTURES = tuple(name for name, stage in TABLE.items() if stage.pictures)
"""The stages that draw; their nodes have the same names."""


def readers(name: str) -> list[str]:
    """The stages that read a group or a key, given by its name with dots."""
    found = {}
    for stage, one in [row for table in (TABLE, OWN, REPLAYED) for row in table.items()]:
        paths = [*one.reads.values(), *one.files, *one.code]
        paths += ["seed"] * one.seeded + ["pictures.frames"] * (one.pattern == "pick")
        if any(f"{p}.".startswith(f"{name}.") or name.startswith(f"{p}.") for p in paths):
            found[stage] = None
    return list(found)
