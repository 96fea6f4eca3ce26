"""Tune settings with Optuna: trials in batches, each the runs of one cached graph.

Trials are averaged over seeds and shape seeds from 1000; the gain of one is that on those from 0.
The folder has `tune.yaml`, `trials.csv`, a page, and a preset of the chosen trial.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from annotated_types import Ge, Le

from stixel_cli.answers.figures import differences
from stixel_cli.answers.render import Cells, cells_of
from stixel_cli.answers.runs import Answer, Runs
from stixel_cli.border.files import read_yaml
from stixel_cli.border.origins import TYPED, write_below, written
from stixel_cli.config.compose import Composer
from stixel_cli.config.folders import EXPERIMENT, group_options, of_the_machine
from stixel_cli.config.messages import suggestion, validated
from stixel_cli.config.overrides import Override, check_overrides, parse, refuse_twice
from stixel_cli.errors import ConfigurationError, UserError, printable
from stixel_cli.evaluation.intervals import LEAST_UNITS
from stixel_cli.evaluation.metric_table import METRICS, metric
from stixel_cli.parameters import parameters
from stixel_cli.report.metrics import number
from stixel_cli.report.page import drawing_for_page, page_template
from stixel_cli.results.folder import PAGE
from stixel_cli.results.result import DONE, RunResult, yaml_text
from stixel_cli.sweeps.design import SEED, compose_runs
from stixel_cli.sweeps.folder import SweepRequest
from stixel_cli.sweeps.graphs import check_axes, plan_runs
from stixel_cli.sweeps.run import Sweep

FIRST_SEED = 1000
"""Of those to tune on: reports use the seeds below."""
BATCH = 4
"""Trials that are asked for together, whatever the number of workers."""


REQUEST = "tune.yaml"


@parameters
class TuneRequest:
    """The content of `tune.yaml`.

    Attributes:
        overrides: as typed: fixed ones, the parameters (choices, ranges, intervals), given axes.
        objectives: names of one metric or two.
        over: keys of the given axes to average over, such as path; seeds always are.
        seeds: number of seeds from 1000, unless the overrides have the key `seed`, and from 0.
        trials: their number.
    """

    overrides: list[str]
    objectives: list[str]
    over: list[str]
    seeds: Annotated[int, Ge(1), Le(1000)]
    trials: Annotated[int, Ge(1), Le(10_000)]


def read_request(folder: Path) -> TuneRequest:
    """The content of `tune.yaml`; UserError if this is not the folder of a tuning."""
    file = folder / REQUEST
    return validated(TuneRequest, read_yaml(file), file)


@dataclass
class Trial:
    """Values of the parameters, as texts, with what came of them."""

    name: str
    settings: dict[str, str] = field(default_factory=dict)
    values: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    """(objectives, runs) so far, in the order of the runs."""
    state: str = "complete"
    """"complete", "stopped" as clearly worse, or "failed: reason"."""

    @property
    def means(self) -> np.ndarray:
        """Mean of each objective over the runs so far."""
        return self.values.mean(axis=1)


class Tuning:
    """A tuning, its `trials`, the `default` on the same seeds, and Optuna's `study`."""

    def __init__(self, overrides: Sequence[Override], request: TuneRequest):
        """With the overrides of a request, parsed; ConfigurationError for the first fault."""
        if find_spec("optuna") is None:
            raise UserError("tune needs Optuna: pip install 'stixel[tune]'")
        objectives, over, seeds = request.objectives, request.over, request.seeds
        _check_objectives(objectives)
        self.objectives, self.trials, self.default = objectives, list[Trial](), Trial("default")
        self.sign = np.array([-1.0 if metric(n).better == "more" else 1.0 for n in objectives])
        parsed = {one.key: one for one in refuse_twice(overrides)}
        for key in (key for key in over if key != SEED and key not in parsed):
            raise ConfigurationError(f"--over: {printable(key)} is not swept")
        if EXPERIMENT in parsed:
            raise ConfigurationError(f"{EXPERIMENT}: the preset is one: give its options singly")
        drawn = [parse(f"{SEED}={i}", TYPED) for i in range(FIRST_SEED, FIRST_SEED + seeds)]
        # Seeds vary slowest, so that the first runs of a trial are those of whole seeds.
        axes = [parsed.pop(SEED).singles() if SEED in parsed else drawn]
        averaged = [key for key in parsed if key in over or key.endswith(SEED)]
        axes += [parsed.pop(key).singles() for key in averaged]
        self.fixed = [one for one in parsed.values() if one.sweep is None]
        tuned = [one for one in parsed.values() if one.sweep is not None]
        self._origins = {one.key: one.origin for one in tuned}
        check_overrides([*self.fixed, *itertools.chain(*axes)])
        for one in itertools.chain(*axes):
            if is_drawn(one) and one.value < FIRST_SEED:
                raise ConfigurationError(f"{one.shown}: seeds to tune on are {FIRST_SEED} and more")
        if not tuned:
            raise ConfigurationError("nothing to tune: write KEY='interval(A,B)' or KEY=A,B,C")
        fresh = [[parse(f"{SEED}={i}", TYPED) for i in range(seeds)]]
        fresh += [
            [parse(f"{o.key}={o.value - FIRST_SEED}", o.origin) if is_drawn(o) else o for o in axis]
            for axis in axes[1:]
        ]
        self._levels = {False: [*itertools.product(*axes)], True: [*itertools.product(*fresh)]}
        """For fresh seeds or not: the overrides of each run that no trial changes."""
        # One shape has no variance.
        several = [axis[0] for axis in axes[1:] if len(axis) > 1]
        self._drawn = {SEED, *(one.key for one in several if is_drawn(one))}
        # A clearly worse trial stops after these runs: an interval needs as many seeds.
        self._first = LEAST_UNITS * len(self._levels[False]) // len(axes[0])
        self.parameters = {one.key: self._distribution(one, tuned) for one in tuned}

    def _distribution(self, override: Override, tuned: Sequence[Override]) -> Any:
        """Optuna's distribution of a parameter, whose ends give valid and different runs."""
        from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

        key, sweep, of_group = override.key, override.sweep.value(), group_options()
        if type(sweep).__name__ != "IntervalSweep":
            ends = [one.value_text for one in override.singles()]
            found = CategoricalDistribution(ends)
        else:
            options = [one.singles()[0] for one in tuned if one.key in of_group and one.key != key]
            check_overrides([] if key in of_group else [parse(f"{key}=0", override.origin)])
            try:
                default = Composer().compose([*self.fixed, *options]).value(key)
            except (KeyError, TypeError):
                raise ConfigurationError(f"{override.shown}: has no such default: {key}") from None
            if isinstance(default, bool | str | list):
                raise ConfigurationError(f"{override.shown}: not a number: write {key}=A,B")
            log, low, high = "log" in sweep.tags, sweep.start, sweep.end
            if sweep.tags - {"log"} or not low < high or (log and low <= 0.0):
                form = "interval(A,B) or tag(log,interval(A,B)) with A < B, for log with A > 0"
                raise ConfigurationError(f"{override.shown}: must be {form}")
            if isinstance(default, int):
                found = IntDistribution(math.ceil(low), math.floor(high), log)
            else:
                found = FloatDistribution(low, high, log)
            ends = [str(found.low), str(found.high)]
        runs = [self._runs({key: end}, False, 1)[0] for end in ends]
        if len(ends) > 1:
            check_axes(plan_runs([one.numbered(i) for i, one in enumerate(runs)]).runs)
        return found

    def overrides(self, settings: Mapping[str, str]) -> list[Override]:
        """The overrides of a trial's settings, from where the parameters were written."""
        return [parse(f"{key}={value}", self._origins[key]) for key, value in settings.items()]

    def _runs(self, settings: Mapping[str, str], fresh: bool, n: int | None) -> list[RunResult]:
        """The first n runs of settings; all of them without n."""
        shared = [*self.fixed, *self.overrides(settings)]
        each = [[*shared, *level] for level in self._levels[fresh][:n]]
        return compose_runs(each, list(settings), Composer())

    def search(self, trials: int) -> None:
        """Run the default and a number of trials. UserError as of a sweep, or if all fail."""
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        directions = ["maximize" if sign < 0 else "minimize" for sign in self.sign]
        sampler = optuna.samplers.TPESampler(seed=0)
        self.study = optuna.create_study(directions=directions, sampler=sampler)
        self._evaluate([self.default], False, None, "default")
        for start in range(0, trials, BATCH):
            numbers = range(start, min(start + BATCH, trials))
            asked = [self.study.ask(self.parameters) for _ in numbers]
            batch = [Trial(f"{o.number}", {k: f"{v}" for k, v in o.params.items()}) for o in asked]
            label = f"trials {start} to {numbers[-1]} of {trials}"
            self._evaluate(batch, False, self._first, label)
            best = [self.default, *self.front()] if self.default.state == "complete" else []
            for trial in (one for one in batch if one.state == "complete"):
                if any(self._is_worse(trial, other) for other in best):
                    trial.state = "stopped"
            self._evaluate([o for o in batch if o.state == "complete"], False, None, label)
            self.trials += batch
            states = optuna.trial.TrialState
            for one, trial in zip(asked, batch, strict=True):
                if trial.state == "complete":
                    self.study.tell(one, trial.means.tolist())
                else:
                    stopped = trial.state == "stopped"
                    self.study.tell(one, state=states.PRUNED if stopped else states.FAIL)
        if not self.front():
            last = self.trials[-1].state
            raise UserError(f"all trials failed or are worse than the default; the last {last}")

    def _evaluate(self, trials: Sequence[Trial], fresh: bool, n: int | None, label: str) -> None:
        """Give trials the values of their first n runs, or the reason of their failure."""
        runs, of = list[RunResult](), list[Trial]()
        for trial in trials:
            try:
                own = self._runs(trial.settings, fresh, n)
            except ConfigurationError as fault:
                trial.state = f"failed: {fault}"
                continue
            of += [trial] * len(own)
            runs += [one.numbered(len(runs) + one.index) for one in own]
        if not runs:
            return
        request = SweepRequest("", False, (), (), (), {"command": ""})
        results = Sweep(plan_runs(runs), None, request, label, visible=True).run().runs
        for trial in (one for one in trials if one in of):
            own = [run for run, owner in zip(results, of, strict=True) if owner is trial]
            trial.values = np.array(
                [[_value(n, run.metrics) for run in own] for n in self.objectives]
            )
            failed = [str(run.failure) for run in own if run.status != DONE]
            if failed or not np.isfinite(trial.values).all():
                reason = (*failed, "an objective has no value")[0]
                trial.state = f"failed: {' '.join(reason.split())}"

    def _is_worse(self, trial: Trial, other: Trial) -> bool:
        """Whether a trial is clearly worse on its runs, by every objective."""
        found = zip(self.answers([trial, other], other.name), self.sign, strict=True)
        rows = ((one.table.loc[trial.name], sign) for one, sign in found)
        return all(
            row["minus_low"] > 0.0 if sign > 0 else row["minus_high"] < 0.0 for row, sign in rows
        )

    def answers(self, trials: Sequence[Trial], reference: str, fresh: bool = False) -> list[Answer]:
        """For each objective, how trials compare with that named `reference`, on the same runs."""
        keys = [one.key for one in self._levels[fresh][0]]
        rows = []
        for trial in trials:
            levels = self._levels[fresh][: trial.values.shape[1]]
            for i, level in enumerate(levels):
                values = dict(zip(self.objectives, trial.values[:, i], strict=True))
                setting = {one.key: one.value_text for one in level}
                rows.append({"trial": trial.name, **setting, "status": DONE, **values})
        runs = Runs(pd.DataFrame(rows), ("trial", *keys))
        # Of a ratio the values are |log|.
        better = ["more" if sign < 0 else "less" for sign in self.sign]
        asked = {"compare": "trial", "over": [key for key in keys if key in self._drawn]}
        return [
            runs.ask(metric=name, better=one, reference=reference, **asked)
            for name, one in zip(self.objectives, better, strict=True)
        ]

    def front(self) -> list[Trial]:
        """The trials that no other is better than, the best of the first objective first."""
        found = [self.trials[one.number] for one in self.study.best_trials]
        return sorted(found, key=lambda one: tuple(self.sign * one.means))

    def chosen(self) -> Trial:
        """The trial of the front nearest to the best of each objective, in parts of its range."""
        costs = np.array([self.sign * one.means for one in self.front()])
        scaled = (costs - costs.min(axis=0)) / np.maximum(np.ptp(costs, axis=0), 1e-12)
        return self.front()[int(np.argmin((scaled**2).sum(axis=1)))]

    def gain(self, trial: Trial) -> list[Answer]:
        """For each objective, how a trial compares with the default on the fresh seeds.

        UserError if a run fails.
        """
        both = Trial("default"), Trial(trial.name, trial.settings)
        self._evaluate(both, True, None, "fresh seeds")
        for one in (one for one in both if one.state != "complete"):
            raise UserError(f"{one.name} on the fresh seeds {one.state}")
        return self.answers(both, "default", fresh=True)


