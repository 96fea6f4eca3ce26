"""Words that a user types: overrides, split and written, and the names that a wrong one means.

No schema and no parser is imported.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from difflib import SequenceMatcher
from pathlib import PurePath
from typing import Any

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
            # Completion does not need the engine.
            from stixel_cli.engine.loaded_code import function_name

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
