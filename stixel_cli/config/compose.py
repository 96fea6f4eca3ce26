"""From overrides to a validated configuration, by Hydra and the schema."""

import copy
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from stixel_cli.config import messages
from stixel_cli.config.choose import choose, store_compositions
from stixel_cli.config.file_runs import implied_by_file
from stixel_cli.config.folders import (
    EXPERIMENT,
    absolute,
    conf_state,
    configuration_folder,
    group_options,
    own_presets,
)
from stixel_cli.config.interpolation import NotPlain, interpolated, with_values
from stixel_cli.config.keys import chosen_kinds, known_keys
from stixel_cli.config.overrides import check_one_run, check_overrides, parse_overrides
from stixel_cli.config.own_options import (
    GIVEN,
    check_parameters,
    find_folders,
    functions_of,
    is_own,
    nested,
    own_sections,
)
from stixel_cli.config.schema import Configuration, adapter
from stixel_cli.errors import BelongsElsewhere, ConfigurationError
from stixel_cli.files import read_yaml_text

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override


@dataclass(frozen=True)
class Composition:
    """A configuration and where it came from.

    Attributes:
        configuration: validated.
        choices: the option of each group.
        overrides: as they were typed.
        resolved: the configuration in plain types with every interpolation resolved: the content of
            `config.yaml` in a result folder, and the argument of `from_resolved`.
    """

    configuration: Configuration
    choices: dict[str, str]
    overrides: tuple[str, ...]
    resolved: dict[str, Any]

    def value(self, name: str) -> Any:
        """The chosen option of a group, or the value of a key in its own type.

        Raises:
            KeyError: no such group or key.
        """
        if name in self.choices:
            return self.choices[name]
        value: Any = self.resolved
        for part in name.split("."):
            value = value[part]
        return value


def compose(overrides: Sequence[str] = (), working_directory: str = "") -> Composition:
    """The default configuration with `overrides`, in Hydra's grammar, applied.

    It leaves no state in the process and may be called from anywhere, any number of times.

    Args:
        overrides: the changes.
        working_directory: the folder to which relative file names refer; "" for the working
            directory of the process.

    Raises:
        ConfigurationError: in one line, for any fault of the overrides.
    """
    composition = Composer(working_directory).compose(overrides)
    return replace(composition, resolved=copy.deepcopy(composition.resolved))


