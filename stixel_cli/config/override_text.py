"""An override as one would type it, from a key and a plain value."""

import re
from typing import Any

_PLAIN_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
_WORDS_WITH_MEANING = {"null", "true", "false", "nan", "inf"}


def override_text(name: str, value: Any) -> str:
    """The override that gives the key or group `name` a plain value, as one would type it."""
    return f"{name}={_value_text(value)}"


def _value_text(value: Any) -> str:
    from hydra.core.override_parser.types import Quote, QuotedString

    match value:
        case None:
            return "null"
        case bool():
            return str(value).lower()
        case str():
            if _PLAIN_WORD.fullmatch(value) and value.lower() not in _WORDS_WITH_MEANING:
                return value
            return QuotedString(text=value, quote=Quote.single).with_quotes()
        case list():
            return f"[{','.join(map(_value_text, value))}]"
        case dict():
            return "{" + ",".join(f"{key}:{_value_text(item)}" for key, item in value.items()) + "}"
    return str(value)
