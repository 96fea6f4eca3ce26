"""A recording completes the configuration: its rig, times and class, and what suits real images."""

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from stixel_cli.config import messages
from stixel_cli.config.folders import absolute
from stixel_cli.errors import ConfigurationError
from stixel_cli.recordings.find import find_recording, guess_layout
from stixel_cli.recordings.kitti_labels import CLASSES
from stixel_cli.recordings.parameters import Source
from stixel_cli.recordings.types import Calibration, Recording

OPTIONS = {"road": "estimated", "start": "label"}
"""Options for real images, where the user chooses none; without a label, start=scans."""

VALUES = {
    "road.pitch_range": 4.0,
    "stereo.nearest": 2.0,
    "stereo.subpixel": "phase_table",
    "stereo.disparities_at_full_size": 64,
    "occupancy.nearest": 2.0,
}
"""Values for real images, unless the user sets them: the road may be steep, obstacles near. One
matching takes half of the time, and is as good as two on real pairs; so does matching at two sizes
with KITTI's 208 disparities (docs/real-data.md)."""

SIZES = {
    "prior.length": 4.0,
    "prior.width": 1.65,
    "prior.length_std": 0.133,
    "prior.width_std": 0.086,
}
"""Cars and vans in KITTI's labels: n = 405, all clips at hand but 0005, which is scored
(tests/recordings/test_label_sizes.py). They are smaller than the class's drawn shapes."""

OF_KITTI = ("kitti_tracking", "kitti_odometry", "kitti_pair", "virtual_kitti")
"""Layouts whose cars have these sizes."""

BIAS = 0.25
"""Standard deviation of the disparity error of a whole recording that calibration leaves, px."""

EDGE = 4.0
"""Standard deviation of an object's left and right edge in a disparity image, px: car 31 of clip
0005 in frames 0 to 7 (docs/real-data.md)."""

NOISE_FACTOR = 2.5
"""Factor on a point's standard deviation. That of rendered images is smaller, and worse on clip
0005 (docs/real-data.md)."""

FROM_SCANS = {"start.motion": "sensor", "start.velocity": 3.0}
"""Values of start=scans, where the user sets none: a road user ahead mostly drives as the ego."""

OF_THE_SCENE = ("path", "ego", "renderer", "world", "sensor")
"""Groups of the rendered scene, which a recording does not have."""


FILES = ("folder", "right", "calibration", "disparity", "labels")
"""Keys of the group `source` that name a folder or a file."""


def guessed_source(typed: Mapping[str, Any], working_directory: str) -> list[str]:
    """The override of `source` that `source.folder` needs; [] where none is missing.

    Args:
        typed: names and values of the overrides.
        working_directory: to which relative names of folders refer.

    Raises:
        ConfigurationError: if the folder has no known layout.
    """
    folder = typed.get("source.folder")
    if "source" in typed or not isinstance(folder, str) or not folder:
        return []
    return [f"source={guess_layout(Path(absolute(folder, working_directory)))}"]


def recording_in(
    section: dict[str, Any], typed: Iterable[str], working_directory: str
) -> Recording | None:
    """The recording that the section `source` of a resolved configuration names.

    The folder's name in `section` is made absolute. None for rendered images, and for a section
    that is not valid: the validation of the whole configuration reports it.

    Raises:
        ConfigurationError: if a needed value is missing, or a group of the rendered scene is set.
        UserError: if a file of the recording is missing or not valid.
    """
    if section["kind"] == "rendered":
        return None
    for name in FILES:
        if isinstance(section.get(name), str) and section[name]:
            section[name] = absolute(section[name], working_directory)
    if type(section.get("sequence")) is int:
        # A name: 0005 is text to Hydra, but 12 is a number.
        section["sequence"] = str(section["sequence"])
    try:
        # As JSON, because strict validation of Python values takes only finished objects.
        source = TypeAdapter(Source).validate_json(json.dumps(section))
    except ValidationError:
        return None
    try:
        source.check()
    except ValueError as fault:
        raise ConfigurationError(str(fault)) from None
    for name in typed:
        group = name.partition(".")[0]
        if group in OF_THE_SCENE and (name, group) != ("ego", "ego"):
            raise ConfigurationError(
                f"{name}: is of the rendered scene; source={source.kind} has no {group} to set"
            )
    return find_recording(source)


