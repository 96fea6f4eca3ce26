"""Meaning, unit, range and values of groups, options and keys, for help and docs.

The text is that of the schema's docstrings, the range that of its annotations, and the values those
of `conf/`: each is written in one place.
"""

import dataclasses
import inspect
import re
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
    options_default_first,
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


_NO_SCHEMA = {
    EXPERIMENT: "options and values of several groups under one name",
    PACE: "speeds and first positions of a class of road user; its values are those of the paths",
}


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
    variants = [_described(key) for key in keys.known_keys()[name]]
    group = innermost_group(name)
    first = f"{group}={default_option(group)}" if group else ""
    # A recording's path is not an option: it has no values.
    return sorted(filter(lambda v: v.values, variants), key=lambda v: first not in v.belongs_to)


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
    return (_NO_SCHEMA | attribute_texts(Configuration)).get(group, "")


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
    for name, parameter in list(inspect.signature(owner).parameters.items())[given:]:
        required = parameter.default is parameter.empty
        default = "required" if required else str(parameter.default)
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
    for base in reversed(schema.__mro__):
        section = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")[2]
        _, *parts = _ENTRY.split(section.partition("\n\n")[0])
        for names, text in zip(parts[::2], parts[1::2], strict=True):
            texts |= dict.fromkeys(names.split(", "), " ".join(text.split()).rstrip("."))
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
        values=_values(key, group, options),
        followers=tuple(_followers(key.name)),
    )


def _options(group: str, kind: str | None) -> list[str]:
    """The options of a group, only those of a `kind` if it is given; the default first."""
    options = options_default_first(group) if group else []
    if kind is None:
        return options
    of_kind = [name for name in options if option_values(group, name).get("kind") == kind]
    return of_kind or list(options_of_kind(group, kind))


def _values(key: keys.Key, group: str, options: list[str]) -> dict[str, str]:
    """Option to the value of a key, as typed: that of its file, or the schema's own default."""
    if not group:
        content = read_yaml(configuration_folder() / "config.yaml")
        return {"": _typed(content[key.name])} if key.name in content else {}
    default = key.schema.__dataclass_fields__[key.name.rpartition(".")[2]].default
    name = key.name[len(group) + 1 :]
    values = {option: option_values(group, option).get(name, default) for option in options}
    return {
        option: "" if value is dataclasses.MISSING else _typed(value)
        for option, value in values.items()
    }


def _typed(value: Any) -> str:
    """A value as one would type it; `that of prior.sigma_f` for an interpolation."""
    if isinstance(value, str) and (reference := re.fullmatch(r"\$\{([\w.]+)\}", value)):
        return f"that of {reference[1]}"
    return value_text(value)


def _followers(name: str) -> list[str]:
    followers = [
        f"{group.replace('/', '.')}.{key}"
        for group, options in group_options().items()
        if group != EXPERIMENT
        for option in options
        for key, value in option_values(group, option).items()
        if f"${{{name}}}" in str(value)
    ]
    return list(dict.fromkeys(followers))
