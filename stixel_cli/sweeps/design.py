"""The design of a sweep: what all runs share, the axes that they vary, and its runs, composed."""

import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any

from annotated_types import MinLen

from stixel_cli.border.files import read_text, read_yaml
from stixel_cli.border.origins import TYPED, Origin
from stixel_cli.config import messages
from stixel_cli.config.compose import Composer, Composition
from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.messages import LONGEST_REASON, printable
from stixel_cli.config.overrides import (
    MOST_VALUES,
    Override,
    check_overrides,
    parse,
    read_overrides,
    refuse_twice,
)
from stixel_cli.config.texts import override_text
from stixel_cli.errors import BelongsElsewhere, ConfigurationError, located, printable_path
from stixel_cli.experiment.table import PICTURES
from stixel_cli.parameters import parameters
from stixel_cli.results.result import MISSING, RunResult

SEED = "seed"
NOT_GIVEN = "–"
"""Shown as the value of a key that the run's option of a group lacks."""


@dataclass(frozen=True)
class Axis:
    """An axis of a sweep."""

    keys: tuple[str, ...]
    """One key, or several zipped keys."""
    steps: tuple[tuple[Override, ...], ...]
    """For each value of the axis an override of each key."""

    @property
    def name(self) -> str:
        """The keys, joined by `+`."""
        return "+".join(self.keys)


@dataclass(frozen=True)
class Design:
    """A sweep before its runs are composed."""

    fixed: tuple[Override, ...]
    """Overrides of all runs."""
    axes: tuple[Axis, ...]
    """The runs are all combinations of their steps; the last axis varies fastest."""
    left_out: tuple[Mapping[str, Any], ...] = ()
    """Combinations to leave out, each as keys of axes with their values."""
    file: str = ""
    """That names them; "" if there is no file."""
    words: tuple[str, ...] = ()
    """Of the command line that gives this design, without `stixel sweep`."""
    over: tuple[str, ...] = (SEED,)
    """Keys of the axes that means are over."""

    def __post_init__(self):
        refuse_twice([*self.fixed, *(one for axis in self.axes for one in axis.steps[0])])

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
    own = [one.value for one in overrides if one.key == key]
    return any(one == value and isinstance(one, bool) == isinstance(value, bool) for one in own)


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


MOST_ENTRIES = 50_000
"""Values of the file of a sweep or a study, aliases expanded."""


@parameters
class SweepEntries:
    """The entries of a sweep's file; the values of a key are a list, or a sweep as typed."""

    fixed: dict[str, Any] = field(default_factory=dict)
    axes: dict[str, Any] = field(default_factory=dict)
    zipped: list[Annotated[dict[str, Any], MinLen(2)]] = field(default_factory=list)
    seeds: Any = None
    leave_out: list[Annotated[dict[str, Any], MinLen(1)]] = field(default_factory=list)


SWEEP_ENTRIES = tuple(one.name for one in fields(SweepEntries))


def find_file(name: str, study: bool = False) -> Path:
    """The file of a sweep or a study: a path, or a name in `pipelines/studies`.

    ConfigurationError without one; what is in the file is not checked.
    """
    path, shipped = Path(name), shipped_folder("pipelines") / "studies"
    if path.exists() and (path.suffix == ".yaml" or (path.is_file() and not study)):
        return path
    inside = shipped / f"{name.removesuffix('.yaml')}.yaml"
    if path.name == name and inside.is_file():
        return inside
    known = [file.stem for file in sorted(shipped.glob("*.yaml")) if is_study(file) == study]
    hint = messages.suggestion(name, known) or f" (shipped: {', '.join(known)})"
    what = f"{messages.printable(name)}: no such {'study' if study else 'file'}{hint}"
    raise ConfigurationError(what if study else f"--from: {what}")


def is_study(path: Path) -> bool:
    """Whether a file describes a study of several sweeps; `pipelines/studies` has both kinds."""
    return re.search("^sweeps:", read_text(path), re.M) is not None


def read_design(path: Path, trusted: bool) -> Design:
    """The design in a file, whose names of code count as `trusted`; UserError if it is wrong."""
    content = read_yaml(path, MOST_ENTRIES)
    if "sweeps" in content:
        where = printable_path(path)
        raise ConfigurationError(f"{where}: is a study, not a sweep: stixel study {path.stem}")
    return replace(design_of(content, str(path), Origin(str(path), trusted)), file=str(path))


def design_of(content: Mapping[Any, Any], where: str, origin: Origin) -> Design:
    """The design of entries that `origin` has; ConfigurationError in one line after `where`."""
    where = printable_path(where)
    given = {key: value for key, value in content.items() if value is not None}
    entries = messages.validated(SweepEntries, given, where)
    with located(where, ConfigurationError, ConfigurationError):
        return _design(entries, origin)


