"""Overrides: `KEY=VALUE`, `GROUP=OPTION`, or several values, in Hydra's grammar.

Hydra's parser is not public: the project pins Hydra.
"""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any

from stixel_cli.config import folders, messages
from stixel_cli.config.folders import group_options
from stixel_cli.config.keys import known_keys
from stixel_cli.config.own_options import check_option, is_parameter, own_groups
from stixel_cli.config.several import single_texts
from stixel_cli.config.texts import split_override
from stixel_cli.errors import ConfigurationError

MOST_TYPED = 5_000
"""Maximum commas of one override: Hydra's parser takes 1 s for these; its time is quadratic."""

LONGEST_TYPED = 100_000
"""Maximum characters of one override: also 1 s; a path of 1000 points has half as many."""

_WORD = "[a-z_][a-z_0-9]*"
_PLAIN = re.compile(
    rf"(?!hydra)(?P<key>{_WORD}([.]{_WORD})*|{_WORD}(/{_WORD})*)="
    rf"((?!(true|false|null|inf|nan)$)(?P<word>{_WORD})|"
    r"(?P<number>-?(0|[1-9][0-9]{0,15})([.][0-9]{1,15})?))"
)
"""Most overrides: one word or number. Hydra takes 0.2 s to import."""

_SWEEPS = {
    "choice": "choice(A,B)",
    "range": "range(START,STOP,STEP)",
    "glob": "glob(PATTERN)",
    "sort": "sort(A,B)",
    "interval": "range(START,STOP,STEP)",
}


@dataclass(frozen=True)
class Override:
    """An override, parsed once; equal texts are equal.

    Attributes:
        text: as typed.
        key: the key, or the group.
        value: in its own type; None for several values.
        sweep: Hydra's override of several values; None for one value.
    """

    text: str
    key: str
    value: Any = field(compare=False)
    sweep: Any = field(default=None, compare=False)

    @property
    def group(self) -> str:
        """The outermost group: `measurement` of `measurement/noise` and of `measurement.rays`."""
        return re.split("[./]", self.key)[0]

    @property
    def value_text(self) -> str:
        """The value as typed."""
        return split_override(self.text)[1]

    @property
    def shown(self) -> str:
        """The text for messages: on one line, not too long."""
        return messages.printable(self.text)

    @property
    def sign(self) -> str:
        """`+`, `++` or `~` before the key; "" without one."""
        return self.text[: len(self.text) - len(self.text.lstrip("+~"))]

    def singles(self, shuffled: bool = False) -> "list[Override]":
        """Overrides of one value each, in order; for one value only itself.

        Args:
            shuffled: whether the order of the runs will be random, so that `shuffle(…)` is
                allowed. The order is not changed here.

        Raises:
            ConfigurationError: for no values, too many, or an interval.
        """
        if self.sweep is None:
            return [self]
        texts = single_texts(self, shuffled)
        return [parse(f"{self.sign}{self.key}={text}") for text in texts]


@lru_cache(maxsize=8192)
def parse(text: str) -> Override:
    """The override of a text, by Hydra's grammar.

    Raises:
        ConfigurationError: if the text is not an override of a key or a group.
    """
    plain = _PLAIN.fullmatch(text)
    if plain is not None:
        number = plain["number"]
        if number is None:
            return Override(text, plain["key"], plain["word"])
        return Override(text, plain["key"], float(number) if "." in number else int(number))
    # For these Hydra writes errors of several lines, or no error.
    _refuse_malformed(text)
    from hydra.errors import HydraException

    try:
        read = _parser().parse_override(text)
        sweep = read if read.is_sweep_override() else None
        found = Override(text, read.key_or_group, None if sweep else read.value(), sweep)
    except (HydraException, ValueError, RecursionError):
        raise ConfigurationError(_unreadable(text)) from None
    if read.package is not None:
        raise ConfigurationError(f"{found.shown}: no package (@) can be given; write {found.key}=…")
    if found.key == "hydra" or read.is_hydra_override():
        raise ConfigurationError(
            f"{found.shown}: Hydra's own settings have no effect here: leave it out"
        )
    return found


@cache
def _parser() -> Any:
    from hydra.core.override_parser.overrides_parser import OverridesParser

    return OverridesParser.create()


def read_overrides(texts: Sequence[str], own: Collection[str] = ()) -> list[Override]:
    """The overrides of texts, parsed and checked by `check_overrides`.

    Raises:
        ConfigurationError: for the first invalid override.
    """
    parsed = [parse(text) for text in texts]
    check_overrides(parsed, own)
    return parsed


