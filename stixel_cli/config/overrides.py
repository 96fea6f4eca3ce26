"""Read overrides in Hydra's grammar, and refuse invalid ones.

Only this module uses Hydra's parser, which is not public: the project therefore pins Hydra.
"""

import copy
import itertools
from collections.abc import Collection, Iterator, Sequence
from decimal import Decimal
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

from stixel_cli.config import folders, messages
from stixel_cli.config.folders import group_options
from stixel_cli.config.keys import known_keys
from stixel_cli.config.own_options import GIVEN, check_option, is_parameter, own_groups
from stixel_cli.config.plain_overrides import plain_override
from stixel_cli.errors import ConfigurationError

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override

MOST_VALUES = 100_000
"""Maximum values of one key, and runs of a sweep; more is probably a typing error."""

MOST_TYPED = 5_000
"""Maximum commas of one override: Hydra's parser takes 1 s for these; its time is quadratic."""

LONGEST_TYPED = 100_000
"""Maximum characters of one override: also 1 s; a path of 1000 points has half as many."""

_SWEEPS = {
    "choice": "choice(A,B)",
    "range": "range(START,STOP,STEP)",
    "glob": "glob(PATTERN)",
    "sort": "sort(A,B)",
    "interval": "range(START,STOP,STEP)",
}


def parse_overrides(texts: Sequence[str]) -> "list[Override]":
    """Overrides (`key=value`, `group=option`, with `+`, `++`, `~`, sweeps) by Hydra's grammar.

    Raises:
        ConfigurationError: for the first text that is not an override.
    """
    parsed = []
    for text in texts:
        # For these Hydra writes errors of several lines, or no error.
        _refuse_malformed(text)
        try:
            parsed.append(_parse(text))
        except Exception as fault:
            from hydra.errors import HydraException

            if isinstance(fault, HydraException | ValueError | RecursionError):
                raise ConfigurationError(_unreadable(text)) from None
            raise
    return parsed


@cache
def _parser() -> Any:
    from hydra.core.override_parser.overrides_parser import OverridesParser

    return OverridesParser.create()


@lru_cache(maxsize=8192)
def _parse(text: str) -> "Override":
    """The parsed override; never changed, so it can be cached."""
    return plain_override(text) or _parser().parse_override(text)


def _refuse_malformed(text: str) -> None:
    bare = text.lstrip("+~").strip()
    if any(0xD800 <= ord(character) <= 0xDFFF for character in text):
        raise ConfigurationError(f"{messages.show(text)}: is not UTF-8 text")
    if text.count(",") > MOST_TYPED:
        shown = messages.printable(text)
        raise ConfigurationError(f"{shown}: more than {MOST_TYPED} values: use range(START,STOP)")
    if len(text) > LONGEST_TYPED:
        shown = messages.printable(text)
        raise ConfigurationError(f"{shown}: longer than {LONGEST_TYPED} characters")
    if "${oc.deprecated:" in text:
        shown = messages.printable(text)
        raise ConfigurationError(f"{shown}: oc.deprecated only warns: write ${{KEY}}")
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
    if bare.replace(".", "/") in group_options():
        raise ConfigurationError(folders.group_by_dots(bare, None))
    if groups and bare != "default":
        # `car` is an option of three groups; the road user chooses the others.
        group = "road_user" if "road_user" in groups else groups[0]
        raise ConfigurationError(f"{bare}: is an option: write {group}={bare}")
    hint = messages.suggestion(bare, [*group_options(), *known_keys()], form="{}=…")
    raise ConfigurationError(f"{messages.show(text)}: must be KEY=VALUE{hint}")


def _unreadable(text: str) -> str:
    key, _, value = text.partition("=")
    name, shown = key.lstrip("+~").strip(), messages.printable(text)
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
    sweep = value.strip().partition("(")[0]
    if sweep in _SWEEPS and not value.strip().removeprefix(sweep)[1:-1].strip():
        return f"{shown}: has no values: write {name}={_SWEEPS[sweep]}"
    if value.strip().startswith(",") or value.strip().endswith(",") or ",," in value:
        return f"{shown}: a value is missing next to a comma"
    return f"""{shown}: cannot be read; quote text with special characters: KEY='"text"'"""


def check_overrides(parsed: "Sequence[Override]", own: Collection[str] = ()) -> None:
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
    for override in parsed:
        _check_name(override, own)
        if override.is_delete():
            name = override.key_or_group
            what = "an option" if name in group_options() else "a value"
            raise ConfigurationError(f"~{name}: cannot be removed: it always needs {what}")
        if override.key_or_group in group_options():
            _check_group(override)
        elif override.is_add():
            line, name = messages.printable(str(override.input_line)), override.key_or_group
            owners = messages.owners_of(name)
            there = f"belongs to {owners} and exists there" if owners else "already exists"
            raise ConfigurationError(f"{line}: {name} {there}: leave out the +")
    _refuse_repeated(parsed)


