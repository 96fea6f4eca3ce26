"""The keys, groups and options: meaning, unit, range and values.

A text is that of the schema's docstrings, a range that of its annotations, and a value that of
`conf/`: each is written in one place.
"""

import dataclasses
import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import takewhile
from typing import Any

from stixel_cli.border.files import read_text
from stixel_cli.config.annotations import (
    alternatives,
    attribute_texts,
    classes_in,
    describe,
    element,
    fields_of,
    kinds_of,
)
from stixel_cli.config.folders import (
    EXPERIMENT,
    PACE,
    default_option,
    group_options,
    innermost_group,
    option_file,
    option_values,
    options_of_kind,
    values_beside_groups,
)
from stixel_cli.config.schema import Configuration
from stixel_cli.config.texts import value_text

_NO_SCHEMA = {
    EXPERIMENT: "options and values of several groups under one name",
    PACE: "speeds and first positions of a class of road user; its values are those of the paths",
}


@dataclass(frozen=True)
class Key:
    """A key of the schema, of one variant of its group."""

    name: str
    """With dots, as it is typed."""
    annotation: Any
    """The type with its range."""
    owners: tuple[tuple[str, str], ...]
    """The variants that have it, as (group, kind), the outer group first; () if none of its groups
    has variants."""
    schema: type
    """The class that has it."""

    def fits(self, kinds: Mapping[str, str]) -> bool:
        """Whether the chosen kinds of groups are those of a variant that has it."""
        return all(kinds.get(group) == kind for group, kind in self.owners)

    @property
    def field(self) -> str:
        """Its name in its class."""
        return self.name.rpartition(".")[2]

    @property
    def belongs_to(self) -> list[str]:
        """The options that have it, as `tracker=gp_ekf`; empty if its group has one variant."""
        return [f"{g}={option}" for g, kind in self.owners for option in options_of_kind(g, kind)]

    @property
    def meaning(self) -> str:
        """What the value is, with its unit."""
        return attribute_texts(self.schema).get(self.field, "")

    @property
    def range(self) -> str:
        """The valid values in words."""
        return describe(self.annotation)

    @property
    def values(self) -> dict[str, str]:
        """Option of the group to its value as it is typed; the default option comes first.

        It is that of the option's file, or the schema's own default.
        """
        group = innermost_group(self.name)
        if not group:
            top = values_beside_groups("config")
            return {"": _typed(top[self.name])} if self.name in top else {}
        default = self.schema.__dataclass_fields__[self.field].default
        name = self.name[len(group) + 1 :]
        values = {
            option: option_values(group, option).get(name, default)
            for option in options_of_kind(group, dict(self.owners).get(group))
        }
        return {o: "" if v is dataclasses.MISSING else _typed(v) for o, v in values.items()}

    @property
    def default(self) -> str:
        """The value of the default option, or of the first option that has the key."""
        return next(iter(self.values.values()), "")

    @property
    def followers(self) -> list[str]:
        """The keys that have this key's value unless they are set."""
        followers = {
            f"{group.replace('/', '.')}.{name}": None
            for group, options in group_options().items()
            for option in options * (group != EXPERIMENT)
            for name, value in option_values(group, option).items()
            if f"${{{self.name}}}" in str(value)
        }
        return [*followers]


def _typed(value: Any) -> str:
    """A value as one would type it; `0.6, from prior.sigma_f` for one that another key gives."""
    reference = re.fullmatch(r"\$\{([\w.]+)\}", str(value))
    if reference is None:
        return value_text(value)
    group = innermost_group(reference[1])
    values = option_values(group, default_option(group)) if group else {}
    # A user's own preset may refer to anything.
    found = values.get(reference[1][len(group) + 1 :], "${")
    known = "${" not in str(found)
    return f"{value_text(found)}, from {reference[1]}" if known else f"that of {reference[1]}"