def is_drawn(one: Override) -> bool:
    """Whether an override gives a seed or a shape seed a number."""
    return one.key.endswith(SEED) and isinstance(one.value, int)


def _check_objectives(names: Sequence[str]) -> None:
    for name in names:
        if name not in METRICS:
            hint = suggestion(name, METRICS) or "; metrics are in metrics.json"
            raise ConfigurationError(f"--objective: {printable(name)}: no such metric{hint}")
        if metric(name).better is None:
            raise ConfigurationError(f"--objective: {name}: no value of it is better")
    if not 1 <= len(names) <= 2 or len({*names}) < len(names):
        raise ConfigurationError("--objective: must be one metric, or two different ones")


def _value(name: str, metrics: Mapping[str, Any]) -> float:
    """A metric of a run; |log| of a ratio that should be 1; NaN without a value."""
    value = metrics.get(name)
    if metric(name).better == "one":
        return abs(math.log(value)) if value else math.nan
    return math.nan if value is None else float(value)


def write_outcome(folder: Path, tuning: Tuning, command: str) -> tuple[Trial, list[Answer]]:
    """Write the files, with the gain on fresh seeds; the chosen trial and the answers of the gain.

    `command` writes them again. UserError if a run on a fresh seed fails.
    """
    best, trials = tuning.chosen(), trials_frame(tuning)
    gain = tuning.gain(best)
    page = page_template(__package__, "tune.html").render(
        title=folder.resolve().name,
        chosen=best,
        gain=[(label(one.question.metric), one.sentence) for one in gain],
        gain_figures=[drawing_for_page(differences(one), f"g{i}") for i, one in enumerate(gain)],
        cells=cells_of(trials),
        parameters=_parameters(tuning, best),
        command=command,
    )
    files = {"preset/experiment/tuned.yaml": preset_text(tuning, best, command)}
    files |= {"trials.csv": trials.to_csv(index=False, lineterminator="\n"), PAGE: page}
    with written(folder):
        write_below(folder, files)
    return best, gain


