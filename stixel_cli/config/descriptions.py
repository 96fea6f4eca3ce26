"""Meaning of groups and options, and their keys, for help and docs; see `keys.Key` for a key."""

import dataclasses
import inspect
import re
from itertools import takewhile
from typing import get_type_hints

from stixel_cli.config import keys
from stixel_cli.config.annotations import attribute_texts, describe
from stixel_cli.config.folders import (
    EXPERIMENT,
    PACE,
    default_option,
    group_options,
    innermost_group,
    option_file,
    option_values,
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
    return sorted(of_option, key=lambda key: key.place)


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
