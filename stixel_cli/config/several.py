"""Overrides of several values, in Hydra's grammar: `a,b`, `range(…)`, `glob(…)`."""

import copy
import itertools
from collections.abc import Iterator
from decimal import Decimal
from typing import TYPE_CHECKING, Any

from stixel_cli.config.folders import group_options
from stixel_cli.config.own_options import GIVEN
from stixel_cli.errors import ConfigurationError

if TYPE_CHECKING:
    from stixel_cli.config.overrides import Override

MOST_VALUES = 100_000
"""Maximum values of one key, and runs of a sweep; more is probably a typing error."""


def single_texts(override: "Override", shuffled: bool) -> list[str]:
    """The values of an override of several values as texts, see `Override.singles`.

    Raises:
        ConfigurationError: for no values, too many, or an interval.
    """
    texts = _texts(override, shuffled)
    if not texts:
        options = group_options().get(override.key, ())
        hint = f" (options: {', '.join(options)})" if options else ""
        raise ConfigurationError(f"{override.shown}: has no values{hint}")
    if len(texts) > MOST_VALUES:
        raise ConfigurationError(f"{override.shown}: has more than {MOST_VALUES} values")
    # Hydra escapes the colon of module:function.
    return [text.replace("\\:", ":") for text in texts] if override.key in GIVEN else texts


def _texts(override: "Override", shuffled: bool) -> list[str]:
    from hydra.core.override_parser.types import FloatRange, Glob, IntervalSweep, RangeSweep
    from hydra.errors import HydraException

    line, name, sweep = override.shown, override.key, override.sweep
    value = sweep.value()
    if isinstance(value, IntervalSweep):
        raise ConfigurationError(
            f"{line}: interval(a,b) is continuous: write a range with a step, "
            f"{name}=range({value.start:g},{value.end:g},STEP), or values separated by commas"
        )
    if getattr(value, "shuffle", False):
        if not shuffled:
            raise ConfigurationError(f"{line}: shuffle(…) needs --shuffle SEED")
        sweep = copy.deepcopy(sweep)
        value = sweep.value()
        value.shuffle = False
    try:
        if isinstance(value, Glob):
            if name not in group_options():
                raise ConfigurationError(f"{line}: glob is for options of a group")
            return value.filter(list(group_options()[name]))
        if isinstance(value, RangeSweep) and isinstance(value.range(), FloatRange):
            return [repr(number) for number in _decimal_range(value)]
        return list(itertools.islice(sweep.sweep_string_iterator(), MOST_VALUES + 1))
    except (HydraException, ValueError, ArithmeticError):
        if not isinstance(value, RangeSweep):
            raise ConfigurationError(
                f"{line}: nested sweeps are not supported: list the values, {name}=A,B,C"
            ) from None
        raise ConfigurationError(f"{line}: not a valid range: the step must not be 0") from None


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
