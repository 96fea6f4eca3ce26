"""The group `experiment`: files that set options and values of several groups.

Hydra composes them. Two of their parts are not Hydra's: `inner_options` and `sources`, see
`conf/experiment/thesis.yaml`.
"""

import copy
from collections.abc import Mapping, Sequence
from typing import Any

from stixel_cli.config.folders import (
    EXPERIMENT,
    chosen_options,
    option_content,
    option_values,
)
from stixel_cli.config.keys import chosen_kinds, known_keys
from stixel_cli.errors import ConfigurationError

INNER, SOURCES = "inner_options", "sources"


def experiment_sources(option: str) -> dict[str, str]:
    """The sources that an experiment's file states: key or group to text, in the file's order."""
    return dict(option_content(EXPERIMENT, option).get(SOURCES, {}))


def set_by_experiment(option: str) -> dict[str, Any]:
    """The groups and keys that an experiment's file sets, with their options and values."""
    content = option_content(EXPERIMENT, option)
    values = option_values(EXPERIMENT, option)
    return {
        **content.get(INNER, {}),
        **chosen_options(content),
        **{name: v for name, v in values.items() if not name.startswith((INNER, SOURCES))},
    }


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
    return [
        f"{group}={option}"
        for group, option in inner.items()
        if group in choices and not any(text.startswith(f"{group}=") for text in chosen)
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
