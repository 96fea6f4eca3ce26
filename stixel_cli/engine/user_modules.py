"""The user's modules: the folder of each, and modules that are written from a notebook."""

import inspect
import symtable
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from hashlib import sha256
from importlib.machinery import PathFinder
from importlib.util import find_spec
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any

from stixel_cli.border import write_whole
from stixel_cli.engine.cache_folder import CELLS, make_folder
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.engine.versions import providers
from stixel_cli.errors import ConfigurationError, located, printable
from stixel_cli.own_code import check_name


def folder_of(key: str, function: str, places: Sequence[str]) -> str | None:
    """The folder of a function's module, one of `places` first; None if a distribution provides it.

    Nothing is imported. ConfigurationError, which begins with the `key` that names the function, if
    the module is missing, or has the name of another one.
    """
    with located(key, ConfigurationError):
        check_name(function)
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
    if local is not None and taken:
        name = f"{local} has a module {top}, but this is the name of an installed one"
        raise ConfigurationError(f"{key}: {name}: rename the file")
    if local is None and where is None:
        missing = f"no module {printable(top)} found in {places[-1]}"
        raise ConfigurationError(f"{key}: {missing}, and no installed package has it")
    if local is None and top not in providers():
        local = where
    if local is not None and not _exists(local, module):
        raise ConfigurationError(f"{key}: no module {printable(module)} found in {local}")
    return local


def _exists(folder: str, module: str) -> bool:
    path = Path(folder, *module.split("."))
    return path.is_dir() or path.with_name(f"{path.name}.py").is_file()


def function_name(function: Callable[..., Any]) -> str:
    """The "module:function" of a function, for settings such as `tracker`.

    A worker cannot import a notebook or a script, so such a function is written to a module in the
    cache folder, with what it uses of the notebook: functions, imports and plain values.
    ConfigurationError for a function that no module can have.
    """
    module, name = function.__module__, getattr(function, "__qualname__", "")
    if not name.isidentifier():
        shown = name or type(function).__name__
        raise ConfigurationError(f"{shown}: must be a function with a name, not inside of another")
    if module == "__main__":
        sources: dict[str, str] = {}
        _add(name, function, inspect.unwrap(function).__globals__, sources)
        text = "\n\n".join(["# From a notebook or a script.", *sources.values()])
        module = f"{name}_{sha256(text.encode()).hexdigest()[:8]}"
        write_whole(make_folder(default_cache_folder(), CELLS) / f"{module}.py", text)
    return f"{module}:{name}"


def _add(name: str, value: Any, names: dict[str, Any], sources: dict[str, str]) -> None:
    """Add the source of `value`, after those of all that it uses of `names`."""
    if name in sources:
        return
    sources[name] = ""
    if isinstance(value, ModuleType):
        source = f"import {value.__name__} as {name}"
    elif value is None or isinstance(value, bool | int | float | str):
        source = f"{name} = {value!r}"
    elif not hasattr(value, "__qualname__"):
        kind = type(value).__name__
        raise ConfigurationError(f"{name}: is a {kind} of the notebook: make it in the function")
    elif value.__module__ != "__main__":
        source = f"from {value.__module__} import {value.__qualname__} as {name}"
    else:
        try:
            source = dedent(inspect.getsource(value))
        except (OSError, TypeError):
            raise ConfigurationError(f"{name}: has no source: import it from a file") from None
        for used in sorted(_global_names(symtable.symtable(source, name, "exec"))):
            if used in names:
                _add(used, names[used], names, sources)
    sources[name] = sources.pop(name) or source


def _global_names(table: symtable.SymbolTable) -> set[str]:
    """The names that a module's source takes from outside of its functions."""
    own = {
        s.get_name() for s in table.get_symbols() if table.get_type() == "module" or s.is_global()
    }
    return own.union(*map(_global_names, table.get_children()))
