"""Answers as text: the cells of one table of options and metrics, and each format of a table."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from stixel_cli.answers.runs import MEAN, MINUS, Answer, known
from stixel_cli.errors import counted
from stixel_cli.evaluation.intervals import LEAST_UNITS
from stixel_cli.report.metrics import number, with_interval

INTERVAL = " [95 %]"
"""End of the header of cells with an interval."""
INTERVALS = (
    "; in brackets its 95 % interval (Student's t on a scale on which all values are possible; "
    f"Wilson's for the track loss rate; none below {LEAST_UNITS} units). The best is marked where "
    "the paired differences of all others exclude 0, together with 95 % (Bonferroni)."
)
_LATEX = {
    "\u2212": "$-$",
    "–": "--",
    "°": r"\textdegree{}",
    "±": r"$\pm$",
    "σ": r"$\sigma$",
    "\u202f": r"\,",
}


@dataclass(frozen=True)
class Cells:
    """A table as it is shown."""

    header: tuple[str, ...]
    """Of the columns."""
    rows: tuple[tuple[str, ...], ...]
    """The texts."""
    best: tuple[tuple[bool, ...], ...] = ()
    """Whether a cell is the best of its column, by row; () without any."""
    numbers: tuple[int, ...] = ()
    """The columns of numbers, which are aligned right."""


def cells_of(table: pd.DataFrame) -> Cells:
    """A table of texts and numbers, which have three significant digits, without its index."""
    texts = table.map(lambda one: number(one) if isinstance(one, float | None) else str(one))
    numbers = [i for i, kind in enumerate(table.dtypes) if pd.api.types.is_numeric_dtype(kind)]
    rows = tuple(texts.itertuples(index=False, name=None))
    return Cells(tuple(map(str, texts.columns)), rows, numbers=tuple(numbers))


def overview(
    answers: Sequence[Answer], intervals: int | None = None, paired: bool = False
) -> Cells:
    """One row an option, in the order of the first answer, one column a metric.

    Answers must be of the same comparison. Only the first `intervals` metrics have intervals; None:
    all. With `paired` the first metric's differences follow it, if these have intervals. A column
    `failed` is added if a run has failed. The runs are those that the values are of; the header of
    a metric says its own number if that is another.
    """
    first, order = answers[0], answers[0].order

    def texts(one: Answer, columns: Sequence[str], sign: bool = False) -> list[str]:
        rows = one.table.loc[order, columns].to_numpy()
        return [with_interval(*known(row), sign=sign) for row in rows]

    counts, best = first.table.loc[order], set()
    every = [*counts["runs"].astype(str)]
    used = [str(first.used * (option in first.values)) for option in order]
    columns = [(first.question.named, [*map(str, order)]), ("runs", every)]
    if used != every:
        both = zip(used, every, strict=True)
        columns[1] = ("runs used", [" of ".join(one) for one in both])
    if counts["failed"].any():
        columns.append(("failed", [*counts["failed"].astype(str)]))
    for i, one in enumerate(answers):
        if one.shown and one.question.reference is None:
            best.add((order.index(one.best), len(columns)))
        heading = one.question.row.heading
        heading += "" if one.used == first.used else f" ({counted(one.used, 'run')})"
        if one.table["low"].notna().any() and (intervals is None or i < intervals):
            columns.append((heading + INTERVAL, texts(one, MEAN)))
        else:
            columns.append((heading, [*map(number, one.table.loc[order, "mean"])]))
        if paired and one is first and counts["minus_low"].notna().any():
            columns.append((f"minus {one.against}{INTERVAL}", texts(one, MINUS, sign=True)))
    header, cells = zip(*columns, strict=True)
    places = range(len(header))
    marks = (tuple((i, j) in best for j in places) for i in range(len(order)))
    return Cells(header, tuple(zip(*cells, strict=True)), tuple(marks), tuple(places[1:]))


def explanation(answers: Sequence[Answer] = ()) -> str:
    """What the values of a table of answers to one comparison are; () for several tables."""
    over = answers[0].over if answers else "the units named under “In words”"
    text = f"Each value is the mean over {over}, which every option has"
    if any(one.used != answers[0].used for one in answers):
        text += " (other runs where a header says so)"
    if answers and answers[0].used < 2:
        text = f"Each value is that of {'one run' if answers[0].used else 'the runs in its header'}"
    few = f". Nothing is compared below {LEAST_UNITS} units."
    return text + (few if answers and answers[0].units < LEAST_UNITS else INTERVALS)


def markdown(answers: Sequence[Answer]) -> str:
    """The overview in Markdown, the best in bold, and what it says."""
    cells = overview(answers)
    rows = [
        [
            f"**{text}**" if mark else text.replace("|", r"\|")
            for text, mark in zip(*both, strict=True)
        ]
        for both in zip(cells.rows, cells.best, strict=True)
    ]
    rule = ["---:" if i in cells.numbers else "---" for i in range(len(cells.header))]
    lines = [f"| {' | '.join(row)} |" for row in (cells.header, rule, *rows)]
    said = [f"- {one.sentence}" for one in answers]
    notes = [f"- {text}" for text in answers[0].notes]
    return "\n".join([*lines, "", *said, *notes, "", explanation(answers), ""])


def latex(answers: Sequence[Answer], caption: str = "", label: str = "") -> str:
    """The overview in LaTeX for the package booktabs, the best in bold."""
    cells = overview(answers)
    frame = pd.DataFrame(cells.rows, columns=pd.Index(cells.header))
    bold = pd.DataFrame(np.where(cells.best, "textbf:--rwrap;", ""), columns=frame.columns)
    columns = "".join("r" if i in cells.numbers else "l" for i in range(len(cells.header)))
    shown = frame.style.format(escape="latex").format_index(escape="latex", axis=1).hide(axis=0)
    shown = shown.apply(lambda _: bold, axis=None)
    text = shown.to_latex(
        hrules=True, column_format=columns, caption=caption or None, label=label or None
    )
    for character, command in _LATEX.items():
        text = text.replace(character, command)
    return text


def frame(answers: Sequence[Answer]) -> pd.DataFrame:
    """One row for each option and metric, with all digits."""
    named = [one.table.rename_axis(one.question.named).reset_index() for one in answers]
    return pd.concat(
        [
            table.assign(metric=one.question.metric, unit=one.question.row.unit, units=one.units)
            for table, one in zip(named, answers, strict=True)
        ],
        ignore_index=True,
    )


def csv(answers: Sequence[Answer]) -> str:
    """The rows of `frame` as comma-separated values."""
    return frame(answers).to_csv(index=False, lineterminator="\n")


TABLES = {"md": markdown, "tex": latex, "csv": csv}
"""Format of a table to what writes it."""


def records(answers: Sequence[Answer]) -> list[dict[str, object]]:
    """The rows of `frame` in plain types, None for a missing value."""
    table = frame(answers)
    return table.astype(object).where(table.notna(), None).to_dict("records")
