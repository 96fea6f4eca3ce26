"""Meaning, unit, range and values of groups, options and keys, for help and docs.

The text is that of the schema's docstrings, the range that of its annotations, and the values those
of `conf/`: each is written in one place.
"""

import dataclasses
import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import takewhile
from typing import Any, get_type_hints

from stixel_cli.config import keys
from stixel_cli.config.folders import (
    EXPERIMENT,
    PACE,
    configuration_folder,
    default_option,
    group_options,
    innermost_group,
    option_file,
    option_values,
    options_of_kind,
)
from stixel_cli.config.own_options import GIVEN, imported_option
from stixel_cli.config.schema import Configuration
from stixel_cli.config.texts import value_text
from stixel_cli.files import read_text, read_yaml
from stixel_cli.own_code import parameters_type

_ENTRY = re.compile(r"^    (\w+(?:, \w+)*): ", re.MULTILINE)
_UNITS = (
    *("rad/s^1.5", "m/s^1.5", "px per px", "degrees/s", "m/s²", "m/s", "rad/s", "1/rad", "1/s"),
    *("1/m", "px²", "m²", "px", "m", "s", "rad", "degrees", "grey levels"),
)
_UNIT = re.compile(rf"(?:^|, )({'|'.join(map(re.escape, _UNITS))})(?=$|[.,;:])")


@dataclass(frozen=True)
class Description:
    """A key of one variant of its group.

    Attributes:
        name: with dots, as it is typed.
        belongs_to: the options that have it, as `tracker=gp_ekf`; () if its group has one variant.
        meaning: of the value, with its unit.
        unit: "" if the meaning names no unit.
        range: the valid values in words.
        values: option of the group to its value as it is typed; the default option comes first.
        followers: keys that have this key's value unless they are set.
    """

    name: str
    belongs_to: tuple[str, ...]
    meaning: str
    unit: str
    range: str
    values: dict[str, str]
    followers: tuple[str, ...]

    @property
    def default(self) -> str:
        """The value of the default option, or of the first option that has the key."""
        return next(iter(self.values.values()), "")


def describe_key(name: str) -> list[Description]:
    """The variants of a key, that of the default option first.

    Raises:
        KeyError: no such key.
    """
    found = [_described(key) for key in keys.known_keys()[name]]
    found = [one for one in found if one.values]  # a recording's path is not an option
    group = innermost_group(name)
    first = f"{group}={default_option(group)}" if group else ""
    return sorted(found, key=lambda one: first not in one.belongs_to)


def keys_of_option(group: str, option: str) -> list[Description]:
    """The keys that an option of a group has, without those of its inner groups."""
    kind = option_values(group, option).get("kind")
    of_option = [
        key
        for name, variants in keys.known_keys().items()
        if innermost_group(name) == group
        for key in variants
        if dict(key.owners).get(group, kind) == kind
    ]
    return [_described(key) for key in sorted(of_option, key=keys.place_in_class)]


def groups() -> list[str]:
    """The groups that are not inner ones, in the order of the schema."""
    order = [field.name for field in dataclasses.fields(Configuration)]
    return [name for name in [*order, PACE, EXPERIMENT] if name in group_options()]


def meaning_of_group(group: str) -> str:
    """What a group sets, in one line; "" for an inner group."""
    if group == EXPERIMENT:
        return "options and values of several groups under one name"
    if group == PACE:
        return (
            "speeds and first positions of a class of road user; its values are those of the paths"
        )
    return attribute_texts(Configuration).get(group, "")


def meaning_of_option(group: str, option: str) -> str:
    """What an option is: the first sentence of its file's comment, or of its class."""
    lines = read_text(option_file(group, option)).splitlines()
    lines = [line for line in lines if not line.startswith("# @package")]
    comment = [line[2:] for line in takewhile(lambda line: line.startswith("# "), lines)]
    text = " ".join(comment)
    if not comment:
        schema = keys.schema_of(group, option_values(group, option).get("kind", ""))
        text = inspect.getdoc(schema).splitlines()[0] if schema else ""
    return re.split(r"\.(?= [A-Z]|$)", text)[0].strip()


