"""Overrides, parsed and checked: `KEY=VALUE`, `GROUP=OPTION`, or several values.

Hydra's parser is not public: the project pins Hydra.
"""

import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache, lru_cache
from typing import Any

from stixel_cli.border.origins import Origin
from stixel_cli.config import messages
from stixel_cli.config.folders import default_option, group_options, outer_options
from stixel_cli.config.keys import known_keys
from stixel_cli.config.own_options import RESERVED, admit_overrides, user_function
from stixel_cli.config.texts import split_override
from stixel_cli.errors import BelongsElsewhere, ConfigurationError

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


@dataclass(frozen=True)
class Override:
    """An override, parsed once; equal texts are equal."""

    text: str
    """As typed."""
    key: str
    """The key, or the group."""
    origin: Origin = field(compare=False)
    """Where it was written: typed, or in which file."""
    value: Any = field(compare=False)
    """In its own type; None for several values."""
    sweep: Any = field(default=None, compare=False)
    """Hydra's override of several values; None for one value."""

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

        ConfigurationError for no values, too many, an interval, or a random order.
        """
        if self.sweep is None:
            return [self]
        texts = _single_texts(self)
        if not 0 < len(texts) <= MOST_VALUES:
            options = group_options().get(self.key, ())
            hint = f" (options: {', '.join(options)})" if options else ""
            raise ConfigurationError(f"{self.shown}: must have 1 to {MOST_VALUES} values{hint}")
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
    if read.package is not None or override.key == "hydra" or read.is_hydra_override():
        fault = "packages (@) and Hydra's settings have no effect here"
        raise ConfigurationError(f"{override.shown}: {fault}: leave it out")
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
    # `car` is an option of three groups; the road user chooses the others.
    forms: dict[str, str] = {}
    for group in sorted(groups, key=lambda group: group == "road_user"):
        for option in groups[group]:
            forms |= dict.fromkeys((option, f"{group}={option}"), f"{group}={option}")
    forms |= {key: f"{key}=VALUE" for key in known_keys()}
    forms |= {group: f"{group}={'|'.join(options)}" for group, options in groups.items()}
    return f"{messages.show(text)}: must be KEY=VALUE{messages.suggestion(bare, forms, forms.get)}"


def _unreadable(text: str) -> str:
    words, (name, _), shown = text.split(), split_override(text), messages.printable(text)
    if len(words) > 1 and all("=" in word for word in words):
        return f"{shown}: is several overrides in one text: separate them"
    known = [*group_options(), *known_keys()]
    if name not in known and (hint := messages.suggestion(name, known)):
        return f"{messages.printable(name)}: unknown key{hint}"
    how = "brackets and quotes must match, with a value beside each comma and in brackets"
    return f"""{shown}: cannot be read: {how}; quote text with special characters: KEY='"text"'"""


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

    They are those of a run, or the single values of those of a sweep. Faults that depend on all
    overrides of a run are checked by `settings_of_run`. ConfigurationError for the first one.
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
            return messages.unknown_key(name)
        if parameter in RESERVED:
            return f"{name}: the name is reserved; rename the parameter"
    if override.sign and (override.sign != "++" or options):
        return f"{override.shown}: no key can be added or removed: leave out the {override.sign}"
    if options is None or override.sweep is not None:
        return ""
    if isinstance(value, dict | list):
        within = name.replace("/", ".") + "."
        example = next(key for key in known_keys() if key.startswith(within))
        needed = f"one option is needed (options: {', '.join(options)}), or single keys as"
        return f"{name}: {messages.show(value)}: {needed} {example}=VALUE"
    option = "null" if value is None else str(value)
    known = option in options or user_function(name, option)
    return "" if known else messages.unknown_option(name, option)


def settings_of_run(overrides: Iterable[Override]) -> tuple[list[Override], dict[str, Any]]:
    """The overrides of one run, checked, and its settings: key or group to value or option.

    They must be all overrides of the run, because some of them choose options. ConfigurationError
    for a wrong override, several values, an inner group that the chosen option does not have, or a
    setting that has no effect.
    """
    parsed = refuse_twice(overrides)
    check_overrides(parsed)
    settings = {override.key: override.value for override in parsed}
    for override in parsed:
        name = override.key
        if override.sweep is not None:
            value = messages.printable(override.value_text)
            hint = " (a list is written in brackets)" if name in known_keys() else ""
            several = f"{value} has several values: one run needs one{hint}"
            raise ConfigurationError(f"{name}: {several}; `stixel sweep` takes several")
        outer, owners = name.rpartition("/")[0], outer_options(name)
        option = settings.get(outer) or (default_option(outer) if owners else "")
        if owners and option not in owners:
            there = f"there is no such group with {outer}={option}"
            valid = f"{outer}={'|'.join(owners)}"
            raise BelongsElsewhere(f"{name}: {there}; it belongs to {valid}", name)
    return parsed, settings | implied_by_file(settings)


def implied_by_file(settings: Mapping[str, Any]) -> dict[str, str]:
    """Further settings of a run with these: `start=scans` for scans from a file without truth.

    BelongsElsewhere for a setting that has no effect on such a run.
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