class Composer:
    """Composes configurations one after the other.

    Hydra composes each choice of options once; values are then set in plain dicts. The files of
    `conf/` are taken as they were when the composer was made. Equal groups of different
    configurations are one object, so that derived values can be cached by identity; do not change
    `resolved`, which they share too.
    `working_directory` is as in `compose`. The user's own modules are imported, to check their
    parameters, only if the overrides are `trusted`: not if a result folder gives them.
    """

    def __init__(self, working_directory: str = "", trusted: bool = True):
        self._trusted = trusted
        group_options.cache_clear()  # the files may have changed since, as in a notebook
        self._working_directory = working_directory
        self._state = conf_state()
        self._parsed: dict[str, Override] = {}
        self._parts: dict[tuple[str, str], Any] = {}

    def parse(self, text: str) -> "Override":
        """The parsed override; each text is parsed once.

        Raises:
            ConfigurationError: if the text is not a valid override.
        """
        if text not in self._parsed:
            (self._parsed[text],) = parse_overrides([text])
        return self._parsed[text]

    def compose(self, overrides: Sequence[str]) -> Composition:
        """The same as `compose(overrides, working_directory)`.

        Raises:
            ConfigurationError: in one line, for any fault of the overrides.
        """
        texts = tuple(overrides)
        parsed = [self.parse(text) for text in texts]
        check_overrides(parsed)
        check_one_run(parsed)
        parsed += [self.parse(text) for text in implied_by_file(parsed)]
        own = own_sections(parsed)
        others = [one for one in parsed if one.key_or_group.partition(".")[0] not in own]
        resolved, choices = self._with_recording(others)
        resolved |= own
        choices |= {one.key_or_group: str(one.value()) for one in parsed if one.key_or_group in own}
        resolved["code_folders"] = find_folders(resolved, self._working_directory)
        name_files_in_full(resolved, self._working_directory)
        configuration = _validate(resolved, [override.key_or_group for override in parsed])
        if self._trusted and functions_of(resolved):
            check_parameters(configuration)
        store_compositions()
        return Composition(self._shared(configuration, resolved), choices, texts, resolved)

    def _with_recording(self, parsed: "list[Override]") -> tuple[dict[str, Any], dict[str, str]]:
        """The resolved configuration and its choices, completed by its recording, if it has one."""
        typed = {one.key_or_group: one.value() for one in parsed}
        if not any(name.partition(".")[0] == "source" for name in typed):
            return self._with_replay(parsed, typed)
        # Reads and checks files; imported only here, because most runs have no recording.
        from stixel_cli.config import recorded
        from stixel_cli.config.experiments import set_by_experiment

        more = recorded.guessed_source(typed, self._working_directory)
        parsed = [*parsed, *map(self.parse, more)]
        # The other overrides may be of options that only the recording chooses.
        own = [one for one in parsed if one.key_or_group.partition(".")[0] == "source"]
        section = dict(_resolved(own, self._state)[0]["source"])
        recording = recorded.recording_in(section, typed, self._working_directory)
        if recording is None:
            return _resolved(parsed, self._state)
        preset = set_by_experiment(typed[EXPERIMENT]) if EXPERIMENT in typed else {}
        more = recorded.suitable_overrides(recording, typed, preset)
        resolved, choices = _resolved([*parsed, *map(self.parse, more)], self._state)
        resolved["source"] = section
        recorded.with_recording(resolved, choices, recording, typed)
        return resolved, choices

    def _with_replay(
        self, parsed: "list[Override]", typed: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, str]]:
        """The same of rendered images, completed by the files of the motion, if it has any."""
        resolved, choices = _resolved(parsed, self._state)
        if resolved["path"]["kind"] != "recorded":
            return resolved, choices
        # Reads and checks files; imported only here, because most runs have other paths.
        from stixel_cli.config import replayed

        section = dict(resolved["path"])
        replay = replayed.replay_in(section, typed, self._working_directory)
        if replay is None:
            # The duration, which only the files give, is not one of the faults.
            return resolved | {"path": section | {"duration": 1.0}}, choices
        more = replayed.suitable_overrides(replay, typed)
        resolved, choices = _resolved([*parsed, *map(self.parse, more)], self._state)
        resolved["path"] = section
        replayed.with_replay(resolved, choices, replay)
        return resolved, choices

    def _shared(self, configuration: Configuration, resolved: dict[str, Any]) -> Configuration:
        parts = {
            # Keyed by the text, because 0.0 and -0.0 are equal and give different cache keys.
            name: self._parts.setdefault((name, repr(value)), getattr(configuration, name))
            for name, value in resolved.items()
        }
        return Configuration(**parts)


def name_files_in_full(resolved: dict[str, Any], working_directory: str = "") -> None:
    """Make the names of the user's files absolute.

    They refer to `working_directory`; "" for the working directory of the process.
    """
    for group, key in (
        ("road_user", "mesh"),
        ("measurement", "path"),
        ("measurement", "ego"),
        ("measurement", "truth"),
        ("cache", "folder"),
    ):
        name = resolved[group].get(key)
        if resolved[group].get("kind") == "own":
            continue
        # The checks refuse an empty name.
        if isinstance(name, str) and name:
            resolved[group] = resolved[group] | {key: absolute(name, working_directory)}


def from_resolved(resolved: Mapping[str, Any]) -> Configuration:
    """Validate `resolved`, the content of a stored `config.yaml`.

    Raises:
        ConfigurationError: in one line, if it does not fit the schema or cannot be run.
    """
    if not isinstance(resolved, Mapping):
        raise ConfigurationError(f"{messages.show(resolved)}: is not a configuration")
    return _validate(dict(resolved), ())


def _validate(plain: dict[str, Any], typed: Iterable[str]) -> Configuration:
    from pydantic import ValidationError

    from stixel_cli.config.checks import check

    try:
        for group in GIVEN:
            if is_own(plain.get(group)):
                plain = plain | {group: nested(group, plain[group])}
        # Strict JSON validation fits YAML: it accepts lists for tuples and converts nothing else.
        configuration = adapter().validate_json(json.dumps(plain))
    except ValidationError as error:
        faults = error.errors(include_url=False)
        raise ConfigurationError(messages.describe_faults(faults, plain, typed)) from None
    except (TypeError, ValueError) as fault:
        raise ConfigurationError(
            f"the configuration has values that are not plain: {fault}"
        ) from None
    check(configuration)
    return configuration


