"""The user's functions as values of settings: "module:function", those of a notebook in a file."""

import inspect
import symtable
from collections.abc import Callable
from hashlib import sha256
from textwrap import dedent
from types import ModuleType
from typing import Any

from stixel_cli.border import write_whole
from stixel_cli.engine.cache_folder import CELLS, make_folder
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.errors import ConfigurationError


def function_name(function: Callable[..., Any]) -> str:
    """The "module:function" of a function, for settings such as `tracker`.

    A worker cannot import a notebook or a script, so such a function is written to a module in the
    cache folder, with what it uses of the notebook: functions, imports and plain values.

    Raises:
        ConfigurationError: for a function that no module can have.
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
