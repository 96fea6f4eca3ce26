"""Groups, options and keys for people and for editors: meanings, and JSON Schemas of the files.

In the schemas of the files of `conf/` and `pipelines/`, names, types, ranges and meanings are those
of the typed schema. A file may leave out keys, because others complete it, and may give an
interpolation, `${KEY}`, for any value.
"""

import dataclasses
import inspect
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import takewhile
from typing import Any, get_type_hints

from pydantic import TypeAdapter

from stixel_cli.config import keys
from stixel_cli.config.annotations import attribute_texts, classes_in, describe, fields_of
from stixel_cli.config.folders import (
    EXPERIMENT,
    PACE,
    default_option,
    group_options,
    innermost_group,
    option_file,
    option_values,
    shipped_folder,
)
from stixel_cli.config.own_options import GIVEN, imported_option
from stixel_cli.config.schema import Configuration
from stixel_cli.files import read_text
from stixel_cli.own_code import parameters_type

_NO_SCHEMA = {
    EXPERIMENT: "options and values of several groups under one name",
    PACE: "speeds and first positions of a class of road user; its values are those of the paths",
}


def describe_key(name: str) -> list[keys.Key]:
    """The variants of a key, that of the default option first; KeyError for another name."""
    group = innermost_group(name)
    first = f"{group}={default_option(group)}" if group else ""
    # A recording's path is not an option: it has no values.
    variants = [key for key in keys.known_keys()[name] if key.values]
    return sorted(variants, key=lambda key: first not in key.belongs_to)


def keys_of_option(group: str, option: str) -> list[keys.Key]:
    """The keys that an option of a group has, without those of its inner groups."""
    kind = option_values(group, option).get("kind")
    of_option = [
        key
        for name, variants in keys.known_keys().items()
        if innermost_group(name) == group
        for key in variants
        if dict(key.owners).get(group, kind) == kind
    ]
    return sorted(of_option, key=lambda key: list(fields_of(key.schema)).index(key.field))


def groups() -> list[str]:
    """The groups that are not inner ones, in the order of the schema."""
    order = [field.name for field in dataclasses.fields(Configuration)]
    return [name for name in [*order, PACE, EXPERIMENT] if name in group_options()]


def meaning_of_group(group: str) -> str:
    """What a group sets, in one line; "" for an inner group."""
    return (_NO_SCHEMA | attribute_texts(Configuration)).get(group, "")


def meaning_of_option(group: str, option: str) -> str:
    """What an option is: the first sentence of its file's comment, or of its class."""
    lines = read_text(option_file(group, option)).splitlines()
    lines = [line for line in lines if not line.startswith(("# @package", "# yaml-language"))]
    comment = [line[2:] for line in takewhile(lambda line: line.startswith("# "), lines)]
    text = " ".join(comment)
    if not comment:
        schema = keys.schema_of(group, option_values(group, option).get("kind", ""))
        text = inspect.getdoc(schema).splitlines()[0] if schema else ""
    return re.split(r"\.(?= [A-Z]|$)", text)[0].strip()


def parameters_of_own(group: str, option: str) -> list[tuple[str, str, str, str]]:
    """Key, default, range and meaning of each parameter of a user's function.

    ConfigurationError if its module cannot be imported.
    """
    function, given = imported_option(group, option), GIVEN[group]
    schema = parameters_type(function, given)
    owner, given = (function, given) if schema is None else (schema, 0)
    hints = get_type_hints(owner, include_extras=True)
    texts = {} if schema is None else attribute_texts(schema)
    rows = []
    for name, parameter in list(inspect.signature(owner).parameters.items())[given:]:
        required = parameter.default is parameter.empty
        default = "required" if required else str(parameter.default)
        words = describe(hints[name]) if name in hints else ""
        rows.append((f"{group}.{name}", default, words, texts.get(name, "")))
    return rows


def settings_of_top() -> list[keys.Key]:
    """The keys that are in no group, such as the seed."""
    return [key for name, (key, *_) in keys.known_keys().items() if "." not in name]


WRITTEN = ("pipeline", "recorded", "sequences", "study", "sweep")
"""Schemas that are written by hand, in `conf/schema`."""

_INTERPOLATION = {"type": "string", "pattern": r"\$\{.+\}"}
_WORDS = {"type": "object", "additionalProperties": {"type": "string"}}
_DEFAULTS = {"defaults": {"type": "array", "items": {"type": ["string", "object"]}}}


