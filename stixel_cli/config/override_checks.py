"""Checks of overrides: names and options, and conditions between the overrides of one run."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from stixel_cli.border import Origin
from stixel_cli.config import messages
from stixel_cli.config.folders import default_option, group_options, innermost_group, outer_options
from stixel_cli.config.keys import known_keys
from stixel_cli.config.messages import unknown_option
from stixel_cli.config.overrides import Override, parse
from stixel_cli.config.own_options import RESERVED, admit_overrides, user_function
from stixel_cli.errors import BelongsElsewhere, ConfigurationError

WITHOUT_EFFECT = {
    *("pace", "path", "ego", "rig", "world", "renderer", "sensor", "stereo"),
    *("road", "occupancy", "free_space", "height", "extraction"),
}
"""Groups of the scene and the cameras, which scans from a file do not have."""


def read_overrides(texts: Iterable[str], origin: Origin) -> list[Override]:
    """The overrides of texts from one place; ConfigurationError if two are of one key."""
    return refuse_twice(parse(text, origin) for text in texts)


def refuse_twice(overrides: Iterable[Override]) -> list[Override]:
    """The overrides; ConfigurationError if two are of one key."""
    parsed: dict[str, Override] = {}
    for override in overrides:
        # Hydra silently takes the last value.
        if override.key in parsed:
            both = f"{parsed[override.key].shown} and {override.shown}"
            raise ConfigurationError(f"{override.key}: is given twice, {both}: give it once")
        parsed[override.key] = override
    return list(parsed.values())


def check_overrides(parsed: Iterable[Override]) -> None:
    """Refuse code that a file names, and invalid overrides that Hydra accepts or reports unclearly.

    Faults that depend on all overrides of a run are checked by `check_one_run`.

    Args:
        parsed: those of a run, or the single values of those of a sweep.

    Raises:
        ConfigurationError: for the first invalid override.
    """
    parsed = list(parsed)
    admit_overrides(parsed)
    user_defined = {o.key for o in parsed if user_function(o.key, o.value)}
    for override in parsed:
        if fault := _fault(override, user_defined):
            raise ConfigurationError(fault)


def _fault(override: Override, user_defined: Collection[str]) -> str:
    """What is wrong with an override by itself; "" if nothing is."""
    name, value, options = override.key, override.value, group_options().get(override.key)
    if options is None and name not in known_keys():
        group, _, parameter = name.partition(".")
        if group not in user_defined or not parameter.isidentifier():
            return _unknown(name, value)
        if parameter in RESERVED:
            return f"{name}: the name is reserved; rename the parameter"
    if override.sign == "~":
        what = "a value" if options is None else "an option"
        return f"~{name}: cannot be removed: it always needs {what}"
    if override.sign == "+" or (override.sign and options):
        owners = messages.owners_of(name)
        there = f"belongs to {owners} and exists there" if owners else "already exists"
        return f"{override.shown}: {name} {there}: leave out the +"
    if options is None or override.sweep is not None:
        return ""
    if isinstance(value, dict | list):
        within = name.replace("/", ".") + "."
        example = next(key for key in known_keys() if key.startswith(within))
        needed = f"one option is needed (options: {', '.join(options)}), or single keys as"
        return f"{name}: {messages.show(value)}: {needed} {example}=VALUE"
    option = "null" if value is None else str(value)
    known = option in options or user_function(name, option)
    return "" if known else unknown_option(name, option)


def _unknown(name: str, value: Any) -> str:
    """What is said of a name that is neither a group nor a key."""
    dotted, group = name.replace("/", "."), innermost_group(name)
    if dotted in known_keys():
        return f"{name}: unknown key; did you mean {dotted}?"
    if name.replace(".", "/") in group_options():
        return messages.group_by_dots(name, value)
    if group and name == group.replace("/", ".") + ".kind":
        options = ", ".join(group_options()[group])
        how = f"write {group}=… (options: {options})"
        return f"{name}: follows from the option of {group}: {how}"
    return messages.unknown_key(name)


def check_one_run(parsed: Sequence[Override]) -> None:
    """Refuse several values, and an inner group that the chosen option does not have.

    `parsed` must be all overrides of one run, because some of them choose options.
    """
    chosen = {override.key: str(override.value) for override in parsed}
    for override in parsed:
        name = override.key
        if override.sweep is not None:
            value = messages.printable(override.value_text)
            hint = " (a list is written in brackets)" if name in known_keys() else ""
            several = f"{value} has several values: one run needs one{hint}"
            raise ConfigurationError(f"{name}: {several}; `stixel sweep` takes several")
        outer, owners = name.rpartition("/")[0], outer_options(name)
        option = chosen.get(outer) or (default_option(outer) if owners else "")
        if owners and option not in owners:
            there = f"there is no such group with {outer}={option}"
            valid = f"{outer}={'|'.join(owners)}"
            raise BelongsElsewhere(f"{name}: {there}; it belongs to {valid}", name)


def implied_by_file(settings: Mapping[str, Any]) -> dict[str, str]:
    """Further settings of a run with these: `start=scans` for scans from a file without truth.

    Raises:
        BelongsElsewhere: for a setting that has no effect on such a run.
    """
    if settings.get("measurement") != "file":
        return {}
    for name in settings:
        of_user = name.startswith("road_user.")
        if of_user or name.partition(".")[0] in WITHOUT_EFFECT:
            why = "has no effect with measurement=file, which has no scene and no cameras"
            more = "; prior.… sets the class's size" if of_user else ""
            raise BelongsElsewhere(f"{name}: {why}: leave it out{more}", name)
    with_truth = settings.get("measurement.truth") or "start" in settings
    return {} if with_truth else {"start": "scans"}
