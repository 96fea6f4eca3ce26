"""Stages from the scenario to the stixels, of rendered images and of recordings."""

from stixel_cli.config.schema import Renderer, StereoParameters
from stixel_cli.experiment.table.definition import FROM_LABELS, Definition, by_kind, only, same

STAGES: dict[str, Definition] = {
    "ego_motion": Definition(
        only("scene.ego:ego_motion"),
        "once",
        {"ego": "ego", "duration": "path.duration", "sample_time": "path.sample_time"},
    ),
    "scenario": Definition(
        only("scene.build:build_scenario"),
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
        only("rendering.sensor_noise:add_sensor_noise"),
        "map",
        same("sensor"),
        seeded=True,
    ),
    "match": Definition(
        by_kind(StereoParameters, "match"),
        "map",
        same("rig", "stereo"),
        chosen_by="stereo",
    ),
    "free_space": Definition(
        only("stixels.free_space:find_free_space"),
        "fold",
        same("rig", "road", "occupancy", "free_space"),
    ),
    "stixels": Definition(
        only("stixels.extraction:extract_stixels"),
        "map",
        same("rig", "height", "extraction"),
    ),
    "recorded_motion": Definition(
        only("recordings.motion:recorded_motion"),
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
        only("recordings.scenario:recorded_scenario"),
        "once",
        FROM_LABELS | {"target": "recording.target"},
        recorded="truth_files",
    ),
    "read_pairs": Definition(
        only("recordings.pairs:read_pairs"),
        "map",
        {"rectification": "recording.rectification"},
        recorded="images",
    ),
    "read_left": Definition(
        only("recordings.colour:read_left"),
        "pick",
        {"rectification": "recording.rectification"},
        recorded="left",
    ),
}


REPLAYED: dict[str, Definition] = {
    "ego_motion": Definition(
        only("recordings.replayed_motion:replayed_motion"),
        "once",
        {
            "first": "recording.first",
            "count": "recording.count",
            "sample_time": "path.sample_time",
        },
        recorded="pose_files",
    ),
    "scenario": Definition(
        only("recordings.replayed_scenario:replayed_scenario"),
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
