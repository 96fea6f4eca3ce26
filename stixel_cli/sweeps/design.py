"""What a sweep is made of: what all points have in common, and the axes along which they differ."""

import itertools
import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stixel_cli.config import messages
from stixel_cli.config.compose import Composer
from stixel_cli.config.overrides import (
    MOST_VALUES,
    check_overrides,
    parse_overrides,
    single_overrides,
)
from stixel_cli.errors import ConfigurationError

SEED = "seed"


@dataclass(frozen=True)
class Axis:
    """One direction of a sweep.

    Attributes:
        keys: one, or several that go together.
        steps: one a value; each has an override of one value, `key=value`, for each key, and after
            these any that go with this step alone.
    """

    keys: tuple[str, ...]
    steps: tuple[tuple[str, ...], ...]

    @property
    def name(self) -> str:
        """The keys, joined by `+`."""
        return "+".join(self.keys)


@dataclass(frozen=True)
class Design:
    """All of a sweep before its points are made.

    Attributes:
        fixed: overrides that all points have.
        axes: of which the points are all combinations, the last running fastest.
        left_out: points that are not wanted: keys of axes with the value that is left out.
        file: which names those; "" where none does.
    """

    fixed: tuple[str, ...]
    axes: tuple[Axis, ...]
    left_out: tuple[Mapping[str, Any], ...] = ()
    file: str = ""

    @property
    def leave_out(self) -> str:
        """Where points are left out, as messages name it."""
        return f"{messages.printable(self.file, 200)}: leave_out" if self.file else "leave_out"

    @property
    def keys(self) -> list[str]:
        """Every key that differs between points."""
        return [key for axis in self.axes for key in axis.keys]

    def combinations(self, composer: Composer) -> Iterator[tuple[str, ...]]:
        """The overrides that make each point differ, without those that are left out."""
        if self.left_out:
            self._check_left_out(composer)
        for steps in itertools.product(*(axis.steps for axis in self.axes)):
            texts = tuple(text for step in steps for text in step)
            if self.left_out:
                point = {composer.parse(t).key_or_group: composer.parse(t).value() for t in texts}
                if any(
                    all(same(point[key], value) for key, value in entry.items())
                    for entry in self.left_out
                ):
                    continue
            yield texts

    def _check_left_out(self, composer: Composer) -> None:
        swept = [composer.parse(text) for axis in self.axes for step in axis.steps for text in step]
        for entry in self.left_out:
            for key, value in entry.items():
                if not any(one.key_or_group == key and same(one.value(), value) for one in swept):
                    raise ConfigurationError(
                        f"{self.leave_out}: no point has {key}={messages.show(value)}, so nothing "
                        "would be left out"
                    )


def same(one: Any, other: Any) -> bool:
    """Whether two values are equal, 1 and True being different and 1 and 1.0 not."""
    return isinstance(one, bool) == isinstance(other, bool) and one == other


def design_from_line(overrides: Sequence[str], shuffled: bool) -> Design:
    """The design that overrides on the command line stand for.

    Args:
        overrides: in Hydra's grammar, those with several values being the axes.
        shuffled: whether the order is drawn, see `single_overrides`.

    Raises:
        ConfigurationError: for what cannot be meant.
    """
    parsed = parse_overrides(overrides)
    check_overrides(parsed)
    fixed, axes = [], []
    for override in parsed:
        if override.is_sweep_override():
            texts = single_overrides(override, shuffled)
            check_each(texts)
            axes.append(Axis((override.key_or_group,), tuple((text,) for text in texts)))
        else:
            fixed.append(str(override.input_line))
    return Design(tuple(fixed), tuple(axes))


def check_each(texts: Sequence[str]) -> None:
    """Refuse overrides of one value each that cannot be meant, or that are the same.

    Raises:
        ConfigurationError: for the first of them.
    """
    seen: set[Any] = set()
    for override in parse_overrides(texts):
        check_overrides([override])
        value = override.value()
        # 1 and 1.0 are the same, and equal; 1 and true are not, and would be.
        mark = (isinstance(value, bool), value if isinstance(value, Hashable) else str(value))
        if mark in seen:
            raise ConfigurationError(
                f"{override.key_or_group}: {messages.show(value)} is given twice: two points "
                "would be equal"
            )
        seen.add(mark)


def joined(one: Design, other: Design, where: str) -> Design:
    """Both designs together, the axes of `one` first; `where` says where `one` stands.

    Raises:
        ConfigurationError: if they have a key in common.
    """
    mine = {key for axis in one.axes for key in axis.keys}
    mine |= {text.partition("=")[0].lstrip("+") for text in one.fixed}
    theirs = {key for axis in other.axes for key in axis.keys}
    theirs |= {text.partition("=")[0].lstrip("+") for text in other.fixed}
    twice = sorted(mine & theirs)
    if twice:
        raise ConfigurationError(
            f"{twice[0]}: is given twice, in {where} and on the line: give it once"
        )
    axes = (*one.axes, *other.axes)
    # Seeds run fastest, so that the first points to be there are those of one setting.
    last = [axis for axis in axes if axis.keys == (SEED,)]
    return Design(
        (*one.fixed, *other.fixed),
        (*(axis for axis in axes if axis not in last), *last),
        (*one.left_out, *other.left_out),
        one.file or other.file,
    )


def check_size(design: Design, one_is_enough: bool = False) -> None:
    """Refuse a design of more points than anybody can mean, or of one if that is not enough.

    Raises:
        ConfigurationError: in one line.
    """
    if not design.axes and not one_is_enough:
        raise ConfigurationError(
            "nothing to sweep: give a key several values, such as seed=0,1,2 or "
            "'tracker.length_scale=range(0.2,0.8,0.2)'; for one run, stixel run"
        )
    count = math.prod(len(axis.steps) for axis in design.axes)
    if count > MOST_VALUES:
        raise ConfigurationError(f"the sweep would have {count} points, more than {MOST_VALUES}")