@cache
def known_keys() -> dict[str, tuple[Key, ...]]:
    """Every key that takes a value, by name, with the variants of its groups that have it.

    Groups are not keys. Nor are their `kind`s, which follow from the chosen option.
    """
    keys: dict[str, tuple[Key, ...]] = {}
    for key in _walk(Configuration):
        keys[key.name] = (*keys.get(key.name, ()), key)
    return keys


def _walk(
    schema: type, prefix: str = "", owners: tuple[tuple[str, str], ...] = ()
) -> Iterator[Key]:
    """The keys of a schema."""
    for name, annotation in fields_of(schema).items():
        variants = classes_in(annotation)
        group = (prefix + name).replace(".", "/")
        several = [(one, kind) for one in variants for kind in kinds_of(one)]
        for variant, kind in several if len(variants) > 1 else [(one, "") for one in variants]:
            of_variant = (*owners, (group, kind)) if kind else owners
            yield from _walk(variant, f"{prefix}{name}.", of_variant)
        if not variants and name != "kind":
            yield Key(prefix + name, annotation, owners, schema)


def classes_of(group: str) -> list[type]:
    """The classes of the parameters of a group's variants; [] for a group without a schema."""
    classes = [Configuration]
    for part in group.split("/"):
        classes = [one for owner in classes for one in classes_in(fields_of(owner).get(part))]
    return classes


def chosen_kinds(plain: Any, prefix: str = "") -> dict[str, str]:
    """The kind of each group of a configuration in plain types, by the group's name."""
    kinds: dict[str, str] = {}
    for name, section in plain.items():
        if isinstance(section, Mapping):
            if isinstance(section.get("kind"), str):
                kinds[prefix + name] = section["kind"]
            kinds |= chosen_kinds(section, f"{prefix}{name}/")
    return kinds


def locate(path: tuple[str | int, ...]) -> tuple[str, Any]:
    """The name and annotation of the key at pydantic's location `path`; None if it is unknown.

    Pydantic names the variant of a union within the location: `("path", "turn", "speed")`.
    """
    annotation, name = Configuration, ""
    for part in path:
        schemas = classes_in(annotation)
        of_kind = [schema for schema in schemas if part in kinds_of(schema)]
        if isinstance(part, int):
            name, annotation = f"{name}[{part}]", element(annotation, part)
        elif len(schemas) > 1 and (of_kind or part == "own"):
            # The user's own code shares its keys with the others.
            annotation = of_kind[0] if of_kind else annotation
        elif schemas or len(alternatives(annotation)) == 1:  # Else a member of a union of types.
            name = f"{name}.{part}" if name else part
            annotation = next((fields_of(s)[part] for s in schemas if part in fields_of(s)), None)
    return name, annotation


def describe_key(name: str) -> list[Key]:
    """The variants of a key, that of the default option first; KeyError for another name."""
    group = innermost_group(name)
    first = f"{group}={default_option(group)}" if group else ""
    # A recording's path is not an option: it has no values.
    variants = [key for key in known_keys()[name] if key.values]
    return sorted(variants, key=lambda key: first not in key.belongs_to)


def keys_of_option(group: str, option: str) -> list[Key]:
    """The keys that an option of a group has, without those of its inner groups."""
    kind = option_values(group, option).get("kind")
    variants = [key for keys in known_keys().values() for key in keys]
    of_group = [key for key in variants if innermost_group(key.name) == group]
    of_option = [key for key in of_group if dict(key.owners).get(group, kind) == kind]
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
        kind = option_values(group, option).get("kind")
        schemas = [one for one in classes_of(group) if kind in (kinds_of(one) or [kind])]
        text = inspect.getdoc(schemas[0]).splitlines()[0] if schemas else ""
    return re.split(r"\.(?= [A-Z]|$)", text)[0].strip()


def settings_of_top() -> list[Key]:
    """The keys that are in no group, such as the seed."""
    return [key for name, (key, *_) in known_keys().items() if "." not in name]