def _refuse_malformed(text: str) -> None:
    bare = text.lstrip("+~").strip()
    shown = messages.printable(text)
    for wrong, fault in (
        (any("\ud800" <= c <= "\udfff" for c in text), f"{messages.show(text)}: is not UTF-8 text"),
        (
            text.count(",") > MOST_TYPED,
            f"{shown}: more than {MOST_TYPED} values: use range(START,STOP)",
        ),
        (len(text) > LONGEST_TYPED, f"{shown}: longer than {LONGEST_TYPED} characters"),
        ("${oc.deprecated:" in text, f"{shown}: oc.deprecated only warns: write ${{KEY}}"),
        (not bare, f"{messages.show(text)}: a KEY=VALUE is needed"),
        (bare.startswith("="), f"{shown}: the key before the = is missing"),
    ):
        if wrong:
            raise ConfigurationError(fault)
    if "=" in bare or text.startswith("~"):
        return
    groups = [group for group, options in group_options().items() if bare in options]
    if bare in group_options():
        options = "|".join(group_options()[bare])
        raise ConfigurationError(f"{bare}: an option is missing: write {bare}={options}")
    if bare in known_keys():
        raise ConfigurationError(f"{bare}: a value is missing: write {bare}=VALUE")
    if bare.replace(".", "/") in group_options():
        raise ConfigurationError(folders.group_by_dots(bare, None))
    if groups and bare != "default":
        # `car` is an option of three groups; the road user chooses the others.
        group = "road_user" if "road_user" in groups else groups[0]
        raise ConfigurationError(f"{bare}: is an option: write {group}={bare}")
    hint = messages.suggestion(bare, [*group_options(), *known_keys()], form="{}=…")
    raise ConfigurationError(f"{messages.show(text)}: must be KEY=VALUE{hint}")


def _unreadable(text: str) -> str:
    words = text.split()
    if len(words) > 1 and all("=" in word for word in words):
        return f"{messages.printable(text)}: is several overrides in one text: separate them"
    name, value = split_override(text)
    shown = messages.printable(text)
    if name not in known_keys() and name not in group_options():
        hint = messages.suggestion(name, [*group_options(), *known_keys()])
        if hint:
            return f"{messages.printable(name)}: unknown key{hint}"
    for opening, closing in ("[]", "{}", "()"):
        if value.count(opening) != value.count(closing):
            return f"{shown}: {opening} and {closing} do not match"
    for quote in "'\"":
        if value.count(quote) % 2:
            return f"{shown}: the quote {quote} is not closed"
    sweep = value.partition("(")[0]
    if sweep in _SWEEPS and not value.removeprefix(sweep)[1:-1].strip():
        return f"{shown}: has no values: write {name}={_SWEEPS[sweep]}"
    if value.startswith(",") or value.endswith(",") or ",," in value:
        return f"{shown}: a value is missing next to a comma"
    return f"""{shown}: cannot be read; quote text with special characters: KEY='"text"'"""


def check_overrides(parsed: Sequence[Override], own: Collection[str] = ()) -> None:
    """Refuse invalid overrides that Hydra accepts, or reports unclearly.

    Several values, and faults that depend on all overrides of a run, are checked by
    `check_one_run`.

    Args:
        parsed: the overrides.
        own: groups whose option is the user's own function by an override that is not in `parsed`.

    Raises:
        ConfigurationError: for the first invalid override.
    """
    own = own_groups(parsed) | set(own)
    seen: dict[str, Override] = {}
    for one in parsed:
        _check_name(one, own)
        if one.sign == "~":
            what = "an option" if one.key in group_options() else "a value"
            raise ConfigurationError(f"~{one.key}: cannot be removed: it always needs {what}")
        if one.key in group_options():
            _check_option(one)
        elif one.sign == "+":
            owners = messages.owners_of(one.key)
            there = f"belongs to {owners} and exists there" if owners else "already exists"
            raise ConfigurationError(f"{one.shown}: {one.key} {there}: leave out the +")
    for one in parsed:
        # Hydra silently takes the last value.
        if one.key in seen:
            both = f"{seen[one.key].shown} and {one.shown}"
            raise ConfigurationError(f"{one.key}: is given twice, {both}: give it once")
        seen[one.key] = one


def _check_name(one: Override, own: Collection[str]) -> None:
    name = one.key
    if name in group_options() or name in known_keys() or is_parameter(name, own):
        return
    if "/" in name and name.replace("/", ".") in known_keys():
        raise ConfigurationError(f"{name}: unknown key; did you mean {name.replace('/', '.')}?")
    folders.refuse_group_as_key(name, one.value)
    raise ConfigurationError(messages.unknown_key(name))


def _check_option(one: Override) -> None:
    group = one.key
    options = group_options()[group]
    if one.sign:
        raise ConfigurationError(f"{one.shown}: {group} already exists: leave out the +")
    if one.sweep is not None:
        return
    if isinstance(one.value, dict | list):
        within = group.replace("/", ".") + "."
        example = next(key for key in known_keys() if key.startswith(within))
        raise ConfigurationError(
            f"{group}: {messages.show(one.value)}: one option is needed (options: "
            f"{', '.join(options)}), or single keys as {example}=VALUE"
        )
    text = "null" if one.value is None else str(one.value)
    if text not in options and not check_option(group, text):
        raise ConfigurationError(messages.unknown_option(group, text))


def check_one_run(parsed: Sequence[Override]) -> None:
    """Refuse several values, and an inner group that the chosen option does not have.

    `parsed` must be all overrides of one run, because some of them choose options.

    Raises:
        ConfigurationError: for the first of them.
    """
    for one in parsed:
        if one.sweep is not None:
            value = messages.printable(one.value_text)
            hint = " (a list is written in brackets)" if one.key in known_keys() else ""
            raise ConfigurationError(
                f"{one.key}: {value} has several values: one run needs one{hint}; "
                "`stixel sweep` takes several"
            )
    folders.refuse_without_outer({one.key: str(one.value) for one in parsed})
