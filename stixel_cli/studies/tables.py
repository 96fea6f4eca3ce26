"""Numbers as text, and tables as CSV, Markdown, LaTeX and cells of a page.

A number is shown with the digits that its uncertainty supports, and with a true minus sign.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

from stixel_cli.evaluation.metric_table import Metric
from stixel_cli.report.metrics import NO_VALUE
from stixel_cli.studies.types import Column, Figure, Findings, Section, Table
from stixel_cli.sweeps.statistics import Statistic, statistic
from stixel_cli.sweeps.tables import csv_text, latex_table, markdown_row

SPREAD = "±"
MINUS = "\u2212"
_THIN = "\u202f"


def decimals(half: float | None) -> int | None:
    """Decimals, 0 to 3, that show two significant digits of an uncertainty; None without one."""
    if half is None or not math.isfinite(half) or half <= 0.0:
        return None
    return min(3, max(0, 1 - math.floor(math.log10(half))))


def number(value: float | int | None, places: int | None = None, sign: bool = False) -> str:
    """A number with the given decimals, by default three significant digits; a dash for None."""
    if value is None or not math.isfinite(value):
        return NO_VALUE
    if places is None:
        if isinstance(value, int):
            places = 0
        else:
            size = abs(value)
            places = 2 if size == 0.0 else min(4, max(0, 2 - math.floor(math.log10(size))))
    shown = f"{value:+.{places}f}" if sign else f"{value:.{places}f}"
    if not any(digit in shown for digit in "123456789"):
        shown = shown.lstrip("+-")
    return shown.replace("-", MINUS)


def quantity(
    value: float | int | None, unit: str = "", places: int | None = None, sign: bool = False
) -> str:
    """A number with its unit."""
    return _joined(number(value, places, sign), unit)


def with_interval(
    value: float | None, low: float | None, high: float | None, unit: str = "", sign: bool = False
) -> str:
    """A number with its interval in brackets, with the digits that the interval supports."""
    if value is None or low is None or high is None:
        return quantity(value, unit, sign=sign)
    places = decimals(0.5 * (high - low))
    ends = f"[{number(low, places)}, {number(high, places)}]"
    return f"{quantity(value, unit, places, sign)} {ends}"


def percent(share: float | None, places: int = 0) -> str:
    """A share as per cent."""
    return quantity(None if share is None else 100.0 * share, "%", places)


def counted(count: int, what: str) -> str:
    """A number with its noun, whose plural must be regular."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def capital(text: str) -> str:
    """The text with a capital letter."""
    return text[:1].upper() + text[1:]


def _joined(shown: str, unit: str) -> str:
    if not unit or shown == NO_VALUE:
        return shown
    return shown + unit if unit == "°" else f"{shown}{_THIN}{unit}"


def interval_columns(name: str, ends: str) -> tuple[str, Column, Column]:
    """A column and the ends of its 95 % interval; in the CSV, `low ENDS` and `high ENDS`."""
    return name, Column(f"low {ends}", "low"), Column(f"high {ends}", "high")


def std_columns(name: str, of: str) -> tuple[str, Column]:
    """A column and its standard deviation; in the CSV, `± OF`."""
    return name, Column(f"{SPREAD} {of}", "std")


def with_ends(names: Iterable[str]) -> tuple[str | Column, ...]:
    """Columns, each followed by the ends of its 95 % interval."""
    return tuple(column for name in names for column in interval_columns(name, name))


def with_unit(metric: Metric, form: str = "{} ({})") -> str:
    """The short label of a metric with its unit, if it has one."""
    return form.format(metric.short_label, metric.unit) if metric.unit else metric.short_label


def over_seeds(values: Iterable[float | int | None]) -> Statistic:
    """n, mean, standard deviation and 95 % interval (Student's t) of the finite values."""
    known = [float(value) for value in values if value is not None and math.isfinite(value)]
    return statistic({}, "", known)


def tables_of(findings: Findings) -> Iterator[Table]:
    """Every table, in the order of the report."""
    return (block for block in _every_block(findings) if isinstance(block, Table))


def figures_of(findings: Findings) -> Iterator[Figure]:
    """Every figure, in the order of the report."""
    return (block for block in _every_block(findings) if isinstance(block, Figure))


def _every_block(findings: Findings) -> Iterator:
    yield from findings.opening
    yield from _blocks(findings.sections)


def _blocks(sections: Sequence[Section]) -> Iterator:
    for section in sections:
        for block in section.blocks:
            if isinstance(block, Section):
                yield from _blocks([block])
            else:
                yield block


def name_of(column: str | Column) -> str:
    """Name of a column in the CSV."""
    return column.name if isinstance(column, Column) else column


def table_csv(table: Table) -> str:
    """The table with all digits; missing values are empty."""
    names = [name_of(column) for column in table.columns]
    return csv_text(names, [dict(zip(names, row, strict=True)) for row in table.rows])


def shown_table(table: Table) -> tuple[list[str], list[list[str]], list[bool]]:
    """Header, cells as shown, and whether each column has numbers.

    A value is in one cell with its standard deviation or the ends of its interval.
    """
    groups: list[list[int]] = []
    for i, column in enumerate(table.columns):
        if isinstance(column, Column):
            groups[-1].append(i)
        else:
            groups.append([i])
    header = [name_of(table.columns[g[0]]) + _SUFFIXES[len(g)] for g in groups]
    rows = [[_cell([_plain(row[i]) for i in group]) for group in groups] for row in table.rows]
    numeric = [
        any(isinstance(row[g[0]], int | float) for row in table.rows)
        and not any(isinstance(row[g[0]], str) for row in table.rows)
        for g in groups
    ]
    return header, rows, numeric


INTERVAL = " [95 %]"
"""End of the header of cells with an interval."""
_SUFFIXES = {1: "", 2: f" {SPREAD} sd", 3: INTERVAL}


def _cell(values: Sequence[str | int | float | None]) -> str:
    match values:
        case [str() as text, *_]:
            return text
        case [value, low, high]:
            return with_interval(value, low, high)
        case [value, spread] if value is not None and spread is not None:
            places = decimals(spread)
            # A tiny standard deviation must not add digits to the value.
            most = 3 - math.floor(math.log10(max(abs(value), 1e-3)))
            places = max(0, min(3 if places is None else places, most))
            return f"{number(value, places)} {SPREAD} {number(spread, places)}"
        case [value, *_]:
            # Positive and smaller than the smallest number shown, as a p can be.
            return "< 0.0001" if value is not None and 0.0 < value < 5e-5 else number(value)


def _plain(value: int | float | None) -> int | float | None:
    """NumPy's numbers as Python's, so that `number` recognises integers."""
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
