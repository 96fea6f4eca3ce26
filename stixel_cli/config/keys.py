"""The keys of the schema, with a description of their valid values."""

import dataclasses
import types
from collections.abc import Mapping
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
    _collect(Configuration, "", (), keys)
    return {name: tuple(variants) for name, variants in keys.items()}


def _collect(
    schema: type, prefix: str, owners: tuple[tuple[str, str], ...], keys: dict[str, list[Key]]
) -> None:
    for name, annotation in _fields(schema).items():
        variants = _dataclasses(annotation)
        for variant in variants:
            kind = kind_of(variant) if len(variants) > 1 else None
            own = () if kind is None else (((prefix + name).replace(".", "/"), kind),)
            _collect(variant, f"{prefix}{name}.", (*owners, *own), keys)
        if not variants and name != "kind":
            key = Key(prefix + name, annotation, owners, schema)
            keys.setdefault(prefix + name, []).append(key)


def place_in_class(key: Key) -> int:
    """The place of a key among the fields of its class."""
    return list(_fields(key.schema)).index(key.name.rpartition(".")[2])


@cache
def schemas() -> dict[tuple[str, str], type]:
    """Group and kind to the class of the group's parameters; the kind is "" for a single class."""
    found: dict[tuple[str, str], type] = {}
    pending = [("", Configuration)]
    while pending:
        prefix, schema = pending.pop()
        for name, annotation in _fields(schema).items():
            variants = _dataclasses(annotation)
            for variant in variants:
                kind = (kind_of(variant) or "") if len(variants) > 1 else ""
                found[prefix + name, kind] = variant
                pending.append((f"{prefix}{name}/", variant))
    return found


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
    return [
        one for one in members if dataclasses.is_dataclass(one) and not issubclass(one, OwnCode)
    ]


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
    words: list[str] = []
    for member in _alternatives(annotation):
        if get_origin(_bare(member)) is Literal:
            words += [str(word) for word in get_args(_bare(member))]
    return tuple(words)


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


def bounds(annotation: Any) -> str:
    """The range of one annotation in words, `> 0 and ≤ 5`; empty if it has no limits."""
    lower = upper = step = ""
    metadata = get_args(annotation)[1:] if get_origin(annotation) is Annotated else ()
    for limit in _single_limits(metadata):
        match limit:
            case Gt(gt=value):
                lower = f"> {value}"
            case Ge(ge=value):
                lower = f"≥ {value}"
            case MinLen(min_length=value):
                lower = f"≥ {value}" if value else ""
            case Lt(lt=value):
                upper = f"< {value}"
            case Le(le=value):
                upper = f"≤ {value}"
            case MaxLen(max_length=value):
                upper = f"≤ {value}"
            case MultipleOf(multiple_of=value):
                step = f"a multiple of {value}"
    return " and ".join(part for part in (lower, upper, step) if part)


def _single_limits(metadata):
    for limit in metadata:
        if isinstance(limit, Interval | Len):
            yield from limit
        else:
            yield limit