def suitable_overrides(
    recording: Recording, typed: Mapping[str, Any], preset: Mapping[str, Any]
) -> list[str]:
    """The options and values that the recording needs and the user does not set.

    Args:
        recording: what the images are of.
        typed: keys and groups that the user gives, with their values and options.
        preset: those that an experiment's file sets. They do not replace `OPTIONS`.

    Raises:
        ConfigurationError: if the label has no class of road user and none is chosen.
    """
    options = OPTIONS | ({} if recording.label else {"start": "scans"})
    found = [f"{group}={option}" for group, option in options.items() if group not in typed]
    typed = {name: value for name, value in preset.items() if name not in options} | dict(typed)
    if "road_user" not in typed:
        if recording.label is None:
            raise ConfigurationError(
                "road_user: is required, because the recording has no labelled target "
                "(source.target)"
            )
        if recording.label not in CLASSES:
            raise ConfigurationError(
                f"source.target: is a {messages.printable(str(recording.label))}, which no class "
                f"suits; the classes are of {', '.join(CLASSES)}; or choose a road_user"
            )
        found.append(f"road_user={CLASSES[recording.label]}")
    chosen = {group: typed.get(group, option) for group, option in options.items()}
    values: dict[str, Any] = dict(VALUES)
    if chosen["start"] == "scans":
        values |= {} if recording.auto else FROM_SCANS
        if recording.label:
            lowest, highest = recording.first_bearings
            values["start.bearing"] = f"[{lowest:.3f},{highest:.3f}]"
    elif recording.label is None:
        raise ConfigurationError(
            f"start: {chosen['start']} needs a label (source.target); else choose start=scans"
        )
    if typed.get("stereo", "sgm") != "sgm":
        del values["stereo.subpixel"], values["stereo.disparities_at_full_size"]
    if chosen["road"] != "estimated":
        del values["road.pitch_range"]
    road_user = typed.get("road_user", CLASSES.get(recording.label or ""))
    if road_user == "car" and "prior" not in typed and recording.layout in OF_KITTI:
        values |= SIZES
    if typed.get("tracker") == "contour":
        values |= _of_contour(recording.calibration)
    return [*found, *(f"{key}={value}" for key, value in values.items() if key not in typed)]


def _of_contour(calibration: Calibration) -> dict[str, float]:
    """The errors of real images in the parameters of the tracker `contour`."""
    # A disparity error e moves a point at range r by e r² / (f B).
    at_ten_metres = BIAS * 100.0 / (calibration.focal_length * calibration.baseline)
    edge = math.degrees(EDGE / calibration.focal_length)
    return {
        "tracker.bias_std": round(at_ten_metres, 4),
        "tracker.silhouette_std": round(edge, 3),
        "tracker.noise_factor": NOISE_FACTOR,
    }


def with_recording(
    resolved: dict[str, Any], choices: dict[str, str], recording: Recording, typed: Iterable[str]
) -> None:
    """Set the sections that the files of the recording give: `rig`, `path`, `ego`, `source.frames`.

    Values that the user sets stay.
    """
    typed = set(typed)
    rig = rig_values(recording)
    given = {name: value for name, value in rig.items() if f"rig.{name}" not in typed}
    resolved["rig"] = resolved["rig"] | given
    time = resolved["source"]["sample_time"]
    resolved["path"] = {
        "kind": "source",
        "duration": round(recording.count * time, 9),
        "sample_time": time,
    }
    frames = f"{recording.frames.start}:{recording.frames.stop}"
    resolved["source"] = resolved["source"] | {"frames": frames}
    if "ego" not in typed:
        # One frame has no motion.
        if not recording.pose_files and recording.count > 1:
            raise ConfigurationError(
                "ego: the recording has no poses of the ego car; if it does not move, "
                "choose ego=parked"
            )
        kind = "source" if recording.pose_files else "parked"
        resolved["ego"] = {"kind": kind}
        choices["ego"] = kind
    choices["path"] = "source"
    if "rig" not in typed:
        choices["rig"] = "source"


def rig_values(recording: Recording) -> dict[str, Any]:
    """The values of the group `rig` that the calibration and the images give."""
    calibration = recording.calibration
    square = math.isclose(calibration.focal_length, calibration.focal_length_v, rel_tol=1e-6)
    angle = 2.0 * math.degrees(math.atan(recording.height / (2.0 * calibration.focal_length_v)))
    height = calibration.camera_height
    return {
        "width": recording.width,
        "height": recording.height,
        "horizontal_fov": None,
        "focal_length": calibration.focal_length,
        "principal_u": calibration.principal_u,
        "principal_v": calibration.principal_v,
        "baseline": calibration.baseline,
        "vertical_fov": None if square else angle,
        "pitch": 0.0,
        **({} if height is None else {"camera_height": height}),
    }
