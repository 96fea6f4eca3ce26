"""A study's tables as CSV, Markdown, LaTeX and for the page; the statistics that studies share.

A column whose name begins with `±` is the standard deviation of the one before it, two that begin
with `low` and `high` are the ends of its 95 % interval: shown beside it in one cell, to the digits
that they bear, and columns of their own in the CSV.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

from stixel_cli.studies.prose import decimals, number, with_interval
from stixel_cli.studies.types import Figure, Findings, Section, Table
from stixel_cli.sweeps.statistics import Statistic, statistic
from stixel_cli.sweeps.tables import csv_text, latex_table, markdown_row

SPREAD, LOW, HIGH = "±", "low ", "high "


def with_ends(names: Sequence[str]) -> tuple[str, ...]:
    """Names of columns, after each those of the ends of its 95 % interval."""
    return tuple(one for name in names for one in (name, f"{LOW}{name}", f"{HIGH}{name}"))


def over_seeds(values: Sequence[float | int | None]) -> Statistic:
    """n, mean, standard deviation and 95 % t-interval of values, those that are None left out."""
    return statistic({}, "", values)


def with_none(values: Iterable[float]) -> list[float | None]:
    """The values of a column of a frame, None where one is not finite."""
    return [float(value) if math.isfinite(value) else None for value in values]


def tables_of(findings: Findings) -> Iterator[Table]:
    """Every table, in the order of the report."""
    blocks = (*findings.summary, *_blocks(findings.sections))
    return (block for block in blocks if isinstance(block, Table))


def figures_of(findings: Findings) -> Iterator[Figure]:
    """Every figure, in the order of the report."""
    return (block for block in _blocks(findings.sections) if isinstance(block, Figure))


def _blocks(sections: Sequence[Section]) -> Iterator:
    for section in sections:
        for block in section.blocks:
            if isinstance(block, Section):
                yield from _blocks([block])
            else:
                yield block


def table_csv(table: Table) -> str:
    """The table with all digits; empty where there is no value."""
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    return csv_text(table.columns, rows)


def shown_table(table: Table) -> tuple[list[str], list[list[str]], list[bool]]:
    """Header, cells as shown, and of each column whether it holds numbers."""
    groups: list[list[int]] = []
    for i, name in enumerate(table.columns):
        if name.startswith((SPREAD, LOW, HIGH)) and groups:
            groups[-1].append(i)
        else:
            groups.append([i])
    header = [table.columns[g[0]] + _SUFFIXES[len(g)] for g in groups]
    rows = [[_cell([_plain(row[i]) for i in group]) for group in groups] for row in table.rows]
    numeric = [
        any(isinstance(row[g[0]], int | float) for row in table.rows)
        and not any(isinstance(row[g[0]], str) for row in table.rows)
        for g in groups
    ]
    return header, rows, numeric


INTERVAL = " [95 %]"
"""At the end of a header whose cells have an interval."""
_SUFFIXES = {1: "", 2: f" {SPREAD} sd", 3: INTERVAL}


def _cell(values: Sequence[str | int | float | None]) -> str:
    match values:
        case [str() as text, *_]:
            return text
        case [value, low, high]:
            return with_interval(value, low, high)
        case [value, spread] if value is not None and spread is not None:
            places = decimals(spread)
            # A spread of next to nothing leaves the value its usual digits.
            most = 3 - math.floor(math.log10(max(abs(value), 1e-3)))
            places = max(0, min(3 if places is None else places, most))
            return f"{number(value, places)} {SPREAD} {number(spread, places)}"
        case [value, *_]:
            # Positive, and smaller than what is shown: as of a p.
            return "< 0.0001" if value is not None and 0.0 < value < 5e-5 else number(value)


def _plain(value: int | float | None) -> int | float | None:
    """NumPy's numbers as Python's, of which `number` knows which are whole."""
    return value.item() if hasattr(value, "item") else value


def table_markdown(table: Table) -> str:
    """The table in Markdown, its caption below."""
    header, rows, numeric = shown_table(table)
    rule = "|" + "".join(" ---: |" if right else " --- |" for right in numeric)
    return "\n".join([markdown_row(header), rule, *map(markdown_row, rows), "", table.caption, ""])


def table_latex(table: Table) -> str:
    """The table in LaTeX; it needs no package."""
    header, rows, numeric = shown_table(table)
    return "\n".join(latex_table(table.caption, numeric, header, rows))