def _design(content: SweepEntries, origin: Origin) -> Design:
    fixed = tuple(parse(override_text(key, value), origin) for key, value in content.fixed.items())
    for override in fixed:
        if override.sweep is not None:
            raise ConfigurationError(f"fixed: {override.text}: one value is needed")
    axes = [_axis("axes", {key: values}, origin) for key, values in content.axes.items()]
    for number, keys in enumerate(content.zipped, start=1):
        axes.append(_axis(f"zipped: entry {number}", keys, origin))
    seeds = content.seeds
    if isinstance(seeds, int) and not isinstance(seeds, bool):
        if not 1 <= seeds <= MOST_VALUES:
            most = f"must be a number from 1 to {MOST_VALUES} or a list"
            raise ConfigurationError(f"seeds: {most}, got {seeds}")
        seeds = list(range(seeds))
    if seeds is not None:
        axes.append(_axis("seeds", {SEED: seeds}, origin))
    design = Design(fixed, tuple(axes), tuple(content.leave_out))
    for key, value in (pair for entry in content.leave_out for pair in entry.items()):
        if key not in design.keys:
            shown, hint = messages.printable(key), messages.suggestion(key, design.keys)
            raise ConfigurationError(f"leave_out: {shown} is not on any axis{hint}")
        if not has(design.swept, key, value):
            raise ConfigurationError(f"leave_out: no run has {key}={messages.show(value)}")
    check_overrides(design.overrides)
    return design


def _axis(where: str, keys: Mapping[str, Any], origin: Origin) -> Axis:
    columns = {key: _values(where, key, values, origin) for key, values in keys.items()}
    if len(set(map(len, columns.values()))) > 1:
        counts = ", ".join(f"{key} {len(column)}" for key, column in columns.items())
        raise ConfigurationError(f"{where}: zipped keys need the same number of values: {counts}")
    return Axis(tuple(keys), tuple(zip(*columns.values(), strict=True)))


def _values(where: str, key: str, values: Any, origin: Origin) -> list[Override]:
    if isinstance(values, list):
        if not values:
            raise ConfigurationError(f"{where}: {key} has no values")
        return [parse(override_text(key, value), origin) for value in values]
    if isinstance(values, str):
        # As on the command line: a,b or choice(…), range(…), glob(…).
        parsed = parse(f"{key}={values}", origin)
        if parsed.sweep is not None:
            return parsed.singles()
    raise ConfigurationError(
        f"{where}: {key}: {messages.show(values)} is one value: write a list [a, b], or a sweep "
        "such as range(0,1,0.1)"
    )


