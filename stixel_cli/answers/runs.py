"""Many runs as one tidy frame, of which questions are asked, and the answers.

A sweep, a study, several folders, a tuning and a pack of the benchmark all become `Runs`: one row a
run, with its settings, its status and its metrics as columns. Nothing here knows where they come
from.

The rules: a cell (scenario, unit) counts if every option has a value there. Of two rectangles the
larger one is used: the scenarios that have every unit, or the units that have every scenario. The
value of a unit is the mean over its scenarios. Differences are paired by unit. Failed runs stay in
the table, and count as lost. Without an interval nothing is claimed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from stixel_cli.errors import UserError, counted, printable
from stixel_cli.evaluation.intervals import LEAST_UNITS, mean_interval, share_interval
from stixel_cli.evaluation.metric_table import (
    LOSS_RATE,
    MAIN,
    METRICS,
    NO_VALUE,
    Metric,
    main_first,
    metric,
    over_runs,
)
from stixel_cli.report.metrics import with_interval
from stixel_cli.results.result import FAILED, MISSING, SKIPPED, listed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


STATUS, LOST, FOLDER, ERROR = "status", "track_lost", "folder", "error"
"""Columns of a frame of runs that are neither settings nor asked about."""


@dataclass(frozen=True)
class Question:
    """What is asked of many runs."""

    compare: tuple[str, ...]
    """Columns whose combinations of values are the options."""
    within: tuple[str, ...]
    """Columns whose combinations are scenarios, of equal weight."""
    over: tuple[str, ...]
    """Columns whose combinations are the units of statistics."""
    metric: str
    """The column of the values."""
    better: str | None = None
    """"more" or "less"; "one" for a ratio that should be 1; None as the table of metrics."""
    reference: object = None
    """The option that others are compared with; None for the best one."""

    @property
    def named(self) -> str:
        """The compared columns in one text; "option" where all runs are one."""
        return " ".join(self.compare) or "option"

    @property
    def row(self) -> Metric:
        """Label, unit, bounds and better direction of the metric's mean over runs."""
        row = metric(over_runs(self.metric))
        return row if self.better is None else replace(row, better=self.better)


MOST_NAMED = 4
MEAN, MINUS = ["mean", "low", "high"], ["minus", "minus_low", "minus_high"]
"""Columns of an answer's table: of the values, and of the differences."""
LONGEST_NAME = 32
"""Letters of a line of an option's name in headers and figures."""
_OPTION, _SCENARIO, _UNIT, _VALUE = "option", "scenario", "unit", "value"


