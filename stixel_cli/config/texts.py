"""The text of an override: split, and written; no schema and no parser is imported."""

import re
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


def value_text(value: Any) -> str:
    """A plain value as one would type it."""
    match value:
        case None:
            return "null"
        case bool():
            return str(value).lower()
        case str():
            if _PLAIN_WORD.fullmatch(value) and value.lower() not in _WORDS_WITH_MEANING:
                return value
            from hydra.core.override_parser.types import Quote, QuotedString

            return QuotedString(text=value, quote=Quote.single).with_quotes()
        case list():
            return f"[{','.join(map(value_text, value))}]"
        case dict():
            return "{" + ",".join(f"{key}:{value_text(item)}" for key, item in value.items()) + "}"
    return str(value)
