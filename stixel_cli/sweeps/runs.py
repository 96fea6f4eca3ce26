"""The runs of a sweep, composed and validated from overrides or a file."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from stixel_cli.config.compose import Composer, Composition
from stixel_cli.config.messages import LONGEST_REASON, printable
from stixel_cli.config.override_checks import check_overrides
from stixel_cli.config.overrides import Override
from stixel_cli.errors import BelongsElsewhere, ConfigurationError
from stixel_cli.experiment.table import PICTURES
from stixel_cli.results.result import RunResult
from stixel_cli.sweeps.design import NOT_GIVEN, SEED, Design, check_size, design_from_line, joined
from stixel_cli.sweeps.file import find_file, read_design
from stixel_cli.sweeps.results import over_keys

if TYPE_CHECKING:
    from stixel_cli.engine.graph import Graph


@dataclass(frozen=True)
class PlannedRun:
    """One run of a sweep, to be computed.

    Attributes:
        index: from 0, in the order of the axes.
        settings: the keys that differ between runs, each with its value as typed.
        composition: validated.
        graph: of this run only; None before `graphs.plan_runs`.
        targets: keys of the nodes whose results it requires, the scores first.
    """

    index: int
    settings: dict[str, str]
    composition: Composition
    graph: "Graph | None" = None
    targets: tuple[str, ...] = ()

    @property
    def overrides(self) -> tuple[str, ...]:
        """All that `stixel run` needs to compose it."""
        return self.composition.overrides

    @property
    def setting(self) -> dict[str, str]:
        """The settings without the seed: runs of equal settings are repetitions."""
        return {key: value for key, value in self.settings.items() if key != SEED}

    @property
    def label(self) -> str:
        """`key=value …` of the settings."""
        return setting_label(self.settings)

    @property
    def scores(self) -> str:
        """Key of its scores."""
        return self.targets[0]

    @property
    def pictures(self) -> tuple[str, ...]:
        """Keys of its pictures; empty unless they are required."""
        return tuple(k for k in self.targets if self.graph.nodes[k].stage.name in PICTURES)

    def is_done_by(self, run: RunResult | None, missing: Set[str] = frozenset()) -> bool:
        """Whether a complete run of the folder has results of the keys that are planned.

        Results other than scores and pictures stay in the store: none may be `missing` there.
        """
        if run is None or run.manifest["results"] != list(self.targets):
            return False
        return missing.isdisjoint({*self.targets} - {self.scores, *self.pictures})

    @property
    def manifest(self) -> dict[str, Any]:
        """Its entries in a manifest."""
        return {
            "overrides": list(self.overrides),
            "choices": self.composition.choices,
            "seed": self.composition.configuration.seed,
            "swept": self.setting,
        }

    def result(self, **outcome: Any) -> RunResult:
        """The run with its `metrics`, or its `status` and `failure`."""
        return RunResult(
            settings=self.composition.resolved,
            manifest=self.manifest | {"run": self.index},
            composition=self.composition,
            label=self.label,
            planned=self,
            **outcome,
        )


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
        file: a path, or a name in `pipelines/studies`; see `stixel_cli.sweeps.file`.
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


def design_runs(design: Design, imports: bool = True) -> list[PlannedRun]:
    """The runs of a design, in the order of its axes; ConfigurationError for the first fault.

    `imports` allows the import of the user's own functions, to check their parameters.
    """
    each = [(*design.fixed, *changes) for changes in design.combinations()]
    if not each:
        raise ConfigurationError("leave_out: every run is left out")
    runs = compose_runs(each, design.keys, Composer(imports=imports))
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
) -> list[PlannedRun]:
    """The runs of the overrides of each, of one value each; `keys` differ between them.

    Where options of a group differ, a run leaves out keys that only others of the options have:
    its setting of such a key is `NOT_GIVEN`, and runs that differ in such keys alone are one.

    ConfigurationError in one line that names the first invalid run by its settings.
    """
    runs: dict[Hashable, PlannedRun] = {}
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
        runs.setdefault(mark, PlannedRun(len(runs), settings, composition))
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
    runs: Sequence[PlannedRun], what: Callable[[PlannedRun], Hashable]
) -> Iterator[tuple[PlannedRun, PlannedRun]]:
    """Pairs of runs, the earlier one first, of which `what` is equal."""
    first: dict[Hashable, PlannedRun] = {}
    for run in runs:
        other = first.setdefault(what(run), run)
        if other is not run:
            yield other, run
