"""Stages that start trackers, track, score, and draw."""

from stixel_cli.config.schema import Tracker
from stixel_cli.experiment.table.definition import FROM_LABELS, Definition, by_kind, only, same

FILES_OF_PRIOR = ("prior.class_file", "prior.outline")

STAGES: dict[str, Definition] = {
    "truth_start": Definition(
        only("tracking.start:noisy_start"), "once", same("start"), seeded=True
    ),
    "scans_start": Definition(
        only("tracking.start_scans:start_from_scans"), "once", same("start", "prior")
    ),
    "find_tracks": Definition(
        only("tracking.several.clusters:find_tracks"),
        "once",
        {"prior": "prior", "std": "start.std"},
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
        only("recordings.truth:label_truths"), "once", FROM_LABELS, recorded="label_files"
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
        same("rig", "stereo") | {"by_motion": "source.by_motion"},
    ),
    "calibrate_rig": Definition(
        only("calibration.motion_fit:calibrate_rig"),
        "once",
        {"rig": "rig", "tables": "recording.tables", "by_motion": "source.by_motion"},
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
        only("pictures.birds_eye:moving_pictures"),
        "pick",
        same("field_of_view"),
        pictures=True,
    ),
    "rig_pictures": Definition(only("pictures.over_time:rig_pictures"), "once", pictures=True),
    "run_pictures": Definition(
        only("pictures.over_time:run_pictures"), "once", same("field_of_view"), pictures=True
    ),
}


OWN: dict[str, Definition] = {
    "track": Definition(
        only("tracking.own:track"),
        "once",
        {"prior": "prior", "function": "tracker.function", "parameters": "tracker.parameters"},
        files=FILES_OF_PRIOR,
        code=("tracker.function",),
    ),
    "scores": Definition(
        only("evaluation.own_metrics:evaluate_with_own"),
        "once",
        {"metrics": "metrics", "road_user": "true_class"},
        code=("metrics",),
    ),
}
"""The stages that replace those of `TABLE` where the user chooses own functions."""
