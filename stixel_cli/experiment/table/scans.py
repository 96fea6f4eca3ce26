"""Stages that make the scans of each kind of measurement."""

from stixel_cli.experiment.table.definition import Definition, only, same

STAGES: dict[str, Definition] = {
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
        },
        files=("measurement.path", "measurement.ego"),
    ),
    "read_truth": Definition(
        only("measurements.file_truth:read_truth"),
        "once",
        {"truth": "measurement.truth"},
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
