"""Options of tracker and measurement, and metrics, that are the user's own functions.

They are given as `tracker=module:function`; the function's parameters are keys of the group.
"""

import inspect
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

from stixel_cli.border.origins import Origin, admit
from stixel_cli.border.own_code import OwnCode, all_values, parameters_type
from stixel_cli.config import messages
from stixel_cli.config.annotations import attribute_texts, describe
from stixel_cli.config.folders import absolute, group_options, installed_functions
from stixel_cli.config.texts import override_text, split_override
from stixel_cli.engine.cache_folder import CELLS
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.engine.versions import folder_of
from stixel_cli.errors import ConfigurationError

if TYPE_CHECKING:
    from stixel_cli.config.overrides import Override
    from stixel_cli.config.schema import Configuration

GIVEN = {"tracker": 3, "measurement": 2}
"""Groups whose option can be a function, with its number of arguments before its parameters."""

RESERVED = ("kind", "function")

_RUN_CODE = ("metrics", "code_folders", "cache.folder", "executor.address")
"""Keys whose values can run code: a cache holds pickles, a scheduler sends them."""

COMMON = {"measurement": {"dropout": None, "clutter_rate": 0.0}}
"""Keys that every option of a group has, with their values if they are not typed."""


def user_function(group: str, option: Any) -> str | None:
    """The "module:function" of an option that is the user's own; None for another option."""
    if group not in GIVEN or not isinstance(option, str) or option in group_options()[group]:
        return None
    return option if ":" in option else installed_functions(group).get(option)