def label(name: str) -> str:
    """An objective with its better direction."""
    row = metric(name)
    unit = f" ({row.unit})" if row.unit else ""
    text = f"|log({row.short_label})|" if row.better == "one" else row.short_label + unit
    return f"{text}, {'more' if row.better == 'more' else 'less'} is better"


def trials_frame(tuning: Tuning) -> pd.DataFrame:
    """One row for the default and for each trial, with its means so far."""
    front = tuning.front()
    return pd.DataFrame(
        {"trial": one.name, "state": "on the front" if one in front else one.state}
        | dict.fromkeys(tuning.parameters)
        | {override.key: override.value for override in tuning.overrides(one.settings)}
        | dict(zip(tuning.objectives, one.means.tolist() if one.values.size else (), strict=False))
        for one in (tuning.default, *tuning.trials)
    )


def preset_text(tuning: Tuning, trial: Trial, command: str) -> str:
    """The experiment with the options and values of a trial, without seeds."""
    given = [*tuning.fixed, *tuning.overrides(trial.settings)]
    given = [one for one in given if not of_the_machine(one.key)]
    options = {one.key: one.value for one in given if one.key in group_options()}
    content: dict[str, Any] = {
        "defaults": [
            *({f"override /{k}": o} for k, o in options.items() if "/" not in k),
            "_self_",
        ],
        "inner_options": {k: o for k, o in options.items() if "/" in k},
    }
    for one in (one for one in given if one.key not in options):
        *parts, last = one.key.split(".")
        section = content
        for part in parts:
            section = section.setdefault(part, {})
        section[last] = one.value
    content["sources"] = dict.fromkeys(trial.settings, f"tuned: {command}")
    return f"# @package _global_\n{yaml_text(content)}"


def _parameters(tuning: Tuning, trial: Trial) -> Cells:
    """The values of a trial, with the importance of each parameter for each objective."""
    shares = [_importance(tuning, i) for i in range(len(tuning.objectives))]
    names = (f"importance for {metric(name).short_label}" for name in tuning.objectives)
    rows = (
        (key, value, *(number(own.get(key), 2) for own in shares))
        for key, value in trial.settings.items()
    )
    return Cells(("parameter", "value", *names), tuple(rows), numbers=(2, 3))


def _importance(tuning: Tuning, i: int) -> dict[str, float]:
    """Each parameter's share of an objective's variance (fANOVA); empty where it is unknown."""
    from optuna.importance import FanovaImportanceEvaluator, get_param_importances

    if len({one.means[i] for one in tuning.trials if one.state == "complete"}) < 2:
        return {}
    evaluator = FanovaImportanceEvaluator(seed=0)
    return get_param_importances(tuning.study, evaluator=evaluator, target=lambda t: t.values[i])
