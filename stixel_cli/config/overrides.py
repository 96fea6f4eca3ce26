"""Overrides as they are typed, in Hydra's grammar: read, and refused where they cannot be meant.

This is the one module that touches Hydra's parser; it is not public, hence the pin in the project.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from stixel_cli.config import messages
from stixel_cli.config.folders import group_options
from stixel_cli.config.keys import known_keys
from stixel_cli.errors import ConfigurationError

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override


def parse_overrides(texts: Sequence[str]) -> "list[Override]":
    """Overrides (`key=value`, `group=option`, with `+`, `++`, `~`, sweeps) by Hydra's grammar.

    Raises:
        ConfigurationError: where a text is none.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    parser = OverridesParser.create()
    parsed = []
    for text in texts:
        # Hydra would write its own errors of several lines for these, or none at all.
        _refuse_malformed(text)
        try:
            parsed.append(parser.parse_override(text))
        except (HydraException, ValueError, RecursionError):
            raise ConfigurationError(_unreadable(text)) from None
    return parsed


def _refuse_malformed(text: str) -> None:
    bare = text.lstrip("+~").strip()
    if any(0xD800 <= ord(character) <= 0xDFFF for character in text):
        raise ConfigurationError(f"{messages.show(text)}: is not UTF-8 text")
    if not bare:
        raise ConfigurationError(f"{messages.show(text)}: a KEY=VALUE is needed")
    if bare.startswith("="):
        raise ConfigurationError(f"{messages.printable(text)}: the key before the = is missing")
    if "=" in bare or text.startswith("~"):
        return
    groups = [group for group, options in group_options().items() if bare in options]
    if bare in group_options():
        options = "|".join(group_options()[bare])
        raise ConfigurationError(f"{bare}: an option is missing: write {bare}={options}")
    if bare in known_keys():
        raise ConfigurationError(f"{bare}: a value is missing: write {bare}=VALUE")
    if groups and bare != "default":
        raise ConfigurationError(f"{bare}: is an option: write {groups[0]}={bare}")
    hint = messages.suggestion(bare, [*group_options(), *known_keys()], form="{}=…")
    raise ConfigurationError(f"{messages.show(text)}: must be KEY=VALUE{hint}")


def _unreadable(text: str) -> str:
    key, _, value = text.partition("=")
    name, shown = key.lstrip("+~").strip(), messages.printable(text)
    if name not in known_keys() and name not in group_options():
        hint = messages.suggestion(name, [*group_options(), *known_keys()])
        if hint:
            return f"{messages.printable(name)}: there is no such key{hint}"
    for opening, closing in ("[]", "{}", "()"):
        if value.count(opening) != value.count(closing):
            return f"{shown}: {opening} and {closing} do not match"
    for quote in "'\"":
        if value.count(quote) % 2:
            return f"{shown}: the quote {quote} is not closed"
    return f"""{shown}: cannot be read; quote text with special characters: KEY='"text"'"""


def check_overrides(parsed: "Sequence[Override]") -> None:
    """Refuse what Hydra would let pass, or answer in a way that helps no one.

    Sweeps are not refused here: see `refuse_sweeps`.

    Raises:
        ConfigurationError: for the first override that cannot be meant.
    """
    for override in parsed:
        _check_name(override)
        if override.is_delete():
            name = override.key_or_group
            what = "an option of it" if name in group_options() else "a value of it"
            raise ConfigurationError(f"~{name}: nothing can be left out: {what} is always needed")
        if override.key_or_group in group_options():
            _check_group(override)
        elif override.is_add():
            raise ConfigurationError(
                f"{messages.printable(str(override.input_line))}: {override.key_or_group} is "
                "there already: leave out the +"
            )
    _refuse_repeated(parsed)


def _check_name(override: "Override") -> None:
    name = override.key_or_group
    text = messages.printable(str(override.input_line))
    if override.package is not None:
        raise ConfigurationError(f"{text}: no package (@) can be given; write {name}=…")
    if name == "hydra" or override.is_hydra_override():
        raise ConfigurationError(f"{text}: Hydra's own settings have no effect here: leave it out")
    if name in group_options() or name in known_keys():
        return
    if "/" in name and name.replace("/", ".") in known_keys():
        raise ConfigurationError(
            f"{name}: there is no such key; did you mean {name.replace('/', '.')}?"
        )
    group, _, last = name.partition(".")
    if last == "kind" and group in group_options():
        options = ", ".join(group_options()[group])
        raise ConfigurationError(
            f"{name}: follows from the option of {group}: write {group}=… (options: {options})"
        )
    raise ConfigurationError(messages.unknown_key(name))


def _check_group(override: "Override") -> None:
    group = override.key_or_group
    options = group_options()[group]
    if override.is_add() or override.is_force_add():
        text = messages.printable(str(override.input_line))
        raise ConfigurationError(f"{text}: {group} is there already: leave out the +")
    if override.is_sweep_override():
        return
    value = override.value()
    if isinstance(value, dict | list):
        example = next(key for key in known_keys() if key.startswith(group + "."))
        raise ConfigurationError(
            f"{group}: {messages.show(value)}: one option is needed (options: "
            f"{', '.join(options)}), or single keys as {example}=VALUE"
        )
    text = "null" if value is None else str(value)
    if text not in options:
        raise ConfigurationError(messages.unknown_option(group, text))


def _refuse_repeated(parsed: "Sequence[Override]") -> None:
    """Hydra takes the last of two in silence."""
    seen: dict[str, Override] = {}
    for override in parsed:
        name = override.key_or_group
        if name in seen:
            first, second = (
                messages.printable(str(one.input_line)) for one in (seen[name], override)
            )
            raise ConfigurationError(f"{name}: is given twice, {first} and {second}: give it once")
        seen[name] = override


def refuse_sweeps(parsed: "Sequence[Override]") -> None:
    """Refuse overrides with several values.

    Raises:
        ConfigurationError: for the first of them.
    """
    for override in parsed:
        if override.is_sweep_override():
            name = override.key_or_group
            value = messages.printable(str(override.input_line)).partition("=")[2]
            hint = " (a list is written in brackets)" if name in known_keys() else ""
            raise ConfigurationError(
                f"{name}: {value} stands for several values: one run needs one{hint}"
            )
