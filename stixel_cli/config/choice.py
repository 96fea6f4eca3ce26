"""The options of all groups, composed from the files of `conf/`; values set in them.

The files have a part of Hydra's grammar: `defaults` names other options of the file's group, the
option of a group within it, or, of an experiment, after `override`, that of any group. `${KEY}` is
a reference. Only an experiment has `inner_options` and `sources`: `conf/experiment/thesis.yaml`.
The schema, which takes long to import, only explains faults and fits an experiment's values.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from stixel_cli.config import folders
from stixel_cli.config.folders import EXPERIMENT, INNER, SOURCES, group_options
from stixel_cli.config.texts import suggestion
from stixel_cli.errors import BelongsElsewhere, ConfigurationError, printable

_TO_RESOLVE = re.compile(r"\$\{|\?\?\?")
_REFERENCE = re.compile(r"\$\{([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\}")


@dataclass(frozen=True)
class Choice:
    """The configuration of chosen options, before values are set; not to be changed.

    Attributes:
        plain: in plain types with references as text.
        options: the option of each group.
    """

    plain: dict[str, Any]
    options: dict[str, str]


def compose_options(chosen: Mapping[str, str]) -> Choice:
    """The choice of groups and options, with all other groups at their default.

    Raises:
        UserError: in one line, for an option that is missing, or a file that is not valid.
    """
    top = folders.values_beside_groups("config")
    configured, options = folders.chosen_options(top), dict(chosen)
    options.setdefault(EXPERIMENT, configured[EXPERIMENT])
    # The file that includes another one, and a later line, come first.
    for item in reversed([*_listed(EXPERIMENT, options[EXPERIMENT])]):
        if isinstance(item, tuple):
            options.setdefault(*item)
    options = configured | options
    for group, option in options.items():
        if reference := _REFERENCE.fullmatch(option):
            options[group] = options.get(reference[1], option)
    used: dict[str, str] = {}
    settings = _section(EXPERIMENT, options, used)
    options = settings.pop(INNER, {}) | options
    plain = {g: _section(g, options, used) for g in configured if g != EXPERIMENT}
    plain |= {name: value for name, value in top.items() if name != "defaults"}
    settings.pop(SOURCES, None)
    if settings:
        plain = _merged(plain, _fitting(settings, plain))
    return Choice(plain, dict(sorted(used.items())))


def _listed(
    group: str, option: str, pending: tuple[str, ...] = ()
) -> Iterator[tuple[str, str] | dict[str, Any]]:
    """The keys of an option, and of those that it derives from, in the order of merging.

    Among them, as a group and its option, what they choose of groups within theirs; an experiment
    chooses of all groups.
    """
    if option not in group_options()[group]:
        # Typed options exist: a missing one follows another group, as `prior` follows `road_user`.
        raise ConfigurationError(
            f"{group}: unknown option {option!r}, which follows from what is chosen; add conf/"
            f"{group}/{option}.yaml, or choose {group}={'|'.join(group_options()[group])}"
        )
    content, file = folders.option_content(group, option), folders.option_file(group, option)
    if option in pending:
        raise ConfigurationError(f"{file}: defaults: {option} includes itself")
    defaults = content.get("defaults", [])
    for entry in defaults if "_self_" in defaults else [*defaults, "_self_"]:
        if entry == "_self_":
            yield {name: value for name, value in content.items() if name != "defaults"}
        elif isinstance(entry, str):
            yield from _listed(group, entry, (*pending, option))
        else:
            for name, one in folders.chosen_options({"defaults": [entry]}).items():
                chosen = name if group == EXPERIMENT else f"{group}/{name}"
                if chosen not in group_options():
                    raise ConfigurationError(f"{file}: defaults: {printable(name)}: no such group")
                yield chosen, one


def _section(group: str, options: Mapping[str, str], used: dict[str, str]) -> dict[str, Any]:
    """The merged keys of the option of a group, and of the groups within it; they are `used`."""
    section: dict[str, Any] = {}
    used[group] = options[group]
    listed = [*_listed(group, options[group])]
    chosen = dict(item for item in listed if isinstance(item, tuple)) | options
    for item in listed:
        if isinstance(item, dict):
            section = _merged(section, item)
        elif group != EXPERIMENT and item[0] not in used:
            inner = item[0].rpartition("/")[2]
            section = _merged(section, {inner: _section(item[0], chosen, used)})
    return section


def _merged(section: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    both = {n: _merged(section[n], v) for n, v in more.items() if _are_mappings(section.get(n), v)}
    return {**section, **more, **both}


def _are_mappings(*values: Any) -> bool:
    return all(isinstance(value, Mapping) for value in values)


def _fitting(settings: Mapping[str, Any], plain: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of an experiment without the keys that the chosen options lack."""
    from stixel_cli.config.keys import chosen_kinds, known_keys

    kinds = chosen_kinds(_merged(plain, settings))
    lacking = {n for n, keys in known_keys().items() if not any(key.fits(kinds) for key in keys)}

    def kept(section: Mapping[str, Any], prefix: str) -> dict[str, Any]:
        inner = {
            n: kept(v, f"{prefix}{n}.") if isinstance(v, dict) else v
            for n, v in section.items()
            if prefix + n not in lacking
        }
        return {n: v for n, v in inner.items() if v != {} or section[n] == {}}

    return kept(settings, "")


