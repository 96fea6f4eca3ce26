"""The runs of a sweep, composed and validated from overrides or a file."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence, Set
from dataclasses import replace

from stixel_cli.config.compose import Composer, Composition
from stixel_cli.config.messages import LONGEST_REASON, printable
from stixel_cli.config.override_checks import check_overrides
from stixel_cli.config.overrides import Override
from stixel_cli.errors import BelongsElsewhere, ConfigurationError
from stixel_cli.experiment.table import PICTURES
from stixel_cli.results.result import MISSING, RunResult
from stixel_cli.sweeps.design import (
    NOT_GIVEN,
    SEED,
    Design,
    check_size,
    design_from_line,
    find_file,
    joined,
    read_design,
)
from stixel_cli.sweeps.results import over_keys


def planned_as(index: int, swept: Mapping[str, str], composition: Composition) -> RunResult:
    """Run `index`, from 0 in the order of the axes, to be computed.

    `swept` has the keys that differ between runs, each with its value as typed.
    """
    return RunResult(
        settings=composition.resolved,
        manifest={
            "overrides": list(composition.overrides),
            "choices": composition.choices,
            "seed": composition.configuration.seed,
            # Runs that are equal without their seeds are repetitions.
            "swept": {key: value for key, value in swept.items() if key != SEED},
            "run": index,
        },
        composition=composition,
        label=setting_label(swept),
        status=MISSING,
    )


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
    """The design of a command line and a file.

    Args:
        overrides: in Hydra's grammar; several values of a key make an axis.
        file: a path, or a name in `pipelines/studies`; see `stixel_cli.sweeps.design`.
        trust_code: accept user-defined code that the file names.
        over: keys of the axes that means are over, separated by commas.
        one_is_enough: accept a design of a single run.

    Raises:
        ConfigurationError: for an invalid override, a key in both, code that is not trusted, or
            means over an axis that is not swept.
    """
    design, words = Design((), ()), [*overrides]
    if file is not None:
        design = read_design(find_file(file), trust_code)
        words += ["--from", file]
    design = joined(design, design_from_line(overrides))
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