def schema_files() -> dict[str, str]:
    """Name of a file to its content: `GROUP.json`, `experiment.json`, `settings.json`, `WRITTEN`.

    The name of an inner group has a hyphen, `measurement-noise.json`. `settings.json` has the keys
    with dots of a command line; those that are `WRITTEN` refer to it.
    """
    whole = _section([Configuration])
    found: dict[str, Any] = {group: _options(group) for group in group_options()}
    found[PACE] = {"type": "object"}  # Options of paths refer to its values: they are in no class.
    parts = _DEFAULTS | {"inner_options": _WORDS, "sources": _WORDS}
    found[EXPERIMENT] = _object(whole["properties"] | parts)
    found["settings"] = {"$defs": _settings(dict(_flat(whole)))}
    folder = shipped_folder("conf") / "schema"
    return {f"{name}.json": read_text(folder / f"{name}.json") for name in WRITTEN} | {
        f"{name.replace('/', '-')}.json": json.dumps(schema, indent=1, ensure_ascii=False) + "\n"
        for name, schema in found.items()
    }


def _options(group: str) -> dict[str, Any]:
    """A schema of each variant of a group. What a run must give of a recording is null in `conf/`.

    An option may leave out its kind, if it derives from another by `defaults`.
    """
    classes = [Configuration]
    for part in group.split("/"):
        classes = [one for owner in classes for one in classes_in(fields_of(owner).get(part))]
    variants = [_section([one])["properties"] | _DEFAULTS for one in classes]
    null = [{"type": "null"}] if group in ("source", "path") else []
    return _any_of(_object({k: _any_of([v, *null]) for k, v in one.items()}) for one in variants)


def _settings(values: Mapping[str, Any]) -> dict[str, Any]:
    """The definition of each key and group, of `settings` with any of them, and of `axes`."""
    text = {"type": "string"}
    # Installed and own functions, and own presets, are options, too.
    groups = {name: _any_of([{"enum": [*one]}, text]) for name, one in group_options().items()}
    values = {**values, **groups}
    refer = {key: {"$ref": f"#/$defs/{key.replace('/', '-')}"} for key in values}
    axes = {key: _any_of([{"type": "array", "items": one}, text]) for key, one in refer.items()}
    named = {key.replace("/", "-"): one for key, one in values.items()}
    # A user's own tracker or source of measurements has keys of its own.
    own = {"patternProperties": {r"^(measurement|tracker)\.\w+$": {}}}
    return {"settings": _object(refer) | own, "axes": _object(axes) | own, **named}


def _section(variants: Iterable[type]) -> dict[str, Any]:
    """The object of the keys of all variants."""
    values: dict[str, list[Any]] = {}
    for variant in variants:
        for name, annotation in fields_of(variant).items():
            inner = classes_in(annotation)
            schema = _section(inner) if inner else _value(TypeAdapter(annotation).json_schema())
            text = attribute_texts(variant).get(name)
            if text:
                schema["description"] = text if inner else f"{text}: {describe(annotation)}"
            values.setdefault(name, []).append(schema)
    return _object({name: _any_of(options) for name, options in values.items()})


def _value(schema: Mapping[str, Any]) -> dict[str, Any]:
    """A schema that also accepts an interpolation, for the whole value and for its elements."""
    inner = {
        "items": lambda one: _value(one) if isinstance(one, dict) else one,
        "prefixItems": lambda options: [*map(_value, options)],
    }
    schema = {name: inner.get(name, lambda same: same)(one) for name, one in schema.items()}
    options = [_value(one) for one in schema.get("anyOf", ())] or [schema]
    return _any_of([*options, _INTERPOLATION])


def _object(properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": dict(properties), "additionalProperties": False}


def _any_of(options: Iterable[Any]) -> dict[str, Any]:
    """A schema of any of the options; equal ones once."""
    flat = [one for o in options for one in (o["anyOf"] if [*o] == ["anyOf"] else [o])]
    different = list({json.dumps(one): one for one in flat}.values())
    return different[0] if len(different) == 1 else {"anyOf": different}


def _flat(section: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The keys with dots of a section, with their schemas."""
    for name, one in section["properties"].items():
        if "properties" in one:
            yield from _flat(one, f"{prefix}{name}.")
        elif name != "kind":
            yield prefix + name, one