def _resolved(parsed: "Sequence[Override]", state: str) -> tuple[dict[str, Any], dict[str, str]]:
    """The resolved configuration in plain types and the option of each group."""
    chosen = tuple(
        (one.key_or_group, str(one.input_line))
        for one in parsed
        if one.key_or_group in group_options()
    )
    values = [one for one in parsed if one.key_or_group not in group_options()]
    try:
        plain, choices = choose(chosen, state)
        try:
            new = {one.key_or_group: one.value() for one in values}
            tree = with_values(plain, new, _interpolated(chosen, state))
        except NotPlain:
            tree = _by_omegaconf(plain, values)
    except ConfigurationError:
        raise
    except Exception as fault:
        raise _explained(fault) from None
    return tree, dict(choices)


@lru_cache(maxsize=1024)
def _interpolated(chosen: tuple[tuple[str, str], ...], state: str) -> frozenset[str]:
    return interpolated(choose(chosen, state)[0])


def _explained(fault: Exception) -> Exception:
    """The error in one line if the files of `conf/` or the overrides are wrong; else itself."""
    # Hydra takes 0.2 s to import; a configuration without overrides may not need it.
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    if isinstance(fault, OmegaConfBaseException):
        return ConfigurationError(_unresolved(fault))
    if isinstance(fault, HydraException):
        return ConfigurationError(_not_composed(fault))
    if isinstance(fault, YAMLError | UnicodeDecodeError | RecursionError):
        # Hydra does not name the file in some of these.
        own = own_presets()
        folders = (configuration_folder(), *([] if own is None else [own]))
        for path in (path for folder in folders for path in sorted(folder.rglob("*.yaml"))):
            read_yaml_text(path)
        return ConfigurationError(messages.printable(" ".join(str(fault).split()), 300))
    return fault


def _by_omegaconf(plain: dict[str, Any], values: "Sequence[Override]") -> dict[str, Any]:
    """`plain` with the values set, resolved; it takes 8 ms, `with_values` a thirtieth of that."""
    from omegaconf import OmegaConf
    from omegaconf.errors import ConfigAttributeError, ConfigKeyError

    composed = OmegaConf.create(plain)
    OmegaConf.set_struct(composed, True)
    for override in values:
        name = override.key_or_group
        try:
            OmegaConf.update(composed, name, override.value(), merge=True)
        except (ConfigAttributeError, ConfigKeyError):
            # The schema knows the key, so it belongs to another variant of its group.
            raise BelongsElsewhere(messages.unknown_key(name, chosen_kinds(composed))) from None
    return OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)


def _not_composed(fault: Any) -> str:
    """One line for options that Hydra cannot compose.

    Typed options have been checked before: a missing option follows another group, as `pace` and
    `prior` follow `road_user`.
    """
    group, _, option = (getattr(fault, "missing_cfg_file", None) or "").rpartition("/")
    if group not in group_options():
        return _first_line(fault)
    return (
        f"{group}: unknown option {option!r}, which follows from what is chosen; add "
        f"conf/{group}/{option}.yaml, or choose {group}={'|'.join(group_options()[group])}"
    )


def _unresolved(fault: Any) -> str:
    """Message for an interpolation that cannot be resolved."""
    from omegaconf.errors import InterpolationKeyError, MissingMandatoryValue

    name = fault.full_key or "the configuration"
    if isinstance(fault, MissingMandatoryValue):
        return f"{name}: ??? is a missing value: give one"
    reason = _first_line(fault.msg or fault)
    if isinstance(fault, InterpolationKeyError) and (wanted := re.search("key '(.*)'", reason)):
        hint = messages.suggestion(wanted[1], known_keys(), form="${{{}}}")
        return f"{name}: refers to {wanted[1]}, an unknown key{hint}"
    return f"{name}: {reason}"


def _first_line(fault: Any) -> str:
    return messages.printable(
        (str(fault).splitlines() or ["no reason given"])[0], messages.LONGEST_REASON
    )