def over_keys(names: str | Sequence[str], axes: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """The keys `names`, a list or separated by commas, each of which an axis has.

    ConfigurationError for a key that no axis has.
    """
    names = names.split(",") if isinstance(names, str) else list(names)
    swept = [key for axis in axes for key in axis]
    for name in (name for name in names if name not in swept and names != [SEED]):
        hint = "; it takes keys, whose values are overrides: --over seed 'seed=range(0,4)'"
        raise ConfigurationError(
            f"over: {printable(name, 60)} is not swept; swept: {', '.join(swept) or 'nothing'}"
            f"{hint if '=' in name else ''}"
        )
    return tuple(names)


def planned_as(index: int, swept: Mapping[str, str], composition: Composition) -> RunResult:
    """Run `index`, from 0 in the order of the axes, to be computed.

    `swept` has the keys that differ between runs, each with its value as typed.
    """
    manifest = {
        "overrides": list(composition.overrides),
        "choices": composition.choices,
        "seed": composition.configuration.seed,
        # Runs that are equal without their seeds are repetitions.
        "swept": {key: value for key, value in swept.items() if key != SEED},
        "run": index,
    }
    settings, label = composition.resolved, setting_label(swept)
    return RunResult(settings, manifest, composition=composition, label=label, status=MISSING)


def picture_keys(run: RunResult) -> list[str]:
    """Keys of its pictures; empty unless they are required."""
    return [key for key in run.targets if run.graph.nodes[key].stage.name in PICTURES]


def is_done_by(
    planned: RunResult, stored: RunResult | None, missing: Set[str] = frozenset()
) -> bool:
    """Whether a complete run of the folder has results of the keys that are planned.

    Results other than scores and pictures stay in the store: none may be `missing` there.
    """
    if stored is None or stored.manifest["results"] != list(planned.targets):
        return False
    return missing.isdisjoint({*planned.targets[1:]}.difference(picture_keys(planned)))


def sweep_design(
    overrides: Sequence[str],
    file: str | None = None,
    trust_code: bool = False,
    over: str = SEED,
    one_is_enough: bool = False,
) -> Design:
    """The design of a command line, on which several values of a key make an axis, and a file.

    The file is a path, or a name in `pipelines/studies`; code that it names must be trusted. Means
    are `over` keys of the axes, by commas. A single run is accepted if `one_is_enough`.

    ConfigurationError for an invalid override, a key in both, code that is not trusted, or means
    over an axis that is not swept.
    """
    design, words = Design((), ()), [*overrides]
    if file is not None:
        design = read_design(find_file(file), trust_code)
        words += ["--from", file]
    fixed, axes = [*design.fixed], [*design.axes]
    for override in read_overrides(overrides, TYPED):
        if override.sweep is None:
            fixed.append(override)
        else:
            axes.append(Axis((override.key,), tuple((one,) for one in override.singles())))
    # Seeds vary fastest, so that the first finished runs complete one setting.
    axes.sort(key=lambda axis: axis.keys == (SEED,))
    try:
        design = replace(design, fixed=tuple(fixed), axes=tuple(axes))
    except ConfigurationError as fault:
        raise ConfigurationError(f"{fault}, in {design.file} or on the command line") from None
    check_overrides(design.overrides)
    check_size(design, one_is_enough)
    if over != SEED:
        words += ["--over", over]
    keys = over_keys(over, [a.keys for a in design.axes])
    return replace(design, words=tuple(words), over=keys)


def design_runs(design: Design, composer: Composer) -> list[RunResult]:
    """The runs of a design, in the order of its axes; ConfigurationError for the first fault."""
    each = [(*design.fixed, *changes) for changes in design.combinations()]
    if not each:
        raise ConfigurationError("leave_out: every run is left out")
    runs = compose_runs(each, design.keys, composer)
    # One composer made them, so equal groups are one object.
    groups = equal_runs(runs, lambda r: (*map(id, vars(r.composition.configuration).values()),))
    for one, other in groups:
        raise ConfigurationError(
            f"runs {one.index} and {other.index} are equal: {one.label} and {other.label} give "
            "the same configuration"
        )
    return runs


def compose_runs(
    each: Sequence[Sequence[Override]], keys: Sequence[str], composer: Composer
) -> list[RunResult]:
    """The runs of the overrides of each, of one value each; `keys` differ between them.

    Where options of a group differ, a run leaves out keys that only others of the options have:
    its setting of such a key is `NOT_GIVEN`, and runs that differ in such keys alone are one.

    ConfigurationError in one line that names the first invalid run by its settings.
    """
    runs: dict[Hashable, RunResult] = {}
    left_out: Counter[str] = Counter()
    for parsed in each:
        values = {one.key: one.value_text for one in parsed}
        try:
            composition = _composed(parsed, keys, composer, left_out, len(each))
        except ConfigurationError as fault:
            if not keys:
                raise
            named = setting_label({key: values.get(key, NOT_GIVEN) for key in keys})
            raise ConfigurationError(f"{fault} (run {len(runs)}: {named})") from None
        given = composition.keys
        settings = {key: values[key] if key in given else NOT_GIVEN for key in keys}
        shown = (*settings.values(),)
        mark = shown if NOT_GIVEN in shown else len(runs)
        runs.setdefault(mark, planned_as(len(runs), settings, composition))
    return [*runs.values()]


def _composed(
    parsed: Sequence[Override],
    keys: Sequence[str],
    composer: Composer,
    left_out: Counter[str],
    count: int,
) -> Composition:
    """The composition of one of `count` runs, without keys that only other options have.

    `left_out` counts the runs without each key: at least one run must have it.
    """
    try:
        return composer.compose(parsed)
    except BelongsElsewhere as fault:
        key, kept = fault.key, [one for one in parsed if one.key != fault.key]
        left_out[key] += 1
        group, dot, _ = key.partition(".")
        if not dot or group not in keys or len(kept) == len(parsed) or left_out[key] == count:
            raise
        return _composed(kept, keys, composer, left_out, count)


def setting_label(settings: Mapping[str, str]) -> str:
    """`key=value …`, printable."""
    return printable(" ".join(f"{k}={v}" for k, v in settings.items()), LONGEST_REASON)


def equal_runs(
    runs: Sequence[RunResult], what: Callable[[RunResult], Hashable]
) -> Iterator[tuple[RunResult, RunResult]]:
    """Pairs of runs, the earlier one first, of which `what` is equal."""
    first: dict[Hashable, RunResult] = {}
    for run in runs:
        other = first.setdefault(what(run), run)
        if other is not run:
            yield other, run
