"""Checks of overrides: names and options, and conditions between the overrides of one run."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from stixel_cli.border import Origin
from stixel_cli.config import messages
from stixel_cli.config.folders import default_option, group_options, innermost_group, outer_options
from stixel_cli.config.keys import known_keys
from stixel_cli.config.overrides import Override, parse
from stixel_cli.config.own_options import RESERVED, admit_overrides, check_option, user_function
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
        _check_name(override, user_defined)
        if override.sign == "~":
            what = "an option" if override.key in group_options() else "a value"
            raise ConfigurationError(f"~{override.key}: cannot be removed: it always needs {what}")
        if override.key in group_options():
            _check_option(override)
        elif override.sign == "+":
            owners = messages.owners_of(override.key)
            there = f"belongs to {owners} and exists there" if owners else "already exists"
            raise ConfigurationError(f"{override.shown}: {override.key} {there}: leave out the +")


def _check_name(override: Override, user_defined: Collection[str]) -> None:
    name = override.key
    if name in group_options() or name in known_keys():
        return
    group, _, key = name.partition(".")
    if group in user_defined and key.isidentifier():
        if key in RESERVED:
            raise ConfigurationError(f"{name}: the name is reserved; rename the parameter")
        return
    if "/" in name and name.replace("/", ".") in known_keys():
        raise ConfigurationError(f"{name}: unknown key; did you mean {name.replace('/', '.')}?")
    if name.replace(".", "/") in group_options():
        raise ConfigurationError(messages.group_by_dots(name, override.value))
    group = innermost_group(name)
    if group and name == group.replace("/", ".") + ".kind":
        options = ", ".join(group_options()[group])
        raise ConfigurationError(
            f"{name}: follows from the option of {group}: write {group}=… (options: {options})"
        )
    raise ConfigurationError(messages.unknown_key(name))


def _check_option(override: Override) -> None:
    group = override.key
    options = group_options()[group]
    if override.sign:
        raise ConfigurationError(f"{override.shown}: {group} already exists: leave out the +")
    if override.sweep is not None:
        return
    if isinstance(override.value, dict | list):
        within = group.replace("/", ".") + "."
        example = next(key for key in known_keys() if key.startswith(within))
        raise ConfigurationError(
            f"{group}: {messages.show(override.value)}: one option is needed (options: "
            f"{', '.join(options)}), or single keys as {example}=VALUE"
        )
    text = "null" if override.value is None else str(override.value)
    if text not in options and not check_option(group, text):
        raise ConfigurationError(messages.unknown_option(group, text))


def check_one_run(parsed: Sequence[Override]) -> None:
    """Refuse several values, and an inner group that the chosen option does not have.

    `parsed` must be all overrides of one run, because some of them choose options.
    """
    for override in parsed:
        if override.sweep is not None:
            value = messages.printable(override.value_text)
            hint = " (a list is written in brackets)" if override.key in known_keys() else ""
            raise ConfigurationError(
                f"{override.key}: {value} has several values: one run needs one{hint}; "
                "`stixel sweep` takes several"
            )
    chosen = {override.key: str(override.value) for override in parsed}
    for group in chosen:
        outer = group.rpartition("/")[0]
        if group not in group_options() or not outer:
            continue
        option = chosen.get(outer) or default_option(outer)
        owners = outer_options(group)
        if option not in owners:
            raise BelongsElsewhere(
                f"{group}: there is no such group with {outer}={option}; it belongs to "
                f"{outer}={'|'.join(owners)}",
                group,
            )


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
            more = "; prior.… sets the class's size" if of_user else ""
            raise BelongsElsewhere(
                f"{name}: has no effect with measurement=file, which has no scene and no cameras: "
                f"leave it out{more}",
                name,
            )
    with_truth = settings.get("measurement.truth") or "start" in settings
    return {} if with_truth else {"start": "scans"}
