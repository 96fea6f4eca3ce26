"""Many runs as one tidy frame, of which questions are asked.

A sweep, a study, several folders, a tuning and a pack of the benchmark all become `Runs`: one row a
run, with its settings, its status and its metrics as columns. Nothing here knows where they come
from.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import pandas as pd

from stixel_cli.answers.answer import STATUS, Answer, Groups, Question, answered, grouped
from stixel_cli.errors import UserError, printable
from stixel_cli.evaluation.metric_table import MAIN, METRICS, main_first

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
            better: "more", "less" or None; by default as the table of metrics says.
            reference: the option that others are compared with; None for the best one.

        Raises:
            UserError: for a column that the frame does not have, or an axis that is named twice.
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
        twice = next((name for name in named if named.count(name) > 1), None)
        if twice is not None:
            raise UserError(f"{printable(twice, 60)}: is in two of compare, within and over")
        return Question(compare, within, over, metric, better, reference)

    def ask(self, **parts: Any) -> Answer:
        """The answer of a question; `parts` as in `question`, those that are None as by default.

        Raises:
            UserError: as in `question`; for a reference that is no option, or runs that are equal
                in all of compare, within and over.
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

    answer = ask

    def answers(self, metrics: Sequence[str] = (), **parts: Any) -> list[Answer]:
        """The answers of one comparison by the given metrics, by default the main ones."""
        names = metrics or [n for n in SHOWN if n in self.metrics] or self.metrics[:4]
        return [self.ask(metric=name, **parts) for name in names]

    def table(self, metrics: Sequence[str] = (), form: str = "md", **parts: Any) -> str:
        """One table of the options and metrics, in Markdown (md), LaTeX (tex) or CSV (csv)."""
        from stixel_cli.answers.render import TABLES

        return TABLES[form](self.answers(metrics, **parts))

    def figure(self, **parts: Any) -> "Figure":
        """The figure of the answer of a question, see `Answer.figure`."""
        return self.ask(**parts).figure()

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
