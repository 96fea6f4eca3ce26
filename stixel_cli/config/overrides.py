"""Overrides: `KEY=VALUE`, `GROUP=OPTION`, or several values, in Hydra's grammar.

Hydra's parser is not public: the project pins Hydra.
"""

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache, lru_cache
from typing import Any

from stixel_cli.border import Origin
from stixel_cli.config import messages
from stixel_cli.config.folders import group_options
from stixel_cli.config.keys import known_keys
from stixel_cli.config.texts import split_override
from stixel_cli.errors import ConfigurationError

MOST_TYPED = 5_000
"""Maximum commas of one override: Hydra's parser takes 1 s for these; its time is quadratic."""

LONGEST_TYPED = 100_000
"""Maximum characters of one override: also 1 s; a path of 1000 points has half as many."""

MOST_VALUES = 100_000
"""Maximum values of one key, and runs of a sweep; more is probably a typing error."""

_WORD = "[a-z_][a-z_0-9]*"
_PLAIN = re.compile(
    rf"(?!hydra)(?P<key>{_WORD}([.]{_WORD})*|{_WORD}(/{_WORD})*)="
    rf"((?!(true|false|null|inf|nan)$)(?P<word>{_WORD})|"
    r"(?P<number>-?(0|[1-9][0-9]{0,15})([.][0-9]{1,15})?))"
)
"""Most overrides: one word or number. Hydra takes 0.2 s to import."""

_SWEEPS = ("choice", "range", "glob", "sort", "interval")


@dataclass(frozen=True)
class Override:
    """An override, parsed once; equal texts are equal.

    Attributes:
        text: as typed.
        key: the key, or the group.
        origin: where it was written: typed, or in which file.
        value: in its own type; None for several values.
        sweep: Hydra's override of several values; None for one value.
    """

    text: str
    key: str
    origin: Origin = field(compare=False)
    value: Any = field(compare=False)
    sweep: Any = field(default=None, compare=False)

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

    def singles(self) -> "list[Override]":
        """Overrides of one value each, in order; for one value only itself.

        Raises:
            ConfigurationError: for no values, too many, an interval, or a random order.
        """
        if self.sweep is None:
            return [self]
        texts = _single_texts(self)
        if not texts:
            options = group_options().get(self.key, ())
            hint = f" (options: {', '.join(options)})" if options else ""
            raise ConfigurationError(f"{self.shown}: has no values{hint}")
        if len(texts) > MOST_VALUES:
            raise ConfigurationError(f"{self.shown}: has more than {MOST_VALUES} values")
        if self.key in group_options():  # Hydra escapes the colon of module:function.
            texts = [text.replace("\\:", ":") for text in texts]
        return [parse(f"{self.sign}{self.key}={text}", self.origin) for text in texts]


@lru_cache(maxsize=8192)
def parse(text: str, origin: Origin) -> Override:
    """The override of a text, by Hydra's grammar; ConfigurationError if the text is none."""
    if plain := _PLAIN.fullmatch(text):
        number, value = plain["number"], plain["word"]
        if number is not None:
            value = float(number) if "." in number else int(number)
        return Override(text, plain["key"], origin, value)
    if fault := _malformed(text):
        raise ConfigurationError(fault)
    from hydra.errors import HydraException

    try:
        read = parser().parse_override(text)
        sweep = read if read.is_sweep_override() else None
        value = None if sweep else read.value()
        override = Override(text, read.key_or_group, origin, value, sweep)
    except (HydraException, ValueError, RecursionError):
        raise ConfigurationError(_unreadable(text)) from None
    shown = override.shown
    if read.package is not None:
        raise ConfigurationError(f"{shown}: no package (@) can be given; write {override.key}=…")
    if override.key == "hydra" or read.is_hydra_override():
        raise ConfigurationError(f"{shown}: Hydra's own settings have no effect here: leave it out")
    return override


