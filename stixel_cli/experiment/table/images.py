"""Stages from the scenario to the stixels and to the scans of each kind of measurement."""

from stixel_cli.config.schema import Renderer
from stixel_cli.experiment.table.definition import FROM_LABELS, Definition, by_kind, only, same

RECTIFICATION = "recording.calibration.rectification"

STAGES: dict[str, Definition] = {
    "ego_motion": Definition(
        only("scene.ego:ego_motion"),
        "once",
        {"ego": "ego", "duration": "path.duration", "sample_time": "path.sample_time"},
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
        {
            "rig": "rig",
            "tables": "recording.tables",
            "count": "recording.count",
            "sample_time": "source.sample_time",
            "pose_scale": "source.pose_scale",
        },
        recorded="pose_files",
    ),
    "recorded_scenario": Definition(
        only("recordings.truth:recorded_scenario"),
        "once",
        FROM_LABELS | {"target": "recording.target"},
        recorded="truth_files",
    ),
    "read_pairs": Definition(
        only("recordings.stereo_images:read_pairs"),
        "map",
        {"rectification": RECTIFICATION, "messages": "recording.messages"},
        recorded="images",
    ),
    "read_left": Definition(
        only("recordings.stereo_images:read_left"),
        "pick",
        {"rectification": RECTIFICATION, "messages": "recording.messages"},
        recorded="left",
    ),
    "objects": Definition(
        only("measurements.objects:find_objects"), "map", {"gates": "measurement.gates"}
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
        {
            "road_user": "road_user",
            "world": "world",
            "scanner": "measurement.scanner",
            "camera_field": "rig.field_of_view",
        },
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
        {
            "path": "measurement.path",
            "ego": "measurement.ego",
            "range_std": "measurement.range_std",
            "horizontal_fov": "measurement.horizontal_fov",
            "time_unit": "measurement.time_unit",
            "angle_unit": "measurement.angle_unit",
            "shared_errors": "measurement.shared_errors",
            "road_z": "measurement.road_z",
        },
        files=("measurement.path", "measurement.ego"),
    ),
    "read_truth": Definition(
        only("measurements.file_truth:read_truth"),
        "once",
        {
            "truth": "measurement.truth",
            "time_unit": "measurement.time_unit",
            "angle_unit": "measurement.angle_unit",
        },
        files=("measurement.truth",),
    ),
    "own_scans": Definition(
        only("measurements.own:own_scans"),
        "once",
        {"function": "measurement.function", "parameters": "measurement.parameters"},
        seeded=True,
        code=("measurement.function",),
    ),
    "disturb_scans": Definition(
        only("measurements.disturbance:disturb_scans"),
        "once",
        {
            "dropout": "measurement.dropout",
            "clutter_rate": "measurement.clutter_rate",
            "range_max": "range_max",
        },
        seeded=True,
    ),
}


REPLAYED: dict[str, Definition] = {
    "ego_motion": Definition(
        only("recordings.motion:replayed_motion"),
        "once",
        {
            "tables": "recording.tables",
            "count": "recording.count",
            "sample_time": "path.sample_time",
        },
        recorded="pose_files",
    ),
    "scenario": Definition(
        only("recordings.replay:replayed_scenario"),
        "once",
        {
            "road_user": "road_user",
            "tables": "recording.tables",
            "target": "path.target",
            "smoothing": "path.smoothing",
        },
        files=("road_user.mesh",),
        recorded="truth_files",
    ),
}
"""The stages that replace those of `TABLE` with `path=recorded`."""
