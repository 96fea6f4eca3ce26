"""From overrides to a validated configuration, by Hydra and the rooms' schemas."""

import copy
import json
import os
import re
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from stixel_cli.config import messages
from stixel_cli.config.folders import conf_state, configuration_folder, group_options
from stixel_cli.config.keys import chosen_kinds, known_keys
from stixel_cli.config.overrides import check_one_run, check_overrides, parse_overrides
from stixel_cli.config.schema import Configuration, adapter
from stixel_cli.errors import BelongsElsewhere, ConfigurationError
from stixel_cli.files import read_yaml_text

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override
    from omegaconf import DictConfig

# Hydra's composition goes through a singleton of the process.
_HYDRA = threading.Lock()


@dataclass(frozen=True)
class Composition:
    """A configuration and where it came from.

    Attributes:
        configuration: validated.
        choices: the option of each group.
        overrides: as they were typed.
        resolved: the configuration in plain types with every interpolation resolved; what
            `config.yaml` of a result folder holds, and `from_resolved` takes.
    """

    configuration: Configuration
    choices: dict[str, str]
    overrides: tuple[str, ...]
    resolved: dict[str, Any]

    def value(self, name: str) -> Any:
        """The option chosen of a group, or the value of a key, of its own type.

        Raises:
            KeyError: there is neither.
        """
        if name in self.choices:
            return self.choices[name]
        value: Any = self.resolved
        for part in name.split("."):
            value = value[part]
        return value


def compose(overrides: Sequence[str] = (), working_directory: str = "") -> Composition:
    """The default configuration with `overrides`, in Hydra's grammar, applied.

    Nothing stays behind in the process, so it can be called from anywhere, any number of times.

    Args:
        overrides: the changes.
        working_directory: in which names of files are meant that are relative; "" for the
            process's own.

    Raises:
        ConfigurationError: in one line, for whatever is wrong with the overrides.
    """
    texts = tuple(overrides)
    group_options.cache_clear()  # a notebook lives longer than the files stay as they are
    parsed = parse_overrides(texts)
    check_overrides(parsed)
    check_one_run(parsed)
    resolved, choices = _compose(parsed)
    name_files_in_full(resolved, working_directory)
    typed = [override.key_or_group for override in parsed]
    return Composition(_validate(resolved, typed), choices, texts, resolved)


def name_files_in_full(resolved: dict[str, Any], working_directory: str = "") -> None:
    """Make the names of the user's files absolute, so that they hold in any working directory.

    `working_directory` is the one in which they are meant; "" for the process's own.
    """
    for group, key in (("road_user", "mesh"), ("cache", "folder")):
        name = resolved[group][key]
        # An empty name is no folder: the checks will say so.
        if isinstance(name, str) and name:
            name = os.path.join(working_directory, os.path.expanduser(name))
            resolved[group] = resolved[group] | {key: os.path.abspath(name)}


def from_resolved(resolved: Mapping[str, Any]) -> Configuration:
    """The configuration that `resolved`, the content of a stored `config.yaml`, stands for.

    Raises:
        ConfigurationError: in one line, if it does not fit the schema or cannot be run.
    """
    if not isinstance(resolved, Mapping):
        raise ConfigurationError(f"{messages.show(resolved)}: is no configuration")
    return _validate(dict(resolved), ())


def _validate(plain: dict[str, Any], typed: Iterable[str]) -> Configuration:
    from pydantic import ValidationError

    from stixel_cli.config.checks import check

    try:
        # JSON is the strict mode that fits YAML: lists stand for tuples, and nothing else bends.
        configuration = adapter().validate_json(json.dumps(plain))
    except ValidationError as error:
        faults = error.errors(include_url=False)
        raise ConfigurationError(messages.describe_faults(faults, plain, typed)) from None
    except (TypeError, ValueError) as fault:
        raise ConfigurationError(
            f"the configuration holds more than plain values: {fault}"
        ) from None
    check(configuration)
    return configuration


