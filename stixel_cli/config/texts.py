"""Words that a user types: overrides, split and written, and the names that a wrong one means.

No schema and no parser is imported.
"""

import inspect
import re
import symtable
from collections.abc import Callable, Iterable, Mapping
from difflib import SequenceMatcher
from hashlib import sha256
from pathlib import PurePath
from textwrap import dedent
from types import ModuleType
from typing import Any

from stixel_cli.errors import ConfigurationError

_PLAIN_WORD = re.compile(r"[A-Za-z_/][A-Za-z0-9_./-]*|0[0-9]+")
_WORDS_WITH_MEANING = {"null", "true", "false", "nan", "inf"}


def split_override(text: str) -> tuple[str, str]:
    """The key and the value of an override's text, without checks; ("key", "") without a value."""
    key, _, value = text.partition("=")
    return key.strip().lstrip("+~").strip(), value.strip()


def override_text(name: str, value: Any) -> str:
    """The override that gives the key or group `name` a plain value, as one would type it."""
    return f"{name}={value_text(value)}"


def mapping_texts(settings: Mapping[str, Any], within: str = "") -> list[str]:
    """The overrides that a mapping of keys or groups to values stands for.

    Values may be mappings again: {"path": {"duration": 1}} is "path.duration=1". A text is taken as
    typed. A tuple and a range are several values of a sweep; a list is one value. A function is an
    option of the user's own, also one of a notebook, see `function_name`.
    """
    texts: list[str] = []
    for name, value in settings.items():
        if isinstance(value, Mapping):
            texts += mapping_texts(value, f"{within}{name}.")
        else:
            values = value if isinstance(value, tuple | range) else (value,)
            typed = (one if isinstance(one, str) else value_text(one) for one in values)
            texts.append(f"{within}{name}={','.join(typed)}")
    return texts


def value_text(value: Any) -> str:
    """A plain value as one would type it."""
    match value:
        case PurePath():
            return value_text(str(value))
        case _ if callable(value):
            return function_name(value)
        case None:
            return "null"
        case bool():
            return str(value).lower()
        case str():
            if _PLAIN_WORD.fullmatch(value) and value.lower() not in _WORDS_WITH_MEANING:
                return value
            if not {"'", "\\"}.intersection(value):
                return f"'{value}'"  # Hydra takes 0.2 s to import.
            from hydra.core.override_parser.types import Quote, QuotedString

            return QuotedString(text=value, quote=Quote.single).with_quotes()
        case list():
            return f"[{','.join(map(value_text, value))}]"
        case dict():
            return "{" + ",".join(f"{key}:{value_text(item)}" for key, item in value.items()) + "}"
    return str(value)


LONGEST = 100
"""Characters of a word that are compared; the time is quadratic."""

LEAST_LIKENESS = 0.65
"""Names are suggested from this likeness on: of `rnu` and `run`, not of `version` and `verify`."""


def likeness(word: str, name: str) -> float:
    """How likely `word` means `name`, 0 … 1.

    The letters count, a whole word of the name (`rig.fov`), or its first word (`range_deviation`);
    of names with dots those of the last parts, because people forget or mistake the group.
    """
    group, _, last = word.lower().rpartition(".")
    outer, _, inner = name.lower().rpartition(".")
    last, words = last if outer else word.lower(), inner.split("_")
    alike = SequenceMatcher(None, last, inner).ratio()
    if last in words:
        alike = max(alike, 0.8)
    elif last.partition("_")[0] == words[0]:
        alike = max(alike, 0.7)
    if not (group and outer):
        return 0.95 * alike if outer else alike
    return 0.8 * alike + 0.2 * SequenceMatcher(None, group, outer).ratio()


def suggestion(word: str, names: Iterable[str], shown: Callable[[str], str] = str) -> str:
    """`; did you mean …?` for the names that are most like `word`; empty if none is like it."""
    scores = {name: likeness(word[:LONGEST], name) for name in names}
    best = max(scores.values(), default=0.0)
    near = [name for name, score in scores.items() if score == best >= LEAST_LIKENESS]
    return f"; did you mean {' or '.join(map(shown, near[:4]))}?" if near else ""


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
        # Completion needs neither border nor engine.
        from stixel_cli.border import write_whole
        from stixel_cli.engine.cache_folder import CELLS, make_folder
        from stixel_cli.engine.parameters import default_cache_folder

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
