"""Tables by keys from a frame of runs, and tables as CSV, Markdown, LaTeX and cells of a page."""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from stixel_cli.evaluation.metric_table import Metric, metric, over_runs
from stixel_cli.report.blocks import Cell, Table
from stixel_cli.report.metrics import SPREAD, number, with_interval, with_std
from stixel_cli.report.statistics import Statistic, statistic

if TYPE_CHECKING:
    import pandas as pd

PAIR = ("road_user", "path", "seed")
"""Columns that are equal in the two runs of a pair: then the motion is equal."""
INTERVAL = " [95 %]"
"""End of the header of cells with an interval."""
_LATEX = {
    "\\": r"\textbackslash{}",
    **{character: rf"\{character}" for character in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "°": r"\textdegree{}",
    "±": r"$\pm$",
    "–": "--",
    "\u2212": "$-$",
    "×": r"$\times$",
    # Without a package, LaTeX prints other characters for < and > in text.
    "<": "$<$",
    ">": "$>$",
    "²": "$^2$",
    "χ": r"$\chi$",
    "σ": r"$\sigma$",
    "\u202f": r"\,",
    "…": r"\ldots{}",
}


def names(frame: "pd.DataFrame", column: str) -> list:
    """The values of a column, in order of appearance."""
    return frame[column].unique().tolist()


def chosen(frame: "pd.DataFrame", **values: Any) -> "pd.DataFrame":
    """The rows that have the given values in the columns of these names."""
    for name, value in values.items():
        frame = frame[frame[name] == value]
    return frame


def groups(
    frame: "pd.DataFrame", keys: Sequence[str]
) -> "list[tuple[tuple[Any, ...], pd.DataFrame]]":
    """The rows by their values of `keys`, ordered as the values of each key first appear."""
    order = {key: names(frame, key) for key in keys}
    return sorted(
        frame.groupby(list(keys), sort=False),
        key=lambda group: [order[k].index(value) for k, value in zip(keys, group[0], strict=True)],
    )


def mean_over(runs: "pd.DataFrame", name: str, unit: str = "seed") -> Statistic:
    """A metric over seeds: each seed's mean over its runs; seeds with a missing value left out.

    `unit` is another column than the seed over which the statistic is.
    """
    return statistic(over_runs(name), runs[name], zip(runs[unit]))


def difference(
    one: "pd.DataFrame",
    other: "pd.DataFrame",
    name: str,
    pair: Sequence[str] = PAIR,
    unit: str = "seed",
) -> Statistic:
    """A metric of `one` minus that of `other`: the mean of each seed over the pairs of runs."""
    pair = list(pair)
    pairs = one[[*pair, name]].merge(other[[*pair, name]], on=pair).dropna()
    return statistic("", pairs[f"{name}_x"] - pairs[f"{name}_y"], zip(pairs[unit]))


def with_unit(row: Metric, form: str = "{} ({})") -> str:
    """The short label of a metric with its unit, if it has one."""
    return form.format(row.short_label, row.unit) if row.unit else row.short_label


def label_of(name: str) -> str:
    """Short label and unit of a metric's mean over runs; of another column its name."""
    return with_unit(metric(over_runs(name)))


def plain_label(row: Metric) -> str:
    """The short label without the statistic: "centre" of "centre RMSE"."""
    return row.short_label.removesuffix(" RMSE").removeprefix("mean ")


def axis_label(row: Metric) -> str:
    """The plain label with its unit, if it has one."""
    return plain_label(row) + (f" ({row.unit})" if row.unit else "")


def ends(label: str, one) -> dict[str, Cell]:
    """Cells of a mean with the ends of its interval; `one` is None without a value."""
    values = (None,) * 3 if one is None else (one.mean, one.low, one.high)
    return dict(zip((label, f"low {label}", f"high {label}"), values, strict=True))


def spread(label: str, one: Statistic) -> dict[str, Cell]:
    """Cells of a mean and of its standard deviation."""
    return {label: one.mean, f"{SPREAD} {label}": one.std}


def mean_cell(label: str, one: Statistic) -> dict[str, Cell]:
    """The cell of a mean."""
    return {label: one.mean}


def rows_by(
    runs: "pd.DataFrame",
    keys: Sequence[str],
    metrics: Sequence[str] | Mapping[str, str],
    cells=ends,
    across: str = "",
    unit: str = "seed",
) -> Iterator[dict[str, Cell]]:
    """One row for each combination of `keys`: number of units, and metrics over the units.

    Args:
        metrics: columns with a number, or a mapping from them to labels.
        cells: `ends`, `spread` or `mean_cell`.
        across: a column; each metric then has a column for each of its values.
        unit: as in `mean_over`.
    """
    labels = metrics if isinstance(metrics, Mapping) else {name: label_of(name) for name in metrics}
    for values, own in groups(runs, keys):
        row: dict[str, Cell] = {
            key.replace("_", " "): value for key, value in zip(keys, values, strict=True)
        }
        row["n"] = own[unit].nunique()
        for side in names(runs, across) if across else [""]:
            part = chosen(own, **{across: side}) if across else own
            for name, label in labels.items():
                row |= cells(f"{label}, {side}" if side else label, mean_over(part, name, unit))
        yield row


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """Comma-separated rows: missing values are empty, floats have all their digits."""
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue()


def table_csv(table: Table) -> str:
    """The table with all digits; missing values are empty."""
    return csv_text(table.columns, (dict(zip(table.columns, r, strict=True)) for r in table.rows))


def shown_columns(table: Table) -> list[list[int]]:
    """Numbers of the columns in one shown cell: a value and its standard deviation or interval."""
    together: list[list[int]] = []
    for i, column in enumerate(table.columns):
        if together and column.startswith(("low ", "high ", f"{SPREAD} ")):
            together[-1].append(i)
        else:
            together.append([i])
    return together


def shown_table(table: Table) -> tuple[list[str], list[list[str]], list[bool]]:
    """Header, cells as shown, and whether each column has numbers."""
    together = shown_columns(table)
    suffixes = {1: "", 2: f" {SPREAD} sd", 3: INTERVAL}
    header = [table.columns[g[0]] + suffixes[len(g)] for g in together]
    rows = [[_cell([row[i] for i in group]) for group in together] for row in plain_rows(table)]
    numeric = [
        any(isinstance(row[g[0]], int | float) for row in table.rows)
        and not any(isinstance(row[g[0]], str) for row in table.rows)
        for g in together
    ]
    return header, rows, numeric


def _cell(values: Sequence[Cell]) -> str:
    match values:
        case [str() as text, *_]:
            return text
        case [value, low, high]:
            return with_interval(value, low, high)
        case [value, std]:
            return with_std(value, std)
        case [value]:
            # Positive and smaller than the smallest number shown, as a p can be.
            return "< 0.0001" if value is not None and 0.0 < value < 5e-5 else number(value)


def plain_rows(table: Table) -> list[list[Cell]]:
    """The rows with NumPy's numbers as Python's."""
    return [[c.item() if hasattr(c, "item") else c for c in row] for row in table.rows]


def markdown_table(
    header: Sequence[str], rows: Sequence[Sequence[str]], numeric: Iterable[bool]
) -> list[str]:
    """Lines of a table in Markdown; `numeric` columns are aligned right."""
    lines = [" | ".join(cell.replace("|", r"\|") for cell in row) for row in (header, *rows)]
    rule = " | ".join("---:" if right else "---" for right in numeric)
    return [f"| {line} |" for line in (lines[0], rule, *lines[1:])]


def table_markdown(table: Table) -> str:
    """The table in Markdown, its caption below."""
    return "\n".join([*markdown_table(*shown_table(table)), "", table.caption, ""])


def table_latex(table: Table) -> str:
    """The table in LaTeX, which needs no package; numbers are aligned right."""
    header, rows, numeric = shown_table(table)
    lines = [" & ".join(map(_latex_text, row)) + r" \\" for row in (header, *rows)]
    return "\n".join(
        [
            r"\begin{table}",
            rf"\caption{{{_latex_text(table.caption)}}}",
            rf"\begin{{tabular}}{{{''.join('r' if right else 'l' for right in numeric)}}}",
            *(r"\hline", lines[0], r"\hline", *lines[1:], r"\hline"),
            *(r"\end{tabular}", r"\end{table}", ""),
        ]
    )


def _latex_text(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text)
