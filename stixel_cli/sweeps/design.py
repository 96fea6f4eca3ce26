"""The design of a sweep: the overrides that all runs share, and the axes that they vary."""

import itertools
import math
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from stixel_cli.border import TYPED
from stixel_cli.config import messages
from stixel_cli.config.override_checks import read_overrides
from stixel_cli.config.overrides import MOST_VALUES, Override
from stixel_cli.errors import ConfigurationError

SEED = "seed"
NOT_GIVEN = "–"
"""Shown as the value of a key that the run's option of a group lacks."""


@dataclass(frozen=True)
class Axis:
    """An axis of a sweep.

    Attributes:
        keys: one key, or several zipped keys.
        steps: for each value of the axis an override of each key.
    """

    keys: tuple[str, ...]
    steps: tuple[tuple[Override, ...], ...]

    @property
    def name(self) -> str:
        """The keys, joined by `+`."""
        return "+".join(self.keys)


@dataclass(frozen=True)
class Design:
    """A sweep before its runs are composed.

    Attributes:
        fixed: overrides of all runs.
        axes: the runs are all combinations of their steps; the last axis varies fastest.
        left_out: combinations to leave out, each as keys of axes with their values.
        file: that names them; "" if there is no file.
        words: of the command line that gives this design, without `stixel sweep`.
        over: keys of the axes that means are over.
    """

    fixed: tuple[Override, ...]
    axes: tuple[Axis, ...]
    left_out: tuple[Mapping[str, Any], ...] = ()
    file: str = ""
    words: tuple[str, ...] = ()
    over: tuple[str, ...] = (SEED,)

    @property
    def overrides(self) -> list[Override]:
        """Every override, of the axes too."""
        return [*self.fixed, *self.swept]

    @property
    def keys(self) -> list[str]:
        """Every key that differs between runs."""
        return [key for axis in self.axes for key in axis.keys]

    @property
    def swept(self) -> list[Override]:
        """The overrides of all steps of all axes."""
        return [one for axis in self.axes for step in axis.steps for one in step]

    def combinations(self) -> Iterator[tuple[Override, ...]]:
        """The overrides of each run that differ, without combinations that are left out."""
        for steps in itertools.product(*(axis.steps for axis in self.axes)):
            run = tuple(itertools.chain(*steps))
            if not any(
                all(has(run, key, value) for key, value in entry.items()) for entry in self.left_out
            ):
                yield run


def has(overrides: Iterable[Override], key: str, value: Any) -> bool:
    """Whether one of the overrides gives the key this value; 1 equals 1.0 but not True."""
    return any(
        one.key == key
        and isinstance(one.value, bool) == isinstance(value, bool)
        and one.value == value
        for one in overrides
    )


def design_from_line(overrides: Sequence[str]) -> Design:
    """The design of a line in Hydra's grammar: overrides with several values are the axes.

    Raises:
        ConfigurationError: for an invalid override.
    """
    fixed, axes = [], []
    for override in read_overrides(overrides, TYPED):
        if override.sweep is None:
            fixed.append(override)
        else:
            values = override.singles()
            refuse_equal(values)
            axes.append(Axis((override.key,), tuple((one,) for one in values)))
    return Design(tuple(fixed), tuple(axes))


def refuse_equal(overrides: Sequence[Override]) -> None:
    """Raise ConfigurationError for the first override that has the value of one before it."""
    seen: set[Any] = set()
    for override in overrides:
        value = override.value
        # In Python 1 == True, but here they are different values; 1 and 1.0 are the same.
        mark = (isinstance(value, bool), value if isinstance(value, Hashable) else str(value))
        if mark in seen:
            raise ConfigurationError(
                f"{override.key}: {messages.show(value)} is given twice: two runs would be equal"
            )
        seen.add(mark)


def joined(one: Design, other: Design) -> Design:
    """The design of a file and that of a command line; ConfigurationError if they share a key."""
    mine, theirs = ({*design.keys, *(o.key for o in design.fixed)} for design in (one, other))
    twice = sorted(mine & theirs)
    if twice:
        raise ConfigurationError(
            f"{twice[0]}: is given twice, in {one.file} and on the command line: give it once"
        )
    # Seeds vary fastest, so that the first finished runs complete one setting.
    axes = sorted((*one.axes, *other.axes), key=lambda axis: axis.keys == (SEED,))
    return replace(one, fixed=(*one.fixed, *other.fixed), axes=tuple(axes))


def check_size(design: Design, one_is_enough: bool = False) -> None:
    """Refuse a design of too many runs, or of a single one unless `one_is_enough`."""
    if not design.axes and not one_is_enough:
        raise ConfigurationError(
            "nothing to sweep: give a key several values, such as seed=0,1,2 or "
            "'tracker.length_scale=range(0.2,0.8,0.2)'; for one run, stixel run"
        )
    count = math.prod(len(axis.steps) for axis in design.axes)
    if count > MOST_VALUES:
        raise ConfigurationError(f"the sweep would have {count} runs, more than {MOST_VALUES}")
