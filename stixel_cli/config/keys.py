"""The keys of the schema, with a description of their valid values."""

import dataclasses
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Interval, Le, Len, Lt, MaxLen, MinLen, MultipleOf

from stixel_cli.config.schema import Configuration
from stixel_cli.own_code import OwnCode


@dataclass(frozen=True)
class Key:
    """A key of the schema.

    Attributes:
        name: with dots, as it is typed.
        annotation: the type with its range.
        owners: the variants that have it, as (group, kind), the outer group first; () if none of
            its groups has variants.
        schema: the class that has it.
    """

    name: str
    annotation: Any
    owners: tuple[tuple[str, str], ...]
    schema: type


@cache
def known_keys() -> dict[str, tuple[Key, ...]]:
    """Every key that takes a value, by name, with the variants of its groups that have it.

    Groups are not keys. Nor are their `kind`s, which follow from the chosen option.
    """
    keys: dict[str, list[Key]] = {}
    for key in _walk(Configuration):
        if not dataclasses.is_dataclass(key.annotation):
            keys.setdefault(key.name, []).append(key)
    return {name: tuple(variants) for name, variants in keys.items()}


def _walk(
    schema: type, prefix: str = "", owners: tuple[tuple[str, str], ...] = ()
) -> Iterator[Key]:
    """The keys of a schema, and the variants of its groups with their classes as annotations."""
    for name, annotation in _fields(schema).items():
        variants = _dataclasses(annotation)
        for variant in variants:
            kind = kind_of(variant) if len(variants) > 1 else None
            group = (prefix + name).replace(".", "/")
            of_variant = owners if kind is None else (*owners, (group, kind))
            yield Key(prefix + name, variant, of_variant, schema)
            yield from _walk(variant, f"{prefix}{name}.", of_variant)
        if not variants and name != "kind":
            yield Key(prefix + name, annotation, owners, schema)


def place_in_class(key: Key) -> int:
    """The place of a key among the fields of its class."""
    return list(_fields(key.schema)).index(key.name.rpartition(".")[2])


@cache
def schema_of(group: str, kind: str) -> type | None:
    """The class of the parameters of a group's variant; None for a group without a schema."""
    classes = {
        dict(key.owners).get(group, ""): key.annotation
        for key in _walk(Configuration)
        if key.name.replace(".", "/") == group and dataclasses.is_dataclass(key.annotation)
    }
    return classes.get(kind) or classes.get("")


def chosen_kinds(plain: Any, prefix: str = "") -> dict[str, str]:
    """The kind of each group of a configuration in plain types, by the group's name."""
    kinds: dict[str, str] = {}
    for name, section in plain.items():
        if isinstance(section, Mapping):
            if isinstance(section.get("kind"), str):
                kinds[prefix + name] = section["kind"]
            kinds |= chosen_kinds(section, f"{prefix}{name}/")
    return kinds


@cache
def _fields(schema: type) -> dict[str, Any]:
    hints = get_type_hints(schema, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(schema)}


def _bare(annotation: Any) -> Any:
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    return annotation


def _alternatives(annotation: Any) -> list[Any]:
    """The members of a union, each with its annotation; for another type, only itself."""
    bare = _bare(annotation)
    if get_origin(bare) in (Union, types.UnionType):
        return [leaf for member in get_args(bare) for leaf in _alternatives(member)]
    return [annotation]


def _dataclasses(annotation: Any) -> list[type]:
    members = [_bare(member) for member in _alternatives(annotation)]
    # The keys of the user's own code are not known here.
    return [m for m in members if dataclasses.is_dataclass(m) and not issubclass(m, OwnCode)]


def kind_of(schema: type) -> str | None:
    """The kind of a variant; None if the class has several kinds or none."""
    annotation = _fields(schema).get("kind")
    values = get_args(_bare(annotation)) if annotation is not None else ()
    return values[0] if len(values) == 1 else None


def locate(path: tuple[str | int, ...]) -> tuple[str, Any]:
    """The name and annotation of the key at pydantic's location `path`; None if it is unknown.

    Pydantic names the variant of a union within the location: `("path", "turn", "speed")`.
    """
    annotation: Any = Configuration
    name = ""
    for part in path:
        schemas = _dataclasses(annotation)
        variants = [schema for schema in schemas if kind_of(schema) == part]
        if len(schemas) > 1 and variants:
            annotation = variants[0]
            continue
        if len(schemas) > 1 and part == "own":
            continue  # The keys that the user's own code shares with the others.
        if isinstance(part, int):
            name += f"[{part}]"
            annotation = _element(annotation, part)
        elif not schemas and len(_alternatives(annotation)) > 1:
            continue  # A member of a union of plain types.
        else:
            name += f".{part}" if name else part
            fields = [_fields(schema)[part] for schema in schemas if part in _fields(schema)]
            annotation = fields[0] if fields else None
    return name, annotation


def _element(annotation: Any, index: int) -> Any:
    for member in _alternatives(annotation):
        arguments = get_args(_bare(member))
        if get_origin(_bare(member)) is tuple:
            return (
                arguments[0]
                if arguments[-1] is Ellipsis or index >= len(arguments)
                else (arguments[index])
            )
    return None


def choices(annotation: Any) -> tuple[str, ...]:
    """The valid words of a key; () if it does not take words."""
    members = map(_bare, _alternatives(annotation))
    return tuple(str(w) for t in members if get_origin(t) is Literal for w in get_args(t))


def describe(annotation: Any) -> str:
    """The valid values of a key in words: `a number > 0 and ≤ 5, or null`."""
    return ", or ".join(_describe_one(member) for member in _alternatives(annotation))


def _describe_one(annotation: Any) -> str:
    bare = _bare(annotation)
    if bare is type(None):
        return "null"
    if dataclasses.is_dataclass(bare):
        return "a group of keys: " + ", ".join(_fields(bare))
    if get_origin(bare) is Literal:
        return "one of " + ", ".join(str(word) for word in get_args(bare))
    limits = bounds(annotation)
    if get_origin(bare) is tuple:
        arguments = get_args(bare)
        if arguments[-1] is Ellipsis:
            words = f"a list, each {_describe_one(arguments[0])}"
        else:
            words = f"[{', '.join(_describe_one(argument) for argument in arguments)}]"
        return f"{words} ({limits} of them)" if limits else words
    names = {int: "a whole number", float: "a number", bool: "true or false", str: "text"}
    words = names.get(bare, str(bare))
    return f"{words} {limits}" if limits else words


_LIMITS = {
    Gt: "> {0.gt}",
    Ge: "≥ {0.ge}",
    MinLen: "≥ {0.min_length}",
    Lt: "< {0.lt}",
    Le: "≤ {0.le}",
    MaxLen: "≤ {0.max_length}",
    MultipleOf: "a multiple of {0.multiple_of}",
}


def bounds(annotation: Any) -> str:
    """The range of one annotation in words, `> 0 and ≤ 5`; empty if it has no limits."""
    metadata = get_args(annotation)[1:] if get_origin(annotation) is Annotated else ()
    words: dict[type, str] = {}
    for entry in metadata:
        for limit in entry if isinstance(entry, Interval | Len) else (entry,):
            if type(limit) in _LIMITS and limit != MinLen(0):
                words[type(limit)] = _LIMITS[type(limit)].format(limit)
    return " and ".join(words[kind] for kind in _LIMITS if kind in words)