@dataclass(frozen=True, eq=False, repr=False)
class Answer:
    """The answer to a question about many runs.

    Attributes:
        table: one row an option, in their order. Columns: `runs`, `failed`, `lost_share` of all
            runs; `mean` with its interval `low`, `high`; `minus`, the mean of the paired
            differences from the best option (or the reference), with its interval `minus_low`,
            `minus_high`. NaN where there is none.
        best: the option with the best mean; None without a mean, or if no value is better.
        shown: whether every other option's interval excludes 0.
        units: number of units that the means are over.
        left_out: number of cells (scenario, unit) that are left out, because an option lacks them.
        values: of each unit (row) and option (column).
        scenarios: the scenarios that the means are over.
        runs: the frame with the columns `option`, `scenario` and `unit` as texts or values.
    """

    question: Question
    table: pd.DataFrame
    best: object
    shown: bool
    units: int
    left_out: int
    values: pd.DataFrame
    scenarios: tuple[str, ...]
    runs: pd.DataFrame

    def __repr__(self) -> str:
        return f"<Answer: {' '.join([self.sentence, *self.notes])}>"

    @property
    def order(self) -> list:
        """The options from the best to the worst; those without a value last.

        From the least to the greatest value where none is better.
        """
        costs = _costs(self.table["mean"], self.question.row.better)
        return [*costs.sort_values(kind="stable").index]

    @property
    def used(self) -> int:
        """Number of runs of each option with a value that the means are over."""
        return self.units * len(self.scenarios)

    @property
    def over(self) -> str:
        """What the means are over: "8 seeds, each the mean of 2 paths"."""
        names = [name.rpartition(".")[2].replace("_", " ") for name in self.question.over]
        units, scenarios = self.runs[_UNIT].nunique(), self.runs[_SCENARIO].nunique()
        text = _part(self.units, units, names[0] if len(names) == 1 else "combination")
        if not names:
            text = "one run each"
        elif len(names) > 1:
            text += f" of {listed(names)}"
        if len(self.scenarios) > 1:
            within = self.question.within
            word = within[0].rpartition(".")[2] if len(within) == 1 else "scenario"
            of = _part(len(self.scenarios), scenarios, word.replace("_", " "))
            text += f", each the mean of {of}"
        elif self.scenarios and scenarios > 1:
            text += f", {listed(self.scenarios)} only"
        return text

    @property
    def lacking(self) -> str:
        """How many more units a comparison needs; "" if it has enough, or nothing is compared."""
        if self.values.shape[1] < 2 or self.units >= LEAST_UNITS:
            return ""
        return f"{self.over}: too few to compare, {LEAST_UNITS} are needed"

    @property
    def notes(self) -> list[str]:
        """What is left out, and what has failed, each in one sentence."""
        found, runs, over = [], self.runs, self.question.over
        if self.left_out:
            kept = runs[_SCENARIO].isin(self.scenarios), runs[_UNIT].isin(self.values.index)
            out = [*runs.loc[~kept[0], _SCENARIO].unique()]
            if not out:
                key = over[0] if len(over) == 1 else ""
                out = [with_key(key, unit) for unit in runs.loc[~kept[1], _UNIT].unique()]
            has = runs[~(kept[0] & kept[1])].groupby(_OPTION)[_VALUE].count()
            has = has.reindex(self.values.columns, fill_value=0)
            lack = [self.name(option) for option in has.index[has < self.left_out]]
            lacks = f"lack{'s' if len(lack) == 1 else ''} values"
            found.append(f"Left out: {_first_of(out)}, where {_first_of(lack)} {lacks}.")
        none = [self.name(option) for option in self.table.index.difference(self.values.columns)]
        if none and len(self.values.columns):
            found.append(f"Not compared: {_first_of(none)}, without a value.")
        failed = self.table[self.table["failed"] > 0]
        if len(failed):
            counts = failed[["failed", "runs"]].itertuples(name=None)
            named = [f"{self.name(one)} {n} of {counted(of, 'run')}" for one, n, of in counts]
            lost = "counted as lost in the track loss rate, and in no other value"
            found.append(f"Failed: {_first_of(named)}; {lost}.")
        return found

    @cached_property
    def sentence(self) -> str:
        """The answer in one sentence, with its numbers."""
        label = self.question.row.short_label
        return (
            f"{label[:1].upper()}{label[1:]}: {self._said(f' ({self.lacking or self.over})', ';')}."
        )

    @property
    def brief(self) -> str:
        """The answer without its metric and units, to follow a label in a longer sentence."""
        return self._said("", ",")

    def _said(self, over: str, then: str) -> str:
        """What the values show, `over` which units, and `then` between two of its parts."""
        means = self.table["mean"].dropna()
        heard = [option for option in self.order if option in means]
        reference = self.question.reference
        if not heard:
            unit = " and ".join(self.question.over) or "unit"
            common = f"not compared, as each scenario, and each {unit}, lacks a value of an option"
            return common if len(self.values.columns) else "no run has a value"
        if len(heard) == 1 or self.lacking or (self.best is None and reference is None):
            return self._named(heard) + over
        if reference is not None:
            others = [option for option in heard if option != reference]
            parts = [f"{self.name(option)} {self._value(option, MINUS, True)}" for option in others]
            against = f"against {self.name(reference)} ({self._value(reference)})"
            return f"{_first_of(parts)} {against}{over}"
        first, second = self._named(heard[:1]), heard[1]
        same = [self.name(option) for option in heard[1:] if not self.differs[option]]
        if same:
            worse = [self.name(option) for option in heard[1:] if self.differs[option]]
            others = f"{then} worse: {_first_of(worse)}" if worse and over else ""
            return f"{first}{over}{then} not shown to differ: {_first_of(same)}{others}"
        minus = self._value(second, MINUS, True)
        return f"{first} is the best{over}{then} {self.name(second)} is next, {minus}"

    @property
    def worst(self) -> pd.DataFrame:
        """The row of the worst run of each option that has one; a failed one comes first."""
        failed = self.runs[STATUS].isin((FAILED, SKIPPED))
        costs = _costs(self.runs[_VALUE], self.question.row.better).mask(failed, np.inf)
        chosen = costs.dropna().groupby(self.runs[_OPTION], sort=False).idxmax()
        return self.runs.loc[chosen].set_index(_OPTION, drop=False)

    def by_scenario(self) -> pd.DataFrame:
        """The mean of each scenario (row) and option (column).

        It is over the units that every option with a value there has. NaN without one.
        """
        cells = self.runs.pivot(index=[_SCENARIO, _UNIT], columns=_OPTION, values=_VALUE)
        each = cells.groupby(level=0, sort=False)
        means = {name: own.dropna(axis=1, how="all").dropna().mean() for name, own in each}
        found = pd.DataFrame(means, index=self.table.index).T.rename_axis(_SCENARIO)
        return found.reindex(self.runs[_SCENARIO].unique())

    def figure(self) -> "Figure":
        """The values of each option, and below them the paired differences."""
        from stixel_cli.answers.figures import differences

        return differences(self, lambda figure: figure)

    def to_latex(self, caption: str = "", label: str = "") -> str:
        """The table of the options in LaTeX, for the package booktabs."""
        from stixel_cli.answers.render import latex

        return latex([self], caption, label)

    @property
    def against(self) -> str:
        """What differences are from, as the header of a column names it."""
        reference = self.question.reference
        of, word = (self.best, "best") if reference is None else (reference, "reference")
        return str(of) if len(str(of)) <= LONGEST_NAME // 2 else f"the {word}"

    def name(self, option: object) -> str:
        """An option in a sentence: a number with its key, which tells it from the values."""
        compare = self.question.compare
        return with_key(compare[0], option) if len(compare) == 1 else str(option)

    def _named(self, options: Sequence) -> str:
        return _first_of([f"{self.name(option)} {self._value(option)}" for option in options])

    def _value(self, option: object, columns: Sequence[str] = MEAN, sign: bool = False) -> str:
        values = known(self.table.loc[option, columns])
        return with_interval(*values, self.question.row.unit, sign=sign)

    @cached_property
    def differs(self) -> dict[object, bool]:
        """Whether the interval of each option's difference excludes 0."""
        return ((self.table["minus_low"] > 0.0) | (self.table["minus_high"] < 0.0)).to_dict()


