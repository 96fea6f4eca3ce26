"""Options and metrics that are the user's own functions, `tracker=module:function`.

The other groups are options of files. The keys (`tracker.alpha=0.5`) are the function's parameters.
"""

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from importlib.machinery import PathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

from stixel_cli.border import Origin, admit
from stixel_cli.config.annotations import describe
from stixel_cli.config.folders import absolute, group_options, installed_functions
from stixel_cli.config.messages import show
from stixel_cli.config.schema import Configuration
from stixel_cli.config.texts import override_text, split_override
from stixel_cli.engine.cache_folder import CELLS
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.engine.versions import providers
from stixel_cli.errors import ConfigurationError, printable
from stixel_cli.own_code import OwnCode, all_values, check_name, parameters_type

if TYPE_CHECKING:
    from stixel_cli.config.overrides import Override

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
    found = [_folder_of(key, name, places) for key, name in functions_of(resolved).items()]
    return list(dict.fromkeys([*folders, *filter(None, found)]))


def _folder_of(key: str, function: str, places: Sequence[str]) -> str | None:
    """The folder of a function's module; None if a distribution provides it."""
    try:
        check_name(function)
    except ValueError as fault:
        raise ConfigurationError(f"{key}: {fault}") from None
    module = function.partition(":")[0]
    top = module.partition(".")[0]
    if top == __name__.partition(".")[0]:
        return None  # Of this program, also in its own checkout.
    local = next((place for place in places if _exists(place, top)), None)
    # Not as `find_spec`, which may answer with a module of the same name that is imported.
    spec = PathFinder.find_spec(top, [p for p in sys.path if p not in places])
    if spec is None and top in providers():
        with suppress(ImportError, ValueError):  # an editable install has its own finder
            spec = find_spec(top)
    where = None
    if spec is not None:
        first = next(iter(spec.submodule_search_locations or ()), spec.origin or "")
        where = str(Path(first).parent)
    taken = top in sys.stdlib_module_names or (top in providers() and where not in (None, local))
    fault = ""
    if local is not None and taken:
        name = f"{local} has a module {top}, but this is the name of an installed one"
        fault = f"{name}: rename the file"
    elif local is None and where is None:
        missing = f"no module {printable(top)} found in {places[-1]}"
        fault = f"{missing}, and no installed package has it"
    elif local is None and top not in providers():
        local = where
    if not fault and local is not None and not _exists(local, module):
        fault = f"no module {printable(module)} found in {local}"
    if fault:
        raise ConfigurationError(f"{key}: {fault}")
    return local


def _exists(folder: str, module: str) -> bool:
    path = Path(folder, *module.split("."))
    return path.is_dir() or path.with_name(f"{path.name}.py").is_file()


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


def imported_option(group: str, option: str) -> Any:
    """The user's function that an option names; ConfigurationError if it cannot be imported."""
    function = user_function(group, option)
    folder = _folder_of(group, function, [os.getcwd()])
    return _imported(group, function, [] if folder is None else [folder])


def check_parameters(configuration: Configuration) -> dict[str, dict[str, Any]]:
    """Import the user's functions, check their parameters, and return all values, by group.

    Raises:
        ConfigurationError: in one line that names the key, or the file and line of a fault.
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
            fault = error.errors(include_url=False)[0]
            name = ".".join(map(str, fault["loc"]))
            hints = get_type_hints(parameters_type(function, given), include_extras=True)
            what = "is missing" if fault["type"] == "missing" else show(fault["input"])
            text = f"unknown parameter; it has {', '.join(hints) or 'no parameters'}"
            if fault["loc"][0] in hints:
                text = f"{what}: must be {describe(hints[fault['loc'][0]])}"
            raise ConfigurationError(f"{group}.{name}: {text}") from None
        except (TypeError, ValueError) as fault:
            raise ConfigurationError(f"{group}.{' '.join(str(fault).split())}") from None
        values[group] = nested(group, checked)["parameters"]
    for i, name in enumerate(configuration.metrics):
        _imported(f"metrics[{i}]", name, folders)
    return values


def _imported(key: str, name: str, folders: Sequence[str]) -> Any:
    from stixel_cli.engine.errors import CodeChanged, StageFailure
    from stixel_cli.engine.loaded_code import current_function

    try:
        function = current_function(name, tuple(map(Path, folders)))
    except CodeChanged:
        raise
    except LookupError as fault:
        raise ConfigurationError(f"{key}: {' '.join(str(fault).split())}") from None
    except Exception as error:
        import traceback

        text = "".join(traceback.format_exception(error))
        failure = StageFailure(key, key, error, text)
        what = " ".join(f"{type(error).__name__}: {error}".split())
        if failure.place and not isinstance(error, SyntaxError):
            what += f" ({failure.place})"
        raise ConfigurationError(f"{key}: {name} cannot be imported: {what}") from None
    if not callable(function):
        raise ConfigurationError(f"{key}: {name} is not a function")
    return function