def user_sections(settings: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The user-defined sections of a configuration with these options and values, by group."""
    sections = {}
    for group in GIVEN:
        if function := user_function(group, settings.get(group)):
            within = f"{group}."
            given = {k.removeprefix(within): v for k, v in settings.items() if k.startswith(within)}
            sections[group] = {"kind": "own", "function": function} | COMMON.get(group, {}) | given
    return sections


def nested(group: str, section: Mapping[str, Any]) -> dict[str, Any]:
    """A section of the user's own as `OwnCode` has it: the parameters in a mapping of their own."""
    known = (*RESERVED, *COMMON.get(group, ()))
    rest = {name: value for name, value in section.items() if name not in known}
    return {name: section[name] for name in known if name in section} | {"parameters": rest}


def is_own(section: Any) -> bool:
    """Whether a section of a configuration in plain types is the user's own."""
    return isinstance(section, Mapping) and section.get("kind") == "own"


def functions_of(resolved: Mapping[str, Any]) -> dict[str, str]:
    """The user's functions that a configuration in plain types names: key to "module:function"."""
    functions = {g: str(resolved[g].get("function")) for g in GIVEN if is_own(resolved.get(g))}
    metrics = resolved.get("metrics")
    names = enumerate(metrics if isinstance(metrics, list) else ())
    return functions | {f"metrics[{i}]": str(name) for i, name in names}


def admit_overrides(parsed: "Iterable[Override]") -> dict[str, Origin]:
    """`border.admit` the values of overrides that can run code; returns their origins by key."""
    own = [o for o in parsed if o.key in _RUN_CODE or user_function(o.key, o.value)]
    admit((f"{one.key}={one.value}", one.origin) for one in own if one.value)
    return {one.key: one.origin for one in own}


def admit_code(resolved: Mapping[str, Any], given: "Iterable[Override]", other: Origin) -> None:
    """`border.admit` what a configuration in plain types names that can run code.

    An override is the origin of its very key only, and of a group if its option is a function; all
    else comes from `other`: options of presets, or a result folder.
    """
    origins = admit_overrides(given)
    names = functions_of(resolved)
    for key in _RUN_CODE[1:]:
        group, _, name = key.partition(".")
        names[key] = resolved[group].get(name) if name else resolved[group]
    admit(
        (f"{key}={value}", other)
        for key, value in names.items()
        if value and key.partition("[")[0] not in origins
    )


def find_folders(resolved: Mapping[str, Any], working_directory: str) -> list[str]:
    """The folders of the user's modules, those of `code_folders` first; nothing is imported.

    ConfigurationError if a module is missing, or has the name of another one.
    """
    given = resolved["code_folders"]
    if not isinstance(given, list):
        return given  # The validation of the whole configuration reports it.
    folders = [absolute(str(folder), working_directory) for folder in given]
    places = [*folders, str(default_cache_folder() / CELLS), absolute("", working_directory)]
    found = [folder_of(key, name, places) for key, name in functions_of(resolved).items()]
    return list(dict.fromkeys([*folders, *filter(None, found)]))


def with_own_values(overrides: Sequence[str], resolved: Mapping[str, Any]) -> tuple[str, ...]:
    """The overrides with all parameters of the user's functions, whose defaults may change."""
    typed = {split_override(text)[0] for text in overrides}
    more = [
        override_text(f"{group}.{name}", value)
        for group in GIVEN
        if is_own(resolved[group])
        for name, value in nested(group, resolved[group])["parameters"].items()
        if f"{group}.{name}" not in typed
    ]
    return (*overrides, *more)


def parameters_of_own(group: str, option: str) -> list[tuple[str, str, str, str]]:
    """Key, default, range and meaning of each parameter of the user's function of an option.

    ConfigurationError if its module cannot be imported.
    """
    name, given = user_function(group, option), GIVEN[group]
    folder = folder_of(group, name, [os.getcwd()])
    function = _imported(group, name, [] if folder is None else [folder])
    schema = parameters_type(function, given)
    owner, given = (function, given) if schema is None else (schema, 0)
    hints = get_type_hints(owner, include_extras=True)
    texts = {} if schema is None else attribute_texts(schema)
    rows = []
    for name, parameter in list(inspect.signature(owner).parameters.items())[given:]:
        required = parameter.default is parameter.empty
        default = "required" if required else str(parameter.default)
        words = describe(hints[name]) if name in hints else ""
        rows.append((f"{group}.{name}", default, words, texts.get(name, "")))
    return rows


def check_parameters(configuration: "Configuration") -> dict[str, dict[str, Any]]:
    """Import the user's functions, check their parameters, and return all values, by group.

    ConfigurationError in one line that names the key, or the file and line of a fault.
    """
    from pydantic import ValidationError

    folders, values = configuration.code_folders, {}
    for group, given in GIVEN.items():
        code = getattr(configuration, group)
        if not isinstance(code, OwnCode):
            continue
        function = _imported(group, code.function, folders)
        try:
            checked = all_values(function, given, code.parameters)
        except ValidationError as error:
            hints = get_type_hints(parameters_type(function, given), include_extras=True)
            fault = error.errors(include_url=False)[0]
            key, annotation = ".".join(map(str, fault["loc"])), hints.get(fault["loc"][0])
            text = messages.describe_fault(fault, f"{group}.{key}", annotation)
            text += "" if annotation else f"; it has {', '.join(hints) or 'no parameters'}"
            raise ConfigurationError(text) from None
        except (TypeError, ValueError) as fault:
            raise ConfigurationError(f"{group}.{' '.join(str(fault).split())}") from None
        values[group] = nested(group, checked)["parameters"]
    for i, name in enumerate(configuration.metrics):
        _imported(f"metrics[{i}]", name, folders)
    return values


def _imported(key: str, name: str, folders: Sequence[str]) -> Any:
    from stixel_cli.engine.errors import CodeChanged
    from stixel_cli.engine.loaded_code import current_function

    try:
        function = current_function(name, tuple(map(Path, folders)))
    except CodeChanged:
        raise
    except LookupError as fault:
        raise ConfigurationError(f"{key}: {' '.join(str(fault).split())}") from None
    except Exception as error:
        what = messages.named_fault(error)
        raise ConfigurationError(f"{key}: {name} cannot be imported: {what}") from None
    if not callable(function):
        raise ConfigurationError(f"{key}: {name} is not a function")
    return function
