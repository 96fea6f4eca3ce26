"""The annotations of the schema's classes: their fields, variants and valid values in words.

And values in plain types read as such a class. Neither the schema nor Hydra is imported.
"""

import dataclasses
import inspect
import json
import re
import types
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Interval, Le, Len, Lt, MaxLen, MinLen, MultipleOf

from stixel_cli.border.own_code import OwnCode

_ENTRY = re.compile(r"^    (\w+(?:, \w+)*): ", re.MULTILINE)


@cache
def fields_of(schema: type) -> dict[str, Any]:
    """Field to annotation of a class of parameters."""
    hints = get_type_hints(schema, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(schema)}


def _bare(annotation: Any) -> Any:
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    return annotation


def alternatives(annotation: Any) -> list[Any]:
    """The members of a union, each with its annotation; for another type, only itself."""
    bare = _bare(annotation)
    if get_origin(bare) in (Union, types.UnionType):
        return [leaf for member in get_args(bare) for leaf in alternatives(member)]
    return [annotation]


def classes_in(annotation: Any) -> list[type]:
    """The classes of parameters that an annotation allows; the user's own code is none."""
    members = [_bare(member) for member in alternatives(annotation)]
    return [m for m in members if dataclasses.is_dataclass(m) and not issubclass(m, OwnCode)]


def kinds_of(schema: type) -> tuple[str, ...]:
    """The kinds of a variant; () for a class without a `kind`."""
    return get_args(_bare(fields_of(schema).get("kind")))


@cache
def attribute_texts(schema: type) -> dict[str, str]:
    """Field to its text in the section `Attributes` of the class or of one that it derives from."""
    texts: dict[str, str] = {}
    for base in reversed(schema.__mro__):
        section = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")[2]
        _, *parts = _ENTRY.split(section.partition("\n\n")[0])
        for names, text in zip(parts[::2], parts[1::2], strict=True):
            texts |= dict.fromkeys(names.split(", "), " ".join(text.split()).rstrip("."))
    return texts


def element(annotation: Any, index: int) -> Any:
    """The annotation of an element of a tuple; None if the annotation is not of a tuple."""
    for member in alternatives(annotation):
        arguments = get_args(_bare(member))
        if get_origin(_bare(member)) is tuple:
            one = arguments[-1] is Ellipsis or index >= len(arguments)
            return arguments[0 if one else index]
    return None


def choices(annotation: Any) -> tuple[str, ...]:
    """The valid words of a key; () if it does not take words."""
    members = map(_bare, alternatives(annotation))
    return tuple(str(w) for t in members if get_origin(t) is Literal for w in get_args(t))


def describe(annotation: Any) -> str:
    """The valid values of a key in words: `a number > 0 and ≤ 5, or null`."""
    members = alternatives(annotation)
    if len(classes_in(annotation)) > 1:
        return "a group of keys"  # The kind decides which.
    if len(members) > 1:
        return ", or ".join(map(describe, members))
    bare = _bare(annotation)
    if bare is type(None):
        return "null"
    if dataclasses.is_dataclass(bare):
        return "a group of keys: " + ", ".join(fields_of(bare))
    if get_origin(bare) is Literal:
        return "one of " + ", ".join(str(word) for word in get_args(bare))
    limits = _bounds(annotation)
    if get_origin(bare) is tuple:
        first, *others = get_args(bare)
        if others[-1:] == [Ellipsis]:
            words = f"a list, each {describe(first)}"
        else:
            words = f"[{', '.join(map(describe, (first, *others)))}]"
        return f"{words} ({limits} of them)" if limits else words
    names = {int: "a whole number", float: "a number", bool: "true or false", str: "text"}
    return f"{names.get(bare, bare)} {limits}".rstrip()


_LIMITS = {
    Gt: "> {0.gt}",
    Ge: "≥ {0.ge}",
    MinLen: "≥ {0.min_length}",
    Lt: "< {0.lt}",
    Le: "≤ {0.le}",
    MaxLen: "≤ {0.max_length}",
    MultipleOf: "a multiple of {0.multiple_of}",
}


def _bounds(annotation: Any) -> str:
    """The range of one annotation in words, `> 0 and ≤ 5`; empty if it has no limits."""
    metadata = get_args(annotation)[1:] if get_origin(annotation) is Annotated else ()
    words: dict[type, str] = {}
    for entry in metadata:
        for limit in entry if isinstance(entry, Interval | Len) else (entry,):
            if type(limit) in _LIMITS and limit != MinLen(0):
                words[type(limit)] = _LIMITS[type(limit)].format(limit)
    return " and ".join(words[kind] for kind in _LIMITS if kind in words)


@cache
def _adapter(kind: Any) -> Any:
    """Pydantic's validator of a class, built once per process."""
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def read_as(kind: Any, content: Any) -> Any:
    """Values in plain types as the class of parameters `kind`, which its `check` accepts.

    pydantic.ValidationError for values that do not fit, a ValueError; see `first_fault`. TypeError,
    ValueError for values that are not plain; of the class's `check`.
    """
    # As JSON, because strict validation of Python values takes only finished objects: of JSON it
    # accepts lists for tuples, and converts nothing else.
    valid = _adapter(kind).validate_json(json.dumps(content))
    if hasattr(valid, "check"):
        valid.check()
    return valid


def plain_fault(fault: Mapping[str, Any]) -> str:
    """One of pydantic's errors in plain words, to follow the name of the entry."""
    words = {"missing": "is missing", "unexpected_keyword_argument": "is unknown"}
    return words.get(fault["type"], re.sub("^(Input|String) should", "must", fault["msg"]))


def first_fault(error: Any) -> tuple[str, str, bool]:
    """Of a `ValidationError`: the entry's name, the fault in words, and if the name is unknown.

    An unknown name, which explains a missing one, comes first.
    """
    unexpected = "unexpected_keyword_argument"
    fault = min(error.errors(include_url=False), key=lambda one: one["type"] != unexpected)
    got = "" if fault["type"] in ("missing", unexpected) else f", got {fault['input']!r}"
    name = ".".join(map(str, fault["loc"]))
    return name, plain_fault(fault) + got, fault["type"] == unexpected
