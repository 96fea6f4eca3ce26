"""From overrides to a validated configuration, by Hydra and the schema."""

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from stixel_cli.border.origins import TYPED
from stixel_cli.config import folders, messages, own_options
from stixel_cli.config.choice import Resolved, compose_options, with_values
from stixel_cli.config.overrides import Override, read_overrides, settings_of_run
from stixel_cli.config.schema import Configuration
from stixel_cli.config.texts import split_override
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.measurements.file import FileParameters
from stixel_cli.recordings.parameters import CALIBRATIONS
from stixel_cli.scene.ego import Parked
from stixel_cli.scene.parameters import ReplayedPath

if TYPE_CHECKING:
    from stixel_cli.recordings.types import Recording


_FILES = {
    "road_user": ("mesh",),
    "prior": ("road_user", "outline"),
    "source": ("folder", "left", "right", "calibration", "disparity", "labels"),
    "path": ("folder",),
    "measurement": ("path", "ego", "truth"),
    "cache": ("folder",),
}
"""Keys that name a file or a folder of the user, but for two whose value may be a word."""


class UserFiles:
    """Opens what configurations name, each once; a new object opens it anew.

    The configuration takes from an opened recording what it sets, the stages take its frames.

    Attributes:
        notes: what a user may not expect of the opened files, one line each.
    """

    def __init__(self) -> None:
        self._opened: dict[str, Any] = {}
        self.notes: list[str] = []

    def open(self, parameters: Any) -> Any:
        """The `Recording` of a source or a replayed path, or the `Scans` of a file, by its
        parameters. The truth of scans is checked too.

        UserError if a file is missing or not valid.
        """
        name = repr(parameters)
        if name not in self._opened:
            # Imported here, because most runs have no such files.
            if isinstance(parameters, FileParameters):
                opened = self._scans(parameters)
            elif isinstance(parameters, ReplayedPath):
                from stixel_cli.recordings.replay import find_replay

                opened = find_replay(parameters)
            else:
                from stixel_cli.recordings.find import find_recording

                opened = find_recording(parameters)
            self._opened[name] = opened
        return self._opened[name]

    def _scans(self, given: FileParameters) -> Any:
        from stixel_cli.measurements.file import read_scans

        if given.path is None:
            raise UserError("measurement.path: is missing: give the scans, .csv or .npz")
        units = {"time_unit": given.time_unit, "angle_unit": given.angle_unit}
        others = units | {"note": self.notes.append, "road_z": given.road_z}
        scans = read_scans(given.path, given.ego, given.range_std, **others)
        if given.truth is not None:
            # Shapely is imported for it.
            from stixel_cli.measurements.file_truth import read_truth

            read_truth(scans, given.truth, **units)
        return scans

    def add(self, parameters: Any, opened: Any) -> None:
        """Let `parameters` also mean what is `opened`: with the frames that it has."""
        self._opened[repr(parameters)] = opened


@dataclass(frozen=True)
class Composition:
    """A configuration and where it came from."""

    configuration: Configuration
    """Validated."""
    choices: dict[str, str]
    """The option of each group."""
    overrides: tuple[str, ...]
    """As they were typed."""
    resolved: dict[str, Any]
    """The configuration in plain types with every interpolation resolved: the content of
    `config.yaml` in a result folder, and the argument of `from_resolved`."""
    files: UserFiles = field(default_factory=UserFiles, compare=False, repr=False)
    """Opens what the configuration names."""

    def __repr__(self) -> str:
        return f"<Composition {' '.join(self.overrides) or 'of the defaults'}>"

    @property
    def keys(self) -> list[str]:
        """The keys and groups of the overrides."""
        return [split_override(text)[0] for text in self.overrides]

    @property
    def recording(self) -> "Recording | None":
        """The recording or the replayed motion, opened once; None without one."""
        configuration = self.configuration
        if isinstance(configuration.path, ReplayedPath):
            return self.files.open(configuration.path)
        if configuration.source.kind == "rendered":
            return None
        recording = self.files.open(configuration.source)
        parked = isinstance(configuration.ego, Parked)
        return replace(recording, pose_files=()) if parked else recording

    @property
    def scan_count(self) -> int:
        """Number K of scans: of the file, or duration / sample time, rounded, and at least one."""
        measurement, path = self.configuration.measurement, self.configuration.path
        if isinstance(measurement, FileParameters):
            return len(self.files.open(measurement))
        return max(1, round(path.duration / path.sample_time))

    def value(self, name: str) -> Any:
        """The chosen option of a group, or the value of a key in its own type; else KeyError."""
        if name in self.choices:
            return self.choices[name]
        value: Any = self.resolved
        for part in name.split("."):
            value = value[part]
        return value


def compose(overrides: Sequence[str] = (), working_directory: str = "") -> Composition:
    """The default configuration with `overrides`, in Hydra's grammar, as typed, applied.

    Overrides of a file need a `Composer`, which knows it. Relative file names refer to
    `working_directory`, by default that of the process. ConfigurationError in one line, for any
    fault of the overrides.
    """
    composition = Composer(working_directory).compose(read_overrides(overrides, TYPED))
    return replace(composition, resolved=copy.deepcopy(composition.resolved))


