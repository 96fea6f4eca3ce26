"""JSON Schemas, by which an editor completes and checks files of `conf/` and `pipelines/`.

Such a file may leave out keys, because others complete it, and may give an interpolation, `${KEY}`,
for any value.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from stixel_cli.border.files import read_text
from stixel_cli.config.annotations import classes_in, fields_of
from stixel_cli.config.folders import EXPERIMENT, PACE, group_options, shipped_folder
from stixel_cli.config.keys import Key, classes_of, known_keys
from stixel_cli.config.schema import Configuration

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
    found: dict[str, Any] = {group: _group_schema(group) for group in group_options()}
    found[PACE] = {"type": "object"}  # Options of paths refer to its values: they are in no class.
    parts = _DEFAULTS | {"inner_options": _WORDS, "sources": _WORDS}
    found[EXPERIMENT] = _object(whole["properties"] | parts)
    values = {name: _any_of(map(_key_schema, variants)) for name, variants in known_keys().items()}
    found["settings"] = {"$defs": _settings(values)}
    folder = shipped_folder("conf") / "schema"
    return {f"{name}.json": read_text(folder / f"{name}.json") for name in WRITTEN} | {
        f"{name.replace('/', '-')}.json": json.dumps(schema, indent=1, ensure_ascii=False) + "\n"
        for name, schema in found.items()
    }


def _group_schema(group: str) -> dict[str, Any]:
    """A schema of each variant of a group. What a run must give of a recording is null in `conf/`.

    An option may leave out its kind, if it derives from another by `defaults`.
    """
    variants = [_section([one])["properties"] | _DEFAULTS for one in classes_of(group)]
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
            inner, key = classes_in(annotation), Key(name, annotation, (), variant)
            text = {"description": key.meaning} if inner and key.meaning else {}
            schema = _section(inner) | text if inner else _key_schema(key)
            values.setdefault(name, []).append(schema)
    return _object({name: _any_of(options) for name, options in values.items()})


def _key_schema(key: Key) -> dict[str, Any]:
    from pydantic import TypeAdapter

    text = {"description": f"{key.meaning}: {key.range}"} if key.meaning else {}
    return _value(TypeAdapter(key.annotation).json_schema()) | text


def _value(schema: Mapping[str, Any]) -> dict[str, Any]:
    """A schema that also accepts an interpolation, for the whole value and for its elements."""
    schema = dict(schema)
    if isinstance(schema.get("items"), dict):
        schema["items"] = _value(schema["items"])
    if "prefixItems" in schema:
        schema["prefixItems"] = [*map(_value, schema["prefixItems"])]
    options = [*map(_value, schema.get("anyOf", ()))] or [schema]
    return _any_of([*options, _INTERPOLATION])


def _object(properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": dict(properties), "additionalProperties": False}


def _any_of(options: Iterable[Any]) -> dict[str, Any]:
    """A schema of any of the options; equal ones once."""
    flat = [one for o in options for one in (o["anyOf"] if [*o] == ["anyOf"] else [o])]
    different = list({json.dumps(one): one for one in flat}.values())
    return different[0] if len(different) == 1 else {"anyOf": different}
