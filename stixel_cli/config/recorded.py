"""A recording completes the configuration: its rig, times and class, and what suits real data.

That is of `source=…` the images, and of `path=recorded` the motion in rendered images. What suits
them where the user sets nothing is in `conf/recorded.yaml`.
"""

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from stixel_cli.config import folders, messages
from stixel_cli.config.choice import Resolved, set_by_experiment
from stixel_cli.config.compose import Composer, with_full_names
from stixel_cli.config.folders import real_image_parameters
from stixel_cli.errors import ConfigurationError, located
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.find import guess_layout
from stixel_cli.recordings.parameters import CALIBRATIONS, Recorded, Source
from stixel_cli.recordings.rig_files import read_named_calibration
from stixel_cli.recordings.types import Recording
from stixel_cli.scene.parameters import CLASS_OF_KITTI_TYPE, ReplayedPath

OF_THE_SCENE = ("path", "ego", "renderer", "world", "sensor")
"""Groups of the rendered scene, which recorded images do not have."""

OF_THE_MOTION = {
    "ego": "the recording has the ego car's motion: leave it out",
    "path.duration": "follows from the frames of the track: set path.frames=first:stop",
}
"""What a replayed motion gives."""

_SCHEMAS = {"source": Annotated[Source, Field(discriminator="kind")], "path": ReplayedPath}


def with_recording(typed: Mapping[str, Any], composer: Composer) -> Resolved:
    """The resolved configuration of `typed` settings, completed by its recording, if it has one.

    UserError for a recording that cannot be opened, or settings that do not suit it.
    """
    settings, group = dict(typed), "source"
    folder, working_directory = typed.get("source.folder"), composer.working_directory
    if "source" not in typed and isinstance(folder, str) and folder:
        settings["source"] = guess_layout(Path(folders.absolute(folder, working_directory)))
    # The other settings may be of options that only the recording chooses.
    resolved, _ = composer.resolved(
        {k: v for k, v in settings.items() if folders.outermost_group(k) == "source"}
    )
    if resolved["source"]["kind"] == "rendered":
        group = "path"
        resolved, choices = composer.resolved(settings)
        if resolved["path"]["kind"] != "recorded":
            return resolved, choices
    section = dict(with_full_names(group, resolved[group], working_directory))
    if type(section.get("sequence")) is int:
        # A name: 0005 is text to Hydra, but 12 is a number.
        section["sequence"] = str(section["sequence"])
    given = _parameters(group, section, typed)
    recording = composer.files.open(given)
    suitable = folders.values_beside_groups("recorded")[group]
    options = suitable["options"] | {"road_user": recording.road_user}
    if group == "source" and not recording.label:
        options["start"] = "scans"
    fixed = dict(typed)
    if group == "source" and folders.EXPERIMENT in typed:
        # What an experiment's file sets does not replace suitable options.
        preset = set_by_experiment(typed[folders.EXPERIMENT])
        fixed = {k: v for k, v in preset.items() if k == "road_user" or k not in options} | fixed
    chosen = options | fixed
    if group == "source":
        chosen = _values(suitable, given, recording, chosen) | chosen
    missing = [*_missing(section, given, recording, chosen, fixed)]
    if "ego" not in typed and recording.count > 1 and not recording.pose_files:
        # One frame has no motion.
        where = {"rosbag": " (source.odometry_topic)", "kitti_tracking": " (oxts/NNNN.txt)"}
        missing.append(
            f"ego: the recording has no poses of the ego car{where.get(given.kind, '')}; if it "
            "does not move, choose ego=parked"
        )
    if missing:
        raise ConfigurationError("; also ".join(missing))
    settings |= {name: value for name, value in chosen.items() if name not in fixed}
    resolved, choices = composer.resolved(settings)
    resolved[group] = section
    composer.files.add(_completed(resolved, choices, given, recording, typed), recording)
    return resolved, choices


def _parameters(
    group: str, section: Mapping[str, Any], typed: Collection[str]
) -> Recorded | ReplayedPath:
    """The parameters in a section; what it lacks is reported after the recording was opened.

    ConfigurationError for a setting that the recording gives.
    """
    content = {**section, "sample_time": section["sample_time"] or 0.1}
    if group == "path":
        content["duration"] = 1.0  # It follows from the files.
    given = messages.read_settings(_SCHEMAS[group], content, typed, group)
    for name in typed:
        outer = name.partition(".")[0]
        if group == "source" and outer in OF_THE_SCENE and name != "ego":
            raise ConfigurationError(
                f"{name}: is of the rendered scene; source={given.kind} has no {outer} to set"
            )
        for key, reason in OF_THE_MOTION.items() if group == "path" else ():
            if f"{name}.".startswith(f"{key}."):
                raise ConfigurationError(f"{name}: with path=recorded, {reason}")
    return given