def _compose(parsed: "Sequence[Override]") -> tuple[dict[str, Any], dict[str, str]]:
    """The resolved configuration in plain types and the option of each group."""
    from hydra.errors import HydraException
    from omegaconf import OmegaConf
    from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException
    from yaml import YAMLError

    chosen = tuple(str(one.input_line) for one in parsed if one.key_or_group in group_options())
    try:
        base, choices = _choose(chosen, conf_state())
        composed = copy.deepcopy(base)
        for override in parsed:
            name = override.key_or_group
            if name in group_options():
                continue
            try:
                OmegaConf.update(composed, name, override.value(), merge=True)
            except (ConfigAttributeError, ConfigKeyError):
                # The schema knows the key, so it belongs to another variant of its group.
                raise BelongsElsewhere(messages.unknown_key(name, chosen_kinds(composed))) from None
        plain = OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as fault:
        raise ConfigurationError(_unresolved(fault)) from None
    except HydraException as fault:
        raise ConfigurationError(_not_composed(fault)) from None
    except (YAMLError, UnicodeDecodeError, RecursionError) as fault:
        # Hydra names the file in some of these alone.
        for path in sorted(configuration_folder().rglob("*.yaml")):
            read_yaml_text(path)
        raise ConfigurationError(messages.printable(" ".join(str(fault).split()), 300)) from None
    return plain, dict(choices)


@lru_cache(maxsize=64)
def _choose(chosen: tuple[str, ...], state: tuple[Any, ...]) -> "tuple[DictConfig, dict[str, str]]":
    """The options of all groups put together by Hydra, and which they are.

    It takes a tenth of a second, however few keys differ between two configurations, so it is
    kept as long as the files of `conf/` keep their `state`.
    """
    import hydra
    from omegaconf import open_dict

    folder = str(configuration_folder())
    with (
        _HYDRA,
        _no_hydra_of_others(),
        hydra.initialize_config_dir(folder, job_name="stixel", version_base="1.3"),
    ):
        composed = hydra.compose("config", overrides=list(chosen), return_hydra_config=True)
        options = dict(composed.hydra.runtime.choices)
    with open_dict(composed):
        del composed["hydra"]
    return composed, {group: options[group] for group in group_options() if group in options}


@contextmanager
def _no_hydra_of_others() -> Iterator[None]:
    """Hydra's singleton empty, and as it was afterwards: a notebook may have its own."""
    from hydra.core.global_hydra import GlobalHydra

    theirs = GlobalHydra.instance().hydra
    GlobalHydra.instance().clear()
    try:
        yield
    finally:
        GlobalHydra.instance().hydra = theirs


def _not_composed(fault: Any) -> str:
    """One line for what Hydra cannot put together.

    An option that was typed has been checked before: one that is missing here follows another
    group's, as `pace` and `prior` follow `road_user`.
    """
    group, _, option = (getattr(fault, "missing_cfg_file", None) or "").rpartition("/")
    if group not in group_options():
        return _first_line(fault)
    return (
        f"{group}: there is no option {option!r}, which follows from what is chosen; add "
        f"conf/{group}/{option}.yaml, or choose {group}={'|'.join(group_options()[group])}"
    )


def _unresolved(fault: Any) -> str:
    """One line for a value that stands for another which cannot be had."""
    from omegaconf.errors import InterpolationKeyError, MissingMandatoryValue

    name = fault.full_key or "the configuration"
    if isinstance(fault, MissingMandatoryValue):
        return f"{name}: ??? stands for a missing value: give one"
    reason = _first_line(fault.msg or fault)
    if isinstance(fault, InterpolationKeyError) and (wanted := re.search("key '(.*)'", reason)):
        hint = messages.suggestion(wanted[1], known_keys(), form="${{{}}}")
        return f"{name}: there is no key {wanted[1]} to take the value of{hint}"
    return f"{name}: {reason}"


def _first_line(fault: Any) -> str:
    return messages.printable(
        (str(fault).splitlines() or ["no reason given"])[0], messages.LONGEST_REASON
    )
