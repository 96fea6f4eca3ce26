"""A study's tables as CSV, Markdown, LaTeX and for the page; the statistics that studies share.

A column whose name begins with `±` is the spread of the one before it: shown beside it in one cell,
and a column of its own in the CSV.
"""

from collections.abc import Iterator, Sequence

from stixel_cli.report.metrics import format_value
from stixel_cli.studies.nouns import Figure, Findings, Section, Table
from stixel_cli.sweeps.statistics import Statistic, statistic
from stixel_cli.sweeps.tables import csv_text, latex_row, latex_text, markdown_row

SPREAD = "±"


def over_seeds(values: Sequence[float | int | None]) -> Statistic:
    """n, mean, standard deviation and 95 % t-interval of values, those that are None left out."""
    return statistic({}, "", values)


def tables_of(findings: Findings) -> Iterator[Table]:
    """Every table, in the order of the report."""
    return (block for block in _blocks(findings.sections) if isinstance(block, Table))


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
        if name.startswith(SPREAD) and groups:
            groups[-1].append(i)
        else:
            groups.append([i])
    header = [table.columns[g[0]] + (f" {SPREAD} sd" if len(g) > 1 else "") for g in groups]
    rows = [[_cell([row[i] for i in group]) for group in groups] for row in table.rows]
    numeric = [
        any(isinstance(row[g[0]], int | float) for row in table.rows)
        and not any(isinstance(row[g[0]], str) for row in table.rows)
        for g in groups
    ]
    return header, rows, numeric


def _cell(values: Sequence[str | int | float | None]) -> str:
    first = values[0] if isinstance(values[0], str) else format_value(_plain(values[0]))
    spreads = [value for value in values[1:] if value is not None]
    return " ".join([first, *(f"{SPREAD} {_as_fine(value, first)}" for value in spreads)])


def _as_fine(value: float, first: str) -> str:
    """A spread with as many decimals as the value that it belongs to."""
    _, point, decimals = first.partition(".")
    return f"{value:.{len(decimals)}f}" if point and decimals.isdigit() else format_value(value)


def _plain(value: int | float | None) -> int | float | None:
    """NumPy's numbers as Python's, of which `format_value` knows which are whole."""
    return value.item() if hasattr(value, "item") else value


def table_markdown(table: Table) -> str:
    """The table in Markdown, its caption below."""
    header, rows, numeric = shown_table(table)
    rule = "|" + "".join(" ---: |" if right else " --- |" for right in numeric)
    return "\n".join([markdown_row(header), rule, *map(markdown_row, rows), "", table.caption, ""])


def table_latex(table: Table) -> str:
    """The table in LaTeX; it needs no package."""
    header, rows, numeric = shown_table(table)
    lines = [
        r"\begin{table}",
        rf"\caption{{{latex_text(table.caption)}}}",
        rf"\begin{{tabular}}{{{''.join('r' if right else 'l' for right in numeric)}}}",
        r"\hline",
        latex_row(header),
        r"\hline",
        *map(latex_row, rows),
        r"\hline",
        r"\end{tabular}",
        r"\end{table}",
        "",
    ]
    return "\n".join(lines)
