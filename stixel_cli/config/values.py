"""Set values in a composed configuration and resolve its interpolations."""

import re
from collections.abc import Collection, Mapping
from typing import Any

from stixel_cli.config import messages
from stixel_cli.config.keys import chosen_kinds, known_keys
from stixel_cli.errors import BelongsElsewhere, ConfigurationError

_REFERENCE = re.compile(r"\$\{([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\}")


def with_values(
    plain: Mapping[str, Any], values: Mapping[str, Any], interpolated: Collection[str]
) -> dict[str, Any]:
    """`plain` with the values of some keys replaced and all interpolations resolved.

    References `${a.b}` are looked up here; OmegaConf resolves the rest, which takes thirty times
    as long. Sections that need no change are those of `plain`, not copies.

    Args:
        plain: a configuration in plain types with interpolations as text; not changed.
        values: keys, with dots, to their values.
        interpolated: the sections of `plain` that have interpolations.

    Raises:
        BelongsElsewhere: for a key that the chosen options do not have.
        ConfigurationError: for an interpolation that cannot be resolved.
    """
    tree, changed = dict(plain), set(interpolated)
    for name, value in values.items():
        *outer, last = name.split(".")
        section = tree
        for part in outer:
            inner = section.get(part)
            # The dicts that contain the value are copied, because they are shared.
            section[part] = section = dict(inner) if isinstance(inner, Mapping) else {}
        if last not in section:
            raise BelongsElsewhere(messages.unknown_key(name, chosen_kinds(plain)), name)
        section[last] = value
        changed.add((*outer, last)[0])
    try:
        return {
            name: _resolved(section, tree) if name in changed else section
            for name, section in tree.items()
        }
    except (LookupError, TypeError):
        return _by_omegaconf(tree)


def is_interpolated(section: Any) -> bool:
    """Whether a section has an interpolation or a missing value `???`."""
    text = repr(section)
    return "${" in text or "???" in text


def _resolved(value: Any, tree: Mapping[str, Any], pending: tuple[str, ...] = ()) -> Any:
    """The value with its references looked up; LookupError or TypeError for any other text."""
    if isinstance(value, dict):
        return {name: _resolved(item, tree, pending) for name, item in value.items()}
    if isinstance(value, list):
        return [_resolved(item, tree, pending) for item in value]
    if not isinstance(value, str) or not is_interpolated(value):
        return value
    match = _REFERENCE.fullmatch(value)
    if match is None or value in pending:
        raise LookupError(value)
    target: Any = tree
    for part in match[1].split("."):
        target = target[part]
    return _resolved(target, tree, (*pending, value))


def _by_omegaconf(tree: dict[str, Any]) -> dict[str, Any]:
    from omegaconf import OmegaConf
    from omegaconf.errors import (
        InterpolationKeyError,
        MissingMandatoryValue,
        OmegaConfBaseException,
    )

    try:
        container = OmegaConf.create(tree)
        return OmegaConf.to_container(container, resolve=True, throw_on_missing=True)
    except MissingMandatoryValue as fault:
        raise ConfigurationError(f"{fault.full_key}: ??? is a missing value: give one") from None
    except OmegaConfBaseException as fault:
        reason = messages.first_line(fault.msg or fault)
        wanted = re.search("key '(.*)'", reason)
        if isinstance(fault, InterpolationKeyError) and wanted:
            hint = messages.suggestion(wanted[1], known_keys(), form="${{{}}}")
            reason = f"refers to {wanted[1]}, an unknown key{hint}"
        name = fault.full_key or "the configuration"
        raise ConfigurationError(f"{name}: {reason}") from None
