"""The group `experiment`: files that set options and values of several groups.

Hydra composes them. Two of their parts are not Hydra's: `inner_options` and `sources`, see
`conf/experiment/thesis.yaml`.
"""

import copy
from collections.abc import Mapping, Sequence
from typing import Any

from stixel_cli.config.folders import EXPERIMENT, option_file
from stixel_cli.config.keys import chosen_kinds, known_keys
from stixel_cli.errors import ConfigurationError
from stixel_cli.files import read_yaml

INNER, SOURCES = "inner_options", "sources"


def experiment_sources(option: str) -> dict[str, str]:
    """The sources that an experiment's file states: key or group to text, in the file's order."""
    content = read_yaml(option_file(EXPERIMENT, option))
    return dict((content or {}).get(SOURCES, {}))


def set_by_experiment(option: str) -> dict[str, Any]:
    """The groups and keys that an experiment's file sets, with their options and values."""
    content = read_yaml(option_file(EXPERIMENT, option)) or {}
    found = dict(content.get(INNER, {}))
    for entry in content.get("defaults", ()):
        if isinstance(entry, Mapping):
            found |= {name.removeprefix("override").strip(" /"): entry[name] for name in entry}
    pending = {name: content[name] for name in content if name not in ("defaults", INNER, SOURCES)}
    while pending:
        name, value = pending.popitem()
        if isinstance(value, Mapping):
            pending |= {f"{name}.{key}": inner for key, inner in value.items()}
        else:
            found[name] = value
    return found


def missing_options(
    plain: Mapping[str, Any], choices: Mapping[str, str], chosen: Sequence[str]
) -> list[str]:
    """The overrides of inner groups that an experiment wants and that are not in `chosen`.

    Groups that the chosen options lack are left out.

    Raises:
        ConfigurationError: if the experiment's `inner_options` are not pairs.
    """
    inner = plain.get(INNER, {})
    if not isinstance(inner, Mapping):
        raise ConfigurationError(
            f"{EXPERIMENT}={choices[EXPERIMENT]}: {INNER}: must be GROUP: OPTION pairs"
        )
    typed = {text.partition("=")[0] for text in chosen}
    return [
        f"{group}={option}"
        for group, option in inner.items()
        if group in choices and group not in typed
    ]


def without_other_options(plain: Mapping[str, Any]) -> dict[str, Any]:
    """`plain` without the values of an experiment whose keys the chosen options do not have."""
    rest = copy.deepcopy(
        {name: value for name, value in plain.items() if name not in (INNER, SOURCES)}
    )
    kinds = chosen_kinds(rest)
    for name, variants in known_keys().items():
        if not any(all(kinds.get(g) == kind for g, kind in one.owners) for one in variants):
            _remove(rest, name.split("."))
    return rest


def _remove(section: Any, parts: list[str]) -> None:
    """Remove a key, and the sections that are empty without it."""
    if isinstance(section, dict) and parts[0] in section:
        if parts[1:]:
            _remove(section[parts[0]], parts[1:])
        if not parts[1:] or section[parts[0]] == {}:
            section.pop(parts[0])