def set_by_experiment(option: str) -> dict[str, Any]:
    """The groups and keys that an experiment's file sets, with their options and values."""
    content = folders.option_content(EXPERIMENT, option)
    values = folders.option_values(EXPERIMENT, option)
    own = {name: v for name, v in values.items() if not name.startswith((INNER, SOURCES))}
    return content.get(INNER, {}) | folders.chosen_options(content) | own


def with_values(plain: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """`plain` with the values of some keys replaced and all references `${KEY}` looked up.

    OmegaConf, whose other interpolations are refused here, takes thirty times as long.

    Args:
        plain: a configuration in plain types with references as text; not changed.
        values: keys, with dots, to their values.

    Raises:
        BelongsElsewhere: for a key that the chosen options do not have.
        ConfigurationError: for a reference to no key, or to itself.
    """
    tree = dict(plain)
    for name, value in values.items():
        *outer, last = name.split(".")
        section = tree
        for part in outer:
            inner = section.get(part)
            # The dicts that contain the value are copied, because they are shared.
            section[part] = section = dict(inner) if isinstance(inner, Mapping) else {}
        if last not in section:
            from stixel_cli.config import keys, messages

            raise BelongsElsewhere(messages.unknown_key(name, keys.chosen_kinds(plain)), name)
        section[last] = value
    return {name: _resolved(section, name, tree) for name, section in tree.items()}


def _resolved(value: Any, name: str, tree: Mapping[str, Any], pending: tuple[str, ...] = ()) -> Any:
    """The value of the key or group `name` with its references looked up.

    A mapping or a list without references is itself: many configurations share it.
    """
    if isinstance(value, dict | list) and not _TO_RESOLVE.search(repr(value)):
        return value
    if isinstance(value, dict):
        return {k: _resolved(item, f"{name}.{k}", tree, pending) for k, item in value.items()}
    if isinstance(value, list):
        return [_resolved(item, name, tree, pending) for item in value]
    if value == "???":
        raise ConfigurationError(f"{name}: ??? is a missing value: give one")
    if not isinstance(value, str) or "${" not in value:
        return value
    match, target = _REFERENCE.fullmatch(value), tree
    if match is None or value in pending:
        fault = "refers to itself" if match else "cannot be looked up: write ${KEY}"
        raise ConfigurationError(f"{name}: '{printable(value)}' {fault}")
    for part in match[1].split("."):
        if not isinstance(target, Mapping) or part not in target:
            from stixel_cli.config.keys import known_keys

            hint = suggestion(match[1], known_keys(), form="${{{}}}")
            raise ConfigurationError(f"{name}: refers to {match[1]}, an unknown key{hint}")
        target = target[part]
    return _resolved(target, name, tree, (*pending, value))