@dataclass(frozen=True, eq=False)
class Groups:
    """The runs of a frame by option, scenario and unit, for the answers of all its metrics."""

    runs: pd.DataFrame
    """The frame with the columns option, scenario and unit."""
    failed: pd.Series
    """Whether each run failed, or was skipped."""
    cells: tuple[np.ndarray, np.ndarray, np.ndarray]
    """Numbers of the option, scenario and unit of each run."""
    options: pd.Index
    scenarios: pd.Index
    units: pd.Index
    """Their values."""
    table: pd.DataFrame
    """One row an option, with the columns `runs`, `failed`, `lost_share`."""


def grouped(frame: pd.DataFrame, question: Question) -> Groups:
    """The groups of a question, whatever its metric; UserError for runs that are equal."""
    named = {_OPTION: question.compare, _SCENARIO: question.within, _UNIT: question.over}
    runs = frame.reset_index(drop=True)
    runs = runs.assign(**{name: combined(runs, columns) for name, columns in named.items()})
    twice = runs[runs[[*named]].duplicated()]
    if len(twice):
        what = " ".join(str(twice.iloc[0][name]) for name, keys in named.items() if keys)
        raise UserError(
            f"runs: two are {printable(what or 'equal', 120)}: name the column in which they "
            "differ in compare, within or over"
        )
    cells, values = zip(*(pd.factorize(runs[name]) for name in named), strict=True)
    failed = runs[STATUS].isin((FAILED, SKIPPED))
    lost = failed | (runs[LOST].fillna(0) > 0) if LOST in runs else failed
    by_option = pd.DataFrame({"runs": 1, "failed": failed, "lost_share": lost})
    of_options = by_option.groupby(runs[_OPTION], sort=False)
    table = of_options.agg({"runs": "sum", "failed": "sum", "lost_share": "mean"})
    return Groups(runs, failed, cells, *values, table)


