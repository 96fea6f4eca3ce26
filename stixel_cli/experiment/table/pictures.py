"""Stages that draw."""

from stixel_cli.experiment.table.definition import Definition, only, same

STAGES: dict[str, Definition] = {
    "occupancy": Definition(
        only("stixels.displayed_grid:picture_grid"),
        "pick",
        same("rig", "road", "occupancy"),
    ),
    "camera_pictures": Definition(
        only("pictures.camera:camera_pictures"),
        "pick",
        same("rig"),
        pictures=True,
    ),
    "camera_frames": Definition(
        only("pictures.camera_frames:camera_frames"),
        "map",
    ),
    "track_pictures": Definition(
        only("pictures.birds_eye:track_pictures"),
        "pick",
        same("field_of_view"),
        pictures=True,
    ),
    "run_pictures": Definition(
        only("pictures.over_time:run_pictures"),
        "once",
        same("field_of_view"),
        pictures=True,
    ),
}