class Composer:
    """Composes configurations one after the other.

    Files of `conf/` and the user's own modules, which are imported to check their parameters unless
    `imports` is false, are taken as they were at first; each recording is opened once. Equal groups
    are one object, so that derived values can be cached by identity; do not change `resolved`,
    which they share too. Code that a file names is refused, see `Override.origin`.
    """

    def __init__(self, working_directory: str = "", imports: bool = True):
        self.working_directory, self.files, self._imports = working_directory, UserFiles(), imports
        folders.group_options.cache_clear()  # the files may have changed since, as in a notebook
        self._state = folders.conf_state()
        self._parts: dict[tuple[str, str], Any] = {}
        self._checked: dict[str, dict[str, dict[str, Any]]] = {}

    def compose(self, overrides: Sequence[Override]) -> Composition:
        """The same as the function `compose`."""
        parsed, settings = settings_of_run(overrides)
        user_defined = own_options.user_sections(settings)
        shipped = {
            k: v for k, v in settings.items() if folders.outermost_group(k) not in user_defined
        }
        # Values of other groups may refer to it.
        shipped |= {f"{group}.kind": "own" for group in user_defined}
        resolved, choices = self._with_recording(shipped)
        resolved |= user_defined
        choices |= {group: str(settings[group]) for group in user_defined}
        own_options.admit_code(resolved, parsed, folders.PRESETS.origin)
        metrics = resolved["metrics"]
        # The validation of the whole configuration reports another type.
        if isinstance(metrics, list) and not all(":" in str(name) for name in metrics):
            installed = folders.installed_functions("metrics")
            resolved["metrics"] = [installed.get(str(name), name) for name in metrics]
        resolved["code_folders"] = own_options.find_folders(resolved, self.working_directory)
        for group in _FILES:
            resolved[group] = with_full_names(group, resolved[group], self.working_directory)
        configuration = from_resolved(resolved, settings)
        if self._imports and own_options.functions_of(resolved):
            own = repr([resolved[n] for n in (*own_options.GIVEN, "metrics", "code_folders")])
            if own not in self._checked:
                self._checked[own] = own_options.check_parameters(configuration)
            for group, values in self._checked[own].items():
                resolved[group] = resolved[group] | values
                code = replace(getattr(configuration, group), parameters=values)
                configuration = replace(configuration, **{group: code})
        parts = {
            # Keyed by the text, because 0.0 and -0.0 are equal and give different cache keys.
            name: self._parts.setdefault((name, repr(value)), getattr(configuration, name))
            for name, value in resolved.items()
        }
        texts = tuple(override.text for override in parsed)
        return Composition(Configuration(**parts), choices, texts, resolved, self.files)

    def resolved(self, settings: Mapping[str, Any]) -> Resolved:
        """The configuration of settings; references are looked up, recordings not opened."""
        options = {
            name: value for name, value in settings.items() if name in folders.group_options()
        }
        values = {name: value for name, value in settings.items() if name not in options}
        plain, choices = compose_options(tuple(sorted(options.items())), self._state)
        resolved = with_values(plain, values)
        resolved.pop(folders.PACE)
        return resolved, dict(choices)

    def _with_recording(self, typed: Mapping[str, Any]) -> Resolved:
        """The same, completed by the recording, if there is one."""
        if not any(folders.outermost_group(name) == "source" for name in typed):
            resolved, choices = self.resolved(typed)
            if resolved["path"]["kind"] != "recorded":
                return resolved, choices
        # It reads files. Imported only here, because most runs have no recording.
        from stixel_cli.config.recorded import with_recording

        return with_recording(typed, self)


def with_full_names(
    group: str, section: Mapping[str, Any], working_directory: str = ""
) -> Mapping[str, Any]:
    """A resolved section in which the names of the user's files are absolute."""
    if own_options.is_own(section):
        return section
    words = {"road_user": not str(section.get("road_user")).endswith(".json")}
    words["calibration"] = section.get("calibration") in CALIBRATIONS
    full = {
        key: folders.absolute(section[key], working_directory)
        for key in _FILES[group]
        # The checks refuse an empty name.
        if isinstance(section.get(key), str) and section[key] and not words.get(key)
    }
    return {**section, **full} if full else section


def from_resolved(resolved: Mapping[str, Any], typed: Iterable[str] = ()) -> Configuration:
    """Validate the content of a `config.yaml`; ConfigurationError if it cannot be run.

    Of several faults it reports one of the keys `typed`, if there is one.
    """
    if not isinstance(resolved, Mapping):
        raise ConfigurationError(f"{messages.show(resolved)}: is not a configuration")
    plain = dict(resolved)
    for group in own_options.GIVEN:
        if own_options.is_own(plain.get(group)):
            plain[group] = own_options.nested(group, plain[group])
    return messages.read_settings(Configuration, plain, typed)
