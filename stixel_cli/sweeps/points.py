"""From overrides or a file to the points of a sweep, each composed and validated."""

import json
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stixel_cli.config.compose import Composer, Composition
from stixel_cli.config.messages import LONGEST_REASON, printable
from stixel_cli.errors import ConfigurationError
from stixel_cli.sweeps.design import SEED, Design, check_size, design_from_line, joined
from stixel_cli.sweeps.file import find_file, read_design


@dataclass(frozen=True)
class Point:
    """One configuration of a sweep.

    Attributes:
        index: from 0, in the order of the axes; shuffling does not change it.
        overrides: what it takes to compose it alone.
        settings: the keys that differ between points, each with its value as it is typed.
        composition: validated.
    """

    index: int
    overrides: tuple[str, ...]
    settings: dict[str, str]
    composition: Composition

    @property
    def seed(self) -> int:
        """The seed of all that it draws."""
        return self.composition.configuration.seed

    @property
    def setting(self) -> dict[str, str]:
        """What differs, without the seed: points of equal settings are repetitions."""
        return {key: value for key, value in self.settings.items() if key != SEED}

    @property
    def values(self) -> dict[str, Any]:
        """What differs, without the seed: options of groups, and values of their own types."""
        return {key: self.composition.value(key) for key in self.setting}

    @property
    def label(self) -> str:
        """`key=value …` of what differs."""
        return _label(self.settings)


def sweep_design(
    overrides: Sequence[str],
    file: str | None = None,
    shuffle_seed: int | None = None,
    one_is_enough: bool = False,
) -> Design:
    """The design of a command line and a file together.

    Args:
        overrides: in Hydra's grammar, with its sweeps.
        file: a path, or the name of one in `pipelines/studies`; see `stixel_cli.sweeps.file`.
        shuffle_seed: of the order in which the points will run, None for theirs.
        one_is_enough: whether a design of a single point will do.

    Raises:
        ConfigurationError: for what cannot be meant, a key that both give among it.
    """
    shuffled = shuffle_seed is not None
    design = design_from_line(overrides, shuffled)
    if file is not None:
        path = find_file(file)
        design = joined(read_design(path, shuffled), design, str(path))
    else:
        design = joined(Design((), ()), design, "")
    check_size(design, one_is_enough)
    return design


def design_points(design: Design) -> list[Point]:
    """The points of a design, in the order of its axes, every one of them validated.

    Raises:
        ConfigurationError: in one line, for what is wrong with any of them.
    """
    composer = Composer()
    texts = [(*design.fixed, *changes) for changes in design.combinations(composer)]
    if not texts:
        raise ConfigurationError(
            f"{design.leave_out}: every point is left out: nothing remains to sweep"
        )
    points = compose_points(texts, design.keys, composer)
    _refuse_equal(points)
    return points


def compose_points(
    texts: Sequence[Sequence[str]], keys: Sequence[str], composer: Composer | None = None
) -> list[Point]:
    """The points of given overrides.

    Args:
        texts: overrides of one value each, of every point.
        keys: those that differ between points.
        composer: to go on with.

    Raises:
        ConfigurationError: in one line that names the point by what differs.
    """
    composer = Composer() if composer is None else composer
    points = []
    for index, overrides in enumerate(texts):
        values = dict(_key_and_value(text) for text in overrides)
        settings = {key: values[key] for key in keys}
        try:
            composition = composer.compose(overrides)
        except ConfigurationError as fault:
            if not settings:
                raise
            raise ConfigurationError(f"{fault} (point {index}: {_label(settings)})") from None
        points.append(Point(index, tuple(overrides), settings, composition))
    return points


def shuffled_points(points: Sequence[Any], seed: int | None) -> list[Any]:
    """The points in an order that is drawn; as they are where there is no seed."""
    points = list(points)
    if seed is not None:
        random.Random(seed).shuffle(points)
    return points


def _label(settings: Mapping[str, str]) -> str:
    text = " ".join(f"{key}={value}" for key, value in settings.items())
    return printable(text, LONGEST_REASON)


def _key_and_value(text: str) -> tuple[str, str]:
    key, _, value = text.partition("=")
    return key.strip().lstrip("+"), value.strip()


def _refuse_equal(points: Sequence[Point]) -> None:
    seen: dict[str, Point] = {}
    for point in points:
        text = json.dumps(point.composition.resolved, sort_keys=True)
        other = seen.setdefault(text, point)
        if other is not point:
            raise ConfigurationError(
                f"points {other.index} and {point.index} are equal: {other.label} and "
                f"{point.label} are the same configuration"
            )
