"""The runs of a sweep, composed and validated from overrides or a file."""

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
class SweepRun:
    """One run of a sweep: its configuration.

    Attributes:
        index: from 0, in the order of the axes; shuffling does not change it.
        overrides: all that `stixel run` needs to compose it.
        settings: the keys that differ between runs, each with its value as typed.
        composition: validated.
    """

    index: int
    overrides: tuple[str, ...]
    settings: dict[str, str]
    composition: Composition

    @property
    def seed(self) -> int:
        """Its seed."""
        return self.composition.configuration.seed

    @property
    def setting(self) -> dict[str, str]:
        """The settings without the seed: runs of equal settings are repetitions."""
        return {key: value for key, value in self.settings.items() if key != SEED}

    @property
    def values(self) -> dict[str, Any]:
        """The settings without the seed: options of groups, and values of their own types."""
        return {key: self.composition.value(key) for key in self.setting}

    @property
    def label(self) -> str:
        """`key=value …` of the settings."""
        return _label(self.settings)


def sweep_design(
    overrides: Sequence[str],
    file: str | None = None,
    shuffle_seed: int | None = None,
    one_is_enough: bool = False,
) -> Design:
    """The design of a command line and a file.

    Args:
        overrides: in Hydra's grammar; several values of a key make an axis.
        file: a path, or a name in `pipelines/studies`; see `stixel_cli.sweeps.file`.
        shuffle_seed: of the order of execution; None for the order of the axes.
        one_is_enough: accept a design of a single run.

    Raises:
        ConfigurationError: for an invalid override, or a key in both.
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


def design_runs(design: Design) -> list[SweepRun]:
    """The validated runs of a design, in the order of its axes.

    Raises:
        ConfigurationError: in one line, for the first invalid run.
    """
    composer = Composer()
    texts = [(*design.fixed, *changes) for changes in design.combinations(composer)]
    if not texts:
        raise ConfigurationError(f"{design.leave_out}: every run is left out")
    runs = compose_runs(texts, design.keys, composer)
    _refuse_equal(runs)
    return runs


def compose_runs(
    texts: Sequence[Sequence[str]], keys: Sequence[str], composer: Composer | None = None
) -> list[SweepRun]:
    """The runs of given overrides.

    Args:
        texts: overrides of each run, of one value each.
        keys: that differ between runs.
        composer: None for a new one.

    Raises:
        ConfigurationError: in one line that names the run by its settings.
    """
    composer = Composer() if composer is None else composer
    runs = []
    for index, overrides in enumerate(texts):
        values = dict(_key_and_value(text) for text in overrides)
        settings = {key: values[key] for key in keys}
        try:
            composition = composer.compose(overrides)
        except ConfigurationError as fault:
            if not settings:
                raise
            raise ConfigurationError(f"{fault} (run {index}: {_label(settings)})") from None
        runs.append(SweepRun(index, tuple(overrides), settings, composition))
    return runs


def shuffled_runs(runs: Sequence[Any], seed: int | None) -> list[Any]:
    """The runs in a random order; in their own order if `seed` is None."""
    runs = list(runs)
    if seed is not None:
        random.Random(seed).shuffle(runs)
    return runs


def _label(settings: Mapping[str, str]) -> str:
    text = " ".join(f"{key}={value}" for key, value in settings.items())
    return printable(text, LONGEST_REASON)


def _key_and_value(text: str) -> tuple[str, str]:
    key, _, value = text.partition("=")
    return key.strip().lstrip("+"), value.strip()


def _refuse_equal(runs: Sequence[SweepRun]) -> None:
    seen: dict[tuple[int, ...], SweepRun] = {}
    for run in runs:
        # One composer made them, so equal groups are one object.
        groups = tuple(map(id, vars(run.composition.configuration).values()))
        other = seen.setdefault(groups, run)
        if other is not run:
            raise ConfigurationError(
                f"runs {other.index} and {run.index} are equal: {other.label} and "
                f"{run.label} give the same configuration"
            )
