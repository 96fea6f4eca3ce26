"""`path=recorded` completes the configuration: its frames, the class, and the way it needs."""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError

from stixel_cli.config import messages
from stixel_cli.config.folders import absolute
from stixel_cli.errors import ConfigurationError
from stixel_cli.recordings.kitti_labels import CLASSES
from stixel_cli.recordings.replay import find_replay
from stixel_cli.recordings.types import Recording
from stixel_cli.scene.path_parameters import ReplayedPath

OPTIONS = {"rig": "kitti", "world": "roadside"}
"""Options that the user may replace: the labels are in the view of KITTI's camera, and only this
world has no houses on the way."""

REFUSED = {
    "ego": "the recording has the ego car's motion: leave it out",
    "path.duration": "follows from the frames of the track: set path.frames=first:stop",
}


def replay_in(
    section: dict[str, Any], typed: Iterable[str], working_directory: str
) -> Recording | None:
    """The files that the section `path` of a resolved configuration names.

    The folder's name in `section` is made absolute. None for a section that is not valid: the
    validation of the whole configuration reports it.

    Raises:
        ConfigurationError: if a needed value is missing, or a value is set that the files give.
        UserError: if a file is missing or not valid, or the track has too few labels.
    """
    for name in typed:
        for key, reason in REFUSED.items():
            if name == key or name.startswith(f"{key}."):
                raise ConfigurationError(f"{name}: with path=recorded, {reason}")
    if isinstance(section["folder"], str) and section["folder"]:
        section["folder"] = absolute(section["folder"], working_directory)
    if type(section["sequence"]) is int:
        # A name: 0005 is text to Hydra, but 12 is a number.
        section["sequence"] = str(section["sequence"])
    try:
        # The duration follows from the files.
        text = json.dumps(section | {"duration": 1.0})
        path = TypeAdapter(ReplayedPath).validate_json(text)
        path.check()
    except ValidationError:
        return None
    except ValueError as fault:
        raise ConfigurationError(str(fault)) from None
    return find_replay(path)


def suitable_overrides(replay: Recording, typed: Mapping[str, Any]) -> list[str]:
    """The options that the motion needs and the user does not choose.

    Raises:
        ConfigurationError: if the label has no class of road user and none is chosen.
    """
    options = dict(OPTIONS)
    if "road_user" not in typed:
        if replay.label not in CLASSES:
            raise ConfigurationError(
                f"path.target: is a {messages.printable(str(replay.label))}, which no class suits; "
                f"the classes are of {', '.join(CLASSES)}; or choose a road_user"
            )
        options["road_user"] = CLASSES[replay.label]
    return [f"{group}={option}" for group, option in options.items() if group not in typed]


def with_replay(resolved: dict[str, Any], choices: dict[str, str], replay: Recording) -> None:
    """Set what the files give: the frames and the duration of the path, and the section `ego`."""
    time = resolved["path"]["sample_time"]
    resolved["path"] = resolved["path"] | {
        "frames": f"{replay.frames.start}:{replay.frames.stop}",
        "duration": round(replay.count * time, 9),
    }
    resolved["ego"] = {"kind": "source"}
    choices["ego"] = "source"