def parameters_of_own(group: str, option: str) -> list[tuple[str, str, str, str]]:
    """Key, default, range and meaning of each parameter of a user's function.

    Raises:
        ConfigurationError: in one line, if its module cannot be imported.
    """
    function, given = imported_option(group, option), GIVEN[group]
    schema = parameters_type(function, given)
    owner, given = (function, given) if schema is None else (schema, 0)
    hints = get_type_hints(owner, include_extras=True)
    texts = {} if schema is None else attribute_texts(schema)
    rows = []
    for name, one in list(inspect.signature(owner).parameters.items())[given:]:
        default = "required" if one.default is one.empty else str(one.default)
        words = keys.describe(hints[name]) if name in hints else ""
        rows.append((f"{group}.{name}", default, words, texts.get(name, "")))
    return rows


def settings_of_top() -> list[Description]:
    """The keys that are in no group, such as the seed."""
    return [_described(key) for name, (key, *_) in keys.known_keys().items() if "." not in name]


@cache
def attribute_texts(schema: type) -> dict[str, str]:
    """Field to its text in the section `Attributes` of the class or of one that it derives from."""
    texts: dict[str, str] = {}
    for one in reversed(schema.__mro__):
        section = (inspect.cleandoc(one.__doc__ or "")).partition("Attributes:\n")[2]
        section = section.partition("\n\n")[0]
        found = list(_ENTRY.finditer(section))
        ends = [after.start() for after in found[1:]] + [len(section)]
        for entry, end in zip(found, ends, strict=False):
            text = section[entry.end() : end]
            texts |= dict.fromkeys(entry[1].split(", "), " ".join(text.split()).rstrip("."))
    return texts


def _described(key: keys.Key) -> Description:
    group = innermost_group(key.name)
    field = key.name.rpartition(".")[2]
    kinds = dict(key.owners)
    options = _options(group, kinds.get(group))
    meaning = attribute_texts(key.schema).get(field, "")
    unit = _UNIT.search(meaning)
    return Description(
        name=key.name,
        belongs_to=tuple(
            f"{owner}={option}" for owner, kind in key.owners for option in _options(owner, kind)
        ),
        meaning=meaning,
        unit=unit[1] if unit else "",
        range=keys.describe(key.annotation),
        values={option: _value(key, group, option) for option in options} or _top_value(key),
        followers=tuple(_followers(key.name)),
    )


def _options(group: str, kind: str | None) -> list[str]:
    """The options of a group, only those of a `kind` if it is given; the default first."""
    if not group:
        return []
    found = group_options()[group] if kind is None else _of_kind(group, kind)
    return sorted(found, key=lambda option: option != default_option(group))


def _of_kind(group: str, kind: str) -> list[str]:
    found = [one for one in group_options()[group] if option_values(group, one).get("kind") == kind]
    return found or list(options_of_kind(group, kind))


def _value(key: keys.Key, group: str, option: str) -> str:
    """The value of a key in an option's file, or the schema's own default, as it is typed."""
    values = option_values(group, option)
    fields = {field.name: field.default for field in dataclasses.fields(key.schema)}
    default = fields[key.name.rpartition(".")[2]]
    value = values.get(key.name[len(group) + 1 :], default)
    return "" if value is dataclasses.MISSING else _typed(value)


def _top_value(key: keys.Key) -> dict[str, str]:
    content = read_yaml(configuration_folder() / "config.yaml")
    return {"": _typed(content[key.name])} if key.name in content else {}


def _typed(value: Any) -> str:
    """A value as one would type it; `that of prior.sigma_f` for an interpolation."""
    if isinstance(value, str) and (found := re.fullmatch(r"\$\{([\w.]+)\}", value)):
        return f"that of {found[1]}"
    return value_text(value)


def _followers(name: str) -> Iterator[str]:
    for group, options in group_options().items():
        if group == EXPERIMENT:
            continue
        found = [
            f"{group.replace('/', '.')}.{key}"
            for option in options
            for key, value in option_values(group, option).items()
            if f"${{{name}}}" in str(value)
        ]
        yield from dict.fromkeys(found)