def answered(groups: Groups, question: Question) -> Answer:
    """The answer to a question about runs in its groups, see `Runs.ask`."""
    options, scenarios, units, row = groups.options, groups.scenarios, groups.units, question.row
    try:
        value = groups.runs[question.metric].astype(float)
    except ValueError:
        raise UserError(f"{printable(question.metric, 60)}: must be a column of numbers") from None
    value = value.where(~groups.failed & (groups.runs[STATUS] != MISSING))
    if question.metric == LOST:
        value = value.mask(groups.failed, 1.0)
    cells = np.full((len(options), len(scenarios), len(units)), np.nan)
    cells[groups.cells] = value
    has = np.isfinite(cells)
    heard = has.any(axis=(1, 2))
    columns, rows = _rectangle(has[heard].all(axis=0)) if heard.any() else ([], [])
    if not len(columns):
        rows = []
    used = cells[heard][:, columns][:, :, rows]
    means = used.mean(axis=1).T if len(rows) else np.empty((0, int(heard.sum())))
    values = pd.DataFrame(means, index=units[rows], columns=options[heard])
    mean = values.mean()
    interval = (
        share_interval(values) if row.name == LOSS_RATE else mean_interval(values, row.bounds)
    )
    is_ranked = row.better in ("more", "less") and mean.notna().any()
    best = _costs(mean, row.better).idxmin() if is_ranked else None
    reference = question.reference if question.reference is not None else best
    if question.reference is not None and reference not in values:
        raise UserError(f"reference: {printable(str(reference), 60)}: no option with a value")
    shown, minus, ends = False, pd.DataFrame(), pd.DataFrame(columns=["low", "high"])
    if reference is not None and values.shape[1] > 1:
        tests = values.shape[1] - 1 if question.reference is None else 1
        minus = values.drop(columns=reference).sub(values[reference], axis=0)
        ends = mean_interval(minus, tests=tests)
        shown = bool(((ends["low"] > 0.0) | (ends["high"] < 0.0)).all())
    found = {
        **{"mean": mean, "low": interval["low"], "high": interval["high"]},
        **{"minus": minus.mean(), "minus_low": ends["low"], "minus_high": ends["high"]},
    }
    table = groups.table.join(pd.DataFrame(found, index=options, dtype=float))
    return Answer(
        question=question,
        table=table,
        best=best,
        shown=shown,
        units=len(rows),
        left_out=len(scenarios) * len(units) - len(columns) * len(rows),
        values=values,
        scenarios=tuple(scenarios[columns]),
        runs=groups.runs.assign(**{_VALUE: value}),
    )


def combined(runs: pd.DataFrame, names: Sequence[str]) -> pd.Series:
    """The values of one column, or the texts of several; – for a value that is missing."""
    columns = [runs[name] for name in names]
    columns = [one.astype(object).fillna(NO_VALUE) if one.hasnans else one for one in columns]
    if len(columns) == 1:
        return columns[0]
    if not columns:
        return pd.Series("all runs", runs.index)
    named = zip(names, columns, strict=True)
    texts = [[with_key(name, value) for value in one] for name, one in named]
    return pd.Series([" ".join(row) for row in zip(*texts, strict=True)], runs.index)


def _part(kept: int, every: int, word: str) -> str:
    return counted(every, word) if kept == every else f"{kept} of {counted(every, word)}"


def _first_of(texts: Sequence[object]) -> str:
    """The first ones in words, and how many more there are: two or more, as one has a name."""
    more = len(texts) - MOST_NAMED
    named = [*texts[:MOST_NAMED], f"{more} more"] if more > 1 else texts
    return listed(named)


def with_key(key: str, value: object) -> str:
    """A value in a text: a number with its key, which tells it from other numbers."""
    text = str(value)
    is_number = text.strip("+-")[:1].isdigit()
    return f"{key.rpartition('.')[2]}={text}" if is_number else text


