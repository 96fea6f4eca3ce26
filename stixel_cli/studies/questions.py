"""The questions of a study: read from its file, and asked of the runs of its sweeps."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Annotated, Any, Literal

import pandas as pd
from pydantic import BeforeValidator, StringConstraints

from stixel_cli.answers.render import INTERVAL, Cells, overview
from stixel_cli.answers.runs import Answer, Runs, combined
from stixel_cli.config import messages
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.evaluation.metric_table import MAIN, METRICS
from stixel_cli.parameters import parameters
from stixel_cli.results.result import listed

NAME = "^[A-Za-z][A-Za-z0-9_]{0,59}$"
"""Of a sweep or a question: it is in names of folders and files, and in messages."""
PLACE = re.compile(r"\{([A-Za-z_][A-Za-z0-9_]*)\}")
"""A question's name in a study's text."""


def _texts(given: Any) -> Any:
    given = [given] if isinstance(given, str) else given
    return tuple(given) if isinstance(given, list) else given


def _values(given: Any) -> tuple[str, ...]:
    return tuple(map(str, given if isinstance(given, list) else [given]))


Texts = Annotated[tuple[str, ...], BeforeValidator(_texts)]
"""A text, or a list of texts."""


@parameters
class StudyQuestion:
    """A question of a study's file.

    Attributes:
        heading, note: of its section.
        sweeps: whose runs are asked.
        where: column to the values, as texts, that the runs have there.
        by: columns; there is an answer for each combination of their values.
        compare, within, over, better, reference: as in `answers.runs.Runs.question`.
        metrics: the main one first.
    """

    name: Annotated[str, StringConstraints(pattern=NAME)]
    heading: str
    sweeps: Texts
    note: str = ""
    where: dict[str, Annotated[tuple[str, ...], BeforeValidator(_values)]] = field(
        default_factory=dict
    )
    by: Texts = ()
    compare: Texts = ("tracker",)
    within: Texts | None = None
    over: Texts | None = None
    metrics: Texts = MAIN
    better: Literal["more", "less", "one"] | None = None
    reference: Annotated[str, BeforeValidator(str)] | None = None


ENTRIES = tuple(one.name for one in fields(StudyQuestion) if one.name != "name")


@dataclass(frozen=True)
class Section:
    """The answers of a question: the label of each group of runs ("" for one), and an answer for
    each metric that the group has."""

    question: StudyQuestion
    groups: tuple[tuple[str, tuple[Answer, ...]], ...]

    @property
    def brief(self) -> str:
        """What the main metric's answers say, in a few words for each group."""
        answers = [(label, own[0]) for label, own in self.groups]
        parts = [f"{label}: {one.brief}" if label else one.brief for label, one in answers]
        text = "; ".join(parts) or "no run has a value"
        lacking = listed([*dict.fromkeys(one.lacking for _, one in answers if one.lacking)])
        return f"{text} ({lacking})" if lacking else text

    @property
    def cells(self) -> Cells:
        """One table of all groups."""
        return joined(
            " ".join(self.question.by), [(label, overview(own)) for label, own in self.groups]
        )

    @cached_property
    def drawings(self) -> list[bytes]:
        """The figure of each group, an SVG, for the page and for a file of its own."""
        from stixel_cli.answers.figures import drawing

        return [drawing(own[0]) for _, own in self.groups]


def study_question(name: Any, entries: Any, sweeps: Sequence[str]) -> StudyQuestion:
    """A question of a file; ConfigurationError in one line that names it and the entry."""
    where = f"questions: {messages.printable(str(name))}"
    if not isinstance(entries, dict):
        raise ConfigurationError(f"{where}: must have entries, as KEY: VALUE")
    given = {key: value for key, value in entries.items() if value is not None}
    default = {"heading": str(name).replace("_", " ").capitalize(), "sweeps": [*sweeps]}
    entries = {**default, **given, "name": name}
    question = messages.validated(StudyQuestion, entries, where, ENTRIES)
    for one in (one for one in question.sweeps if one not in sweeps):
        raise ConfigurationError(f"{where}: sweeps: there is no sweep {messages.printable(one)}")
    return replace(question, note=" ".join(question.note.split()))


def asked(question: StudyQuestion, frames: Mapping[str, Runs]) -> Section:
    """The answers of a question; a group without a run, and a metric without a value, has none.

    Raises:
        UserError: in one line that names the question: for a name that is no column of the runs,
            and as of `Runs.ask`.
    """
    parts = {name: frames[name] for name in question.sweeps}
    axes = tuple(dict.fromkeys(axis for part in parts.values() for axis in part.axes))
    whole = pd.concat(
        [part.frame.assign(sweep=name) for name, part in parts.items()], ignore_index=True
    )
    _check_columns(question, whole)
    for column, values in question.where.items():
        whole = whole[whole[column].astype(str).isin(values)]
    axes = tuple(axis for axis in axes if axis not in question.by)
    by = list(question.by)
    groups = whole.groupby(by, sort=False, observed=True) if by else [((), whole)]
    found = []
    for key, own in groups:
        runs = Runs(own, tuple(axis for axis in axes if own[axis].notna().any()))
        label = " ".join(map(str, key))
        metrics = [name for name in question.metrics if name in runs.metrics]
        try:
            answers = tuple(runs.ask(metric=name, **_parts(question, runs)) for name in metrics)
        except UserError as fault:
            raise UserError(f"questions: {question.name}: {fault}") from None
        if answers:
            found.append((label, answers))
    return Section(question, tuple(found))


def _check_columns(question: StudyQuestion, whole: pd.DataFrame) -> None:
    """Refuse a name that is no column, where `Runs.ask` does not."""
    metrics = (name for name in question.metrics if name not in METRICS)
    named = (*question.where, *question.by, *question.compare, *metrics)
    for name in (name for name in named if name not in whole):
        raise UserError(
            f"questions: {question.name}: {messages.printable(name)}: no such column of the runs"
            f"{messages.suggestion(name, [*whole])}"
        )


def _parts(question: StudyQuestion, runs: Runs) -> dict[str, Any]:
    """The parts of a question that a group of runs can answer; it may lack the reference."""
    parts = {"compare": question.compare, "better": question.better}
    if question.reference in set(combined(runs.frame, question.compare)):
        parts["reference"] = question.reference
    given = {"within": question.within, "over": question.over}
    return parts | {name: columns for name, columns in given.items() if columns is not None}


def joined(heading: str, tables: Sequence[tuple[str, Cells]]) -> Cells:
    """One table of several, each with its label in a first column; columns by their headers.

    A group of few units has no intervals: its values are in the same column as the others'.
    """
    shown: dict[str, str] = {}
    for name in (name for _, cells in tables for name in cells.header):
        if name.endswith(INTERVAL) or name not in shown:
            shown[name.removesuffix(INTERVAL)] = name
    header, rows, best = list(shown.values()), [], []
    for label, cells in tables:
        names = [name.removesuffix(INTERVAL) for name in cells.header]
        for row, marks in zip(cells.rows, cells.best, strict=True):
            texts, marked = (dict(zip(names, each, strict=True)) for each in (row, marks))
            rows.append((label, *(texts.get(name, "–") for name in shown)))
            best.append((False, *(marked.get(name, False) for name in shown)))
    numbers = tuple(range(2, len(header) + 1))
    if not heading:
        rows, best = [row[1:] for row in rows], [marks[1:] for marks in best]
        return Cells(tuple(header), tuple(rows), tuple(best), tuple(range(1, len(header))))
    return Cells((heading.replace("_", " "), *header), tuple(rows), tuple(best), numbers)
