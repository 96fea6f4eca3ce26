"""Many runs as one tidy frame, of which questions are asked.

A sweep, a study, several folders, a tuning and a pack of the benchmark all become `Runs`: one row a
run, with its settings, its status and its metrics as columns. Nothing here knows where they come
from.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from stixel_cli.answers.answer import Answer, Groups, answered, grouped
from stixel_cli.answers.question import STATUS, Question
from stixel_cli.errors import UserError, printable
from stixel_cli.evaluation.metric_table import MAIN, METRICS, main_first

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
    """

    frame: pd.DataFrame
    axes: tuple[str, ...] = ()

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
        """The answer of a question; `parts` as in `question`.

        Raises:
            UserError: as in `question`; for a reference that is no option, or runs that are equal
                in all of compare, within and over.
        """
        question = self.question(**parts)
        named = question.compare, question.within, question.over
        if named not in self._groups:
            self._groups[named] = grouped(self.frame, question)
        return answered(self._groups[named], question)

    @cached_property
    def _groups(self) -> dict[tuple, Groups]:
        """The groups by the columns of a question: its metrics share them."""
        return {}


def _names(given: str | Sequence[str] | None, default: Sequence[str]) -> tuple[str, ...]:
    if given is None:
        return tuple(default)
    return (given,) if isinstance(given, str) else tuple(given)