def _rectangle(known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the scenarios (rows) and units (columns) of the larger rectangle of known ones."""
    whole, full = np.flatnonzero(known.all(axis=1)), np.flatnonzero(known.all(axis=0))
    scenarios, units = known.shape
    if len(whole) * units >= len(full) * scenarios:
        return whole, np.arange(units)
    return np.arange(scenarios), full


def _costs(values: pd.Series, better: str | None) -> pd.Series:
    """The values, turned so that less is better; NaN for a ratio that is not positive."""
    if better == "one":
        return np.log(values.where(values > 0.0)).abs()
    return -values if better == "more" else values


def known(values: pd.Series) -> list[float | None]:
    """Numbers in plain types, None for those that are not finite."""
    return [float(value) if np.isfinite(value) else None for value in values]


SCENE = ("road_user", "path", "pace", "ego", "world", "road", "source", "measurement", "rig")
"""Groups whose axes are scenarios, unless nothing else differs between the runs."""

SHOWN = (*MAIN, "nees_position_mean")
"""The metrics that an answer is about, the first first."""


@dataclass(frozen=True, eq=False)
class Runs:
    """A frame of runs.

    Attributes:
        frame: one row a run; `status` is "done", "failed", "skipped" or "missing". Columns that it
            may have: `folder` and `error`, texts. Metrics are numbers, NaN without a value.
        axes: the columns that differ between the runs, such as ("tracker", "path", "seed"); by
            default the columns before `status`.
        default: the parts of the question that is asked where a call gives no others.
    """

    frame: pd.DataFrame
    axes: tuple[str, ...] = ()
    default: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        if STATUS not in self.frame:
            raise UserError(f"runs: the column {STATUS} is missing: done, failed, … of each run")
        if not self.axes:
            columns = [str(name) for name in self.frame.columns]
            object.__setattr__(self, "axes", tuple(columns[: columns.index(STATUS)]))

    def __len__(self) -> int:
        """The number of runs."""
        return len(self.frame)

    def _repr_html_(self) -> str:
        """What a notebook shows: the frame."""
        return self.frame._repr_html_()

    @cached_property
    def metrics(self) -> list[str]:
        """The metrics with a value, those of `MAIN` first."""
        others = [name for name in self.frame if name not in (*self.axes, STATUS)]
        numbers = self.frame[others].select_dtypes("number").dropna(axis=1, how="all")
        known = [*(n for n in METRICS if n in numbers), *(n for n in numbers if n not in METRICS)]
        return main_first(known)

    def question(
        self,
        compare: str | Sequence[str] | None = None,
        within: str | Sequence[str] | None = None,
        over: str | Sequence[str] | None = None,
        metric: str | None = None,
        better: str | None = None,
        reference: object = None,
    ) -> Question:
        """The question with the parts that are not given filled in.

        Args:
            compare: axes whose values are the options; by default those that change no scene, or
                else the first one; of runs that differ by their seeds alone there is one option.
            within: axes whose combinations are scenarios, of equal weight; by default all others.
            over: axes whose combinations are the units of statistics; by default the seeds.
            metric: by default the first of the main ones that the runs have.
            better: "more", "less" or "one"; by default as the table of metrics says.
            reference: the option that others are compared with; None for the best one.

        UserError for a column that is missing, an axis that is named twice, or another `better`.
        """
        over = _names(over, [name for name in self.axes if name.endswith("seed")])
        rest = [name for name in self.axes if name not in over]
        if within is not None:
            rest = [name for name in rest if name not in _names(within, ())]
        own = [name for name in rest if name.split(".")[0] not in SCENE]
        compare = _names(compare, own or rest[:1])
        within = _names(within, [name for name in rest if name not in compare])
        metric = metric or next(iter(self.metrics), "")
        for name in (*compare, *within, *over, metric):
            if name not in self.frame:
                known = ", ".join([*self.axes, *self.metrics[:8]])
                raise UserError(
                    f"{printable(name or 'metric', 60)}: no such column; there are {known}"
                )
        named = [*compare, *within, *over]
        if better not in (None, "more", "less", "one"):
            raise UserError(f"better: {printable(str(better), 60)}: must be more, less or one")
        twice = next((name for name in named if named.count(name) > 1), None)
        if twice is not None:
            raise UserError(f"{printable(twice, 60)}: is in two of compare, within and over")
        return Question(compare, within, over, metric, better, reference)

    def ask(self, **parts: Any) -> Answer:
        """The answer of a question; `parts` as in `question`, those that are None as by default.

        UserError as in `question`; for a reference that is no option, or runs that are equal in all
        of compare, within and over.
        """
        parts = {name: value for name, value in parts.items() if value is not None}
        default = dict(self.default)
        if {*parts} & {"compare", "within", "over"}:
            # The options and scenarios follow from what is given; the units stay.
            default = {name: own for name, own in default.items() if name == "over"}
        question = self.question(**default | parts)
        named = question.compare, question.within, question.over
        if named not in self._groups:
            self._groups[named] = grouped(self.frame, question)
        if question not in self._answers:
            self._answers[question] = answered(self._groups[named], question)
        return self._answers[question]

    def answers(self, metrics: Sequence[str] = (), **parts: Any) -> list[Answer]:
        """The answers of one comparison by the given metrics, by default the main ones."""
        names = metrics or [n for n in SHOWN if n in self.metrics] or self.metrics[:4]
        return [self.ask(metric=name, **parts) for name in names]

    def table(self, metrics: Sequence[str] = (), form: str = "md", **parts: Any) -> str:
        """One table of the options and metrics, in Markdown (md), LaTeX (tex) or CSV (csv)."""
        from stixel_cli.answers.render import TABLES

        return TABLES[form](self.answers(metrics, **parts))

    @cached_property
    def _groups(self) -> dict[tuple, Groups]:
        """The groups by the columns of a question: its metrics share them."""
        return {}

    @cached_property
    def _answers(self) -> dict[Question, Answer]:
        """The answers so far: the table, the page and the terminal ask the same."""
        return {}


def _names(given: str | Sequence[str] | None, default: Sequence[str]) -> tuple[str, ...]:
    if given is None:
        return tuple(default)
    return (given,) if isinstance(given, str) else tuple(given)