def _missing(
    section: Mapping[str, Any],
    given: Recorded | ReplayedPath,
    recording: Recording,
    chosen: Mapping[str, Any],
    fixed: Collection[str],
) -> Iterator[str]:
    """What the user must set; `chosen` has options and values, some of them `fixed`."""
    group = "path" if isinstance(given, ReplayedPath) else "source"
    if section["sample_time"] is None:
        yield f"{group}.sample_time: is required, s from one frame to the next"
    if "road_user" not in fixed and recording.label is None:
        yield "road_user: is required, because the recording has no labelled target (source.target)"
    elif "road_user" not in fixed and recording.road_user is None:
        yield (
            f"{group}.target: is a {messages.printable(recording.label)}, which no class "
            f"suits; the classes are of {', '.join(CLASS_OF_KITTI_TYPE)}; or choose a road_user"
        )
    if group == "path":
        return
    if chosen["start"] != "scans" and recording.label is None:
        yield f"start: {chosen['start']} needs a label (source.target); else choose start=scans"
    height = chosen.get("rig.camera_height")
    if isinstance(height, float) and math.isnan(height):
        why = _height_of_road(recording, given, chosen)[1]
        yield (
            "rig.camera_height: is required, m above the road: the recording's files do not state "
            f"it, and {why}. Check first that the two images are one pair, of this rig"
        )
    if chosen.get("start.motion") == "sensor" and not (
        {"start.bearing", "start.range"} & chosen.keys()
    ):
        text = "start.bearing: is required, [lowest,highest] degrees of the target, or start.range"
        every = ", or source.target=auto to track every moving object"
        yield text + every if hasattr(given, "target") else text


def _values(
    suitable: Mapping[str, Any], source: Recorded, recording: Recording, chosen: Mapping[str, Any]
) -> dict[str, Any]:
    """Values for recorded images, by key; `chosen` has options and values by name."""
    calibration = recording.calibration
    facts = {**chosen, "source": recording.layout, "auto": recording.auto}
    values = folders.values_that_suit(suitable, facts)
    if calibration.camera_height is None and not {"rig", "rig.camera_height"} & chosen.keys():
        values["rig.camera_height"] = _height_of_road(recording, source, chosen)[0]
    if chosen["start"] == "scans" and recording.label:
        values["start.bearing"] = [round(bearing, 3) for bearing in recording.first_bearings]
    if chosen.get("tracker") == "contour":
        edge = math.degrees(suitable["errors"]["edge"] / calibration.focal_length)
        values["tracker.silhouette_std"] = round(edge, 3)
    return values


def _height_of_road(
    recording: Recording, source: Recorded, chosen: Mapping[str, Any]
) -> tuple[float, str]:
    """Height in m of the cameras above the road that the images show; NaN, and why, without one."""
    # OpenCV and Numba are imported for it.
    from stixel_cli.calibration.road_pose import compared_rows, road_pose
    from stixel_cli.stixels.road import MIDDLE, NO_ROAD

    size = recording.width, recording.height
    rig = recording.calibration.rig_values(*size)
    set_by_user = {k.removeprefix("rig."): v for k, v in chosen.items() if k.startswith("rig.")}
    rig = messages.validated(Rig, rig | set_by_user | {"camera_height": MIDDLE}, "rig")
    stereo = real_image_parameters().stereo
    with located("", ConfigurationError):
        stereo.check(rig)
    rows = compared_rows(recording, rig.far_disparity, source.check_rectification)
    height, _ = road_pose(recording, rig, stereo)
    return round(height, 2), f"{NO_ROAD}; {rows.fault}" if rows and rows.fault else NO_ROAD


def _completed(
    resolved: dict[str, Any],
    choices: dict[str, str],
    given: Recorded | ReplayedPath,
    recording: Recording,
    typed: Collection[str],
) -> Recorded | ReplayedPath:
    """Set what the files of the recording give, and return `given` with it.

    That is the path's duration, `frames` and the section `ego`, and of recorded images the sections
    `rig` and `path`. Values that the user sets stay.
    """
    group = "path" if isinstance(given, ReplayedPath) else "source"
    changes: dict[str, Any] = {"frames": f"{recording.frames.start}:{recording.frames.stop}"}
    duration = round(recording.count * given.sample_time, 9)
    if group == "path":
        changes["duration"] = duration
    resolved[group] = resolved[group] | changes
    if "ego" not in typed:
        choices["ego"] = "source" if recording.pose_files else "parked"
        resolved["ego"] = {"kind": choices["ego"]}
    if group == "source":
        path = {"kind": "source", "duration": duration, "sample_time": given.sample_time}
        resolved["path"], choices["path"] = path, "source"
        given_rig = recording.calibration.rig_values(recording.width, recording.height)
        if given.calibration not in CALIBRATIONS:
            given_rig |= read_named_calibration(Path(given.calibration)).error_values
        rig = {k: v for k, v in given_rig.items() if f"rig.{k}" not in typed}
        resolved["rig"] = resolved["rig"] | rig
        if "rig" not in typed:
            choices["rig"] = "source"
    return replace(given, **changes)
