"""Values of a configuration in one spelling, so that equal settings make equal keys."""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from hashlib import sha256
from typing import Any


def canonical(value: Any) -> Any:
    """`value` as a JSON tree that spells type and content, floats to the last bit.

    Dataclasses carry their type's name; 1, 1.0 and True differ, as do 0.0 and -0.0, a list and a
    tuple.

    Raises:
        TypeError: a value of a type that has no canonical spelling.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return {"float": repr(float(value))}
    if isinstance(value, list | tuple):
        return {type_name(value): [canonical(item) for item in value]}
    if is_dataclass(value) and not isinstance(value, type):
        content = {field.name: canonical(getattr(value, field.name)) for field in fields(value)}
        return {type_name(value): content}
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {"mapping": {key: canonical(value[key]) for key in sorted(value)}}
    raise TypeError(f"a setting of type {type(value).__name__} cannot be part of a key: {value!r}")


def type_name(value: Any) -> str:
    """Module and name of a value's type; the bare name of a built-in one."""
    kind = type(value)
    module = "" if kind.__module__ == "builtins" else f"{kind.__module__}."
    return f"{module}{kind.__qualname__}"


def settings_types(value: Any) -> set[type]:
    """The dataclasses that `value` is made of, at any depth."""
    if is_dataclass(value) and not isinstance(value, type):
        inner = [settings_types(getattr(value, field.name)) for field in fields(value)]
        return {type(value)}.union(*inner)
    if isinstance(value, list | tuple):
        return set().union(*map(settings_types, value))
    if isinstance(value, Mapping):
        return set().union(*map(settings_types, value.values()))
    return set()


def digest(tree: Any) -> str:
    """SHA-256, in hex, of a JSON tree."""
    text = json.dumps(tree, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return sha256(text.encode()).hexdigest()