def _check_name(override: "Override", own: Collection[str]) -> None:
    name = override.key_or_group
    text = messages.printable(str(override.input_line))
    if override.package is not None:
        raise ConfigurationError(f"{text}: no package (@) can be given; write {name}=…")
    if name == "hydra" or override.is_hydra_override():
        raise ConfigurationError(f"{text}: Hydra's own settings have no effect here: leave it out")
    if name in group_options() or name in known_keys() or is_parameter(name, own):
        return
    if "/" in name and name.replace("/", ".") in known_keys():
        raise ConfigurationError(f"{name}: unknown key; did you mean {name.replace('/', '.')}?")
    folders.refuse_group_as_key(name, None if override.is_delete() else override.value())
    raise ConfigurationError(messages.unknown_key(name))


def _check_group(override: "Override") -> None:
    group = override.key_or_group
    options = group_options()[group]
    if override.is_add() or override.is_force_add():
        text = messages.printable(str(override.input_line))
        raise ConfigurationError(f"{text}: {group} already exists: leave out the +")
    if override.is_sweep_override():
        return
    value = override.value()
    if isinstance(value, dict | list):
        within = group.replace("/", ".") + "."
        example = next(key for key in known_keys() if key.startswith(within))
        raise ConfigurationError(
            f"{group}: {messages.show(value)}: one option is needed (options: "
            f"{', '.join(options)}), or single keys as {example}=VALUE"
        )
    text = "null" if value is None else str(value)
    if text not in options and not check_option(group, text):
        raise ConfigurationError(messages.unknown_option(group, text))


def _refuse_repeated(parsed: "Sequence[Override]") -> None:
    """Refuse a key that is given twice: Hydra silently takes the last value."""
    seen: dict[str, Override] = {}
    for override in parsed:
        name = override.key_or_group
        if name in seen:
            first, second = (
                messages.printable(str(one.input_line)) for one in (seen[name], override)
            )
            raise ConfigurationError(f"{name}: is given twice, {first} and {second}: give it once")
        seen[name] = override


def check_one_run(parsed: "Sequence[Override]") -> None:
    """Refuse several values, and an inner group that the chosen option does not have.

    `parsed` must be all overrides of one run, because some of them choose options.

    Raises:
        ConfigurationError: for the first of them.
    """
    for override in parsed:
        if override.is_sweep_override():
            name = override.key_or_group
            value = messages.printable(str(override.input_line)).partition("=")[2]
            hint = " (a list is written in brackets)" if name in known_keys() else ""
            raise ConfigurationError(
                f"{name}: {value} has several values: one run needs one{hint}; "
                "`stixel sweep` takes several"
            )
    folders.refuse_without_outer(parsed)


def single_overrides(override: "Override", shuffled: bool) -> list[str]:
    """Split an override of several values into overrides of one value each, in order.

    Args:
        override: a choice `a,b`, `choice(…)`, `range(…)` or `glob(…)`; or one value, which gives
            one text.
        shuffled: whether the order of the runs will be random, so that `shuffle(…)` is allowed. The
            order is not changed here.

    Raises:
        ConfigurationError: for no values, too many, or an interval.
    """
    if not override.is_sweep_override():
        return [str(override.input_line)]
    from hydra.core.override_parser.types import FloatRange, Glob, IntervalSweep, RangeSweep
    from hydra.errors import HydraException

    line, name = messages.printable(str(override.input_line)), override.key_or_group
    value = override.value()
    if isinstance(value, IntervalSweep):
        raise ConfigurationError(
            f"{line}: interval(a,b) is continuous: write a range with a step, "
            f"{name}=range({value.start:g},{value.end:g},STEP), or values separated by commas"
        )
    if getattr(value, "shuffle", False):
        if not shuffled:
            raise ConfigurationError(f"{line}: shuffle(…) needs --shuffle SEED")
        override = copy.deepcopy(override)
        value = override.value()
        value.shuffle = False
    before = override.get_key_element()
    try:
        if isinstance(value, Glob):
            if name not in group_options():
                raise ConfigurationError(f"{line}: glob is for options of a group")
            texts = value.filter(list(group_options()[name]))
        else:
            numbers = value.range() if isinstance(value, RangeSweep) else None
            if isinstance(numbers, FloatRange):
                texts = [repr(number) for number in _decimal_range(value)]
            else:
                values = override.sweep_string_iterator()
                texts = list(itertools.islice(values, MOST_VALUES + 1))
    except (HydraException, ValueError, ArithmeticError):
        if not isinstance(value, RangeSweep):
            raise ConfigurationError(
                f"{line}: nested sweeps are not supported: list the values, {name}=A,B,C"
            ) from None
        raise ConfigurationError(f"{line}: not a valid range: the step must not be 0") from None
    if not texts:
        options = (
            f" (options: {', '.join(group_options()[name])})" if isinstance(value, Glob) else ""
        )
        raise ConfigurationError(f"{line}: has no values{options}")
    if len(texts) > MOST_VALUES:
        raise ConfigurationError(f"{line}: has more than {MOST_VALUES} values")
    if name in GIVEN:
        # Hydra escapes the colon of module:function.
        texts = [text.replace("\\:", ":") for text in texts]
    return [f"{before}={text}" for text in texts]


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