@cache
def parser() -> Any:
    """Hydra's parser of overrides."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    return OverridesParser.create()


def _malformed(text: str) -> str:
    """What is wrong with a text that Hydra would not refuse in one clear line; "" for another."""
    bare, groups = text.lstrip("+~").strip(), group_options()
    shown = messages.printable(text) if bare else messages.show(text)
    for is_wrong, fault in (
        (any("\ud800" <= c <= "\udfff" for c in text), "is not UTF-8 text"),
        (text.count(",") > MOST_TYPED, f"more than {MOST_TYPED} values: use range(START,STOP)"),
        (len(text) > LONGEST_TYPED, f"longer than {LONGEST_TYPED} characters"),
        (not bare, "a KEY=VALUE is needed"),
        (bare.startswith("="), "the key before the = is missing"),
    ):
        if is_wrong:
            return f"{shown}: {fault}"
    if "=" in bare or text.startswith("~"):
        return ""
    if bare in groups or bare in known_keys():
        return f"{bare}: a value is missing: write {bare}={'|'.join(groups.get(bare, ['VALUE']))}"
    if bare.replace(".", "/") in groups:
        return messages.group_by_dots(bare, None)
    # `car` is an option of three groups; the road user chooses the others.
    of = sorted((g for g in groups if bare in groups[g]), key=lambda group: group != "road_user")
    if of and bare != "default":
        return f"{bare}: is an option: write {of[0]}={bare}"
    options = [f"{group}={option}" for group in groups for option in groups[group]]
    hint = messages.suggestion(bare, [*groups, *known_keys()], form="{}=…")
    hint = hint or messages.suggestion(bare, options)
    return f"{messages.show(text)}: must be KEY=VALUE{hint}"


def _unreadable(text: str) -> str:
    words, (name, value), shown = text.split(), split_override(text), messages.printable(text)
    if len(words) > 1 and all("=" in word for word in words):
        return f"{shown}: is several overrides in one text: separate them"
    known = [*group_options(), *known_keys()]
    if name not in known and (hint := messages.suggestion(name, known)):
        return f"{messages.printable(name)}: unknown key{hint}"
    for opening, closing in ("[]", "{}", "()"):
        if value.count(opening) != value.count(closing):
            return f"{shown}: {opening} and {closing} do not match"
    for quote in "'\"":
        if value.count(quote) % 2:
            return f"{shown}: the quote {quote} is not closed"
    sweep = value.partition("(")[0]
    if sweep in _SWEEPS and not value.removeprefix(sweep)[1:-1].strip():
        return f"{shown}: has no values: write {name}=A,B or {name}=range(START,STOP,STEP)"
    if value.startswith(",") or value.endswith(",") or ",," in value:
        return f"{shown}: a value is missing next to a comma"
    return f"""{shown}: cannot be read; quote text with special characters: KEY='"text"'"""


def _single_texts(override: Override) -> list[str]:
    """The values of an override of several values as texts, at most `MOST_VALUES` + 1."""
    from hydra.core.override_parser.types import FloatRange, Glob, IntervalSweep, RangeSweep
    from hydra.errors import HydraException

    line, name, value = override.shown, override.key, override.sweep.value()
    if isinstance(value, IntervalSweep):
        range_ = f"range({value.start:g},{value.end:g},STEP)"
        how = f"write a range with a step, {name}={range_}, or values separated by commas"
        raise ConfigurationError(f"{line}: interval(a,b) is continuous: {how}")
    if getattr(value, "shuffle", False):
        raise ConfigurationError(f"{line}: shuffle(…) is not supported: the order has no effect")
    if isinstance(value, Glob):
        if name not in group_options():
            raise ConfigurationError(f"{line}: glob is for options of a group")
        return value.filter(list(group_options()[name]))
    try:
        if isinstance(value, RangeSweep) and isinstance(value.range(), FloatRange):
            return [repr(number) for number in _decimal_range(value)]
        return [*itertools.islice(override.sweep.sweep_string_iterator(), MOST_VALUES + 1)]
    except (HydraException, ValueError, ArithmeticError):
        fault = f"nested sweeps are not supported: list the values, {name}=A,B,C"
        if isinstance(value, RangeSweep):
            fault = "not a valid range: the step must not be 0"
        raise ConfigurationError(f"{line}: {fault}") from None


def _decimal_range(sweep: Any) -> Iterator[float]:
    """The numbers of a range, computed in decimals as typed.

    Hydra computes in binary floating point: range(0.2,0.8,0.2) would give
    0.6000000000000001, and a fourth value.
    """
    start, stop, step = (Decimal(repr(n)) for n in (sweep.start, sweep.stop, sweep.step))
    if step == 0:
        raise ValueError("the step is 0")
    for i in range(MOST_VALUES + 1):
        number = start + i * step
        if number >= stop if step > 0 else number <= stop:
            return
        yield float(number)
