"""The summaries of a sweep as CSV, Markdown and LaTeX."""

from collections.abc import Sequence
from typing import Any

from stixel_cli.evaluation.metric_table import metric
from stixel_cli.report.metrics import NO_VALUE, shown_value
from stixel_cli.report.statistics import Statistic, consistent_bounds
from stixel_cli.report.tables import csv_text, latex_table, markdown_table
from stixel_cli.sweeps.folder import SUMMARIES
from stixel_cli.sweeps.results import IncompleteSetting

_EXPLANATION = (
    "One row per setting: n seeds with a value, their mean, standard deviation, and the 95 % "
    "interval of the mean (Student's t; for a share of runs Wilson's; its ends can be beyond the "
    "possible values). The column 'consistent' of a NEES is the 95 % interval of its mean for a "
    "consistent filter (χ²; each run counts as one scan, because the errors of its scans are "
    "alike). Settings have the same seeds: to compare two settings, take the differences seed by "
    "seed, from runs.csv."
)


def summary_records(statistics: Sequence[Statistic]) -> list[dict[str, Any]]:
    """One record for each setting and metric, as in `summary.csv`."""
    records = []
    for one in statistics:
        low, high = consistent_bounds(one)
        records.append(
            {
                **one.setting,
                "metric": one.metric,
                "unit": metric(one.metric).unit,
                "n": one.n,
                "mean": one.mean,
                "std": one.std,
                "interval_low": one.low,
                "interval_high": one.high,
                "consistent_low": low,
                "consistent_high": high,
            }
        )
    return records


def summary_files(
    statistics: Sequence[Statistic], incomplete: Sequence[IncompleteSetting], title: str
) -> dict[str, str]:
    """The summaries of a sweep by file name; `title` is its command line."""
    writers = (_summary_csv, _summary_markdown, _summary_latex)
    return {
        name: write(statistics, incomplete, title)
        for name, write in zip(SUMMARIES, writers, strict=True)
    }


def _summary_csv(
    statistics: Sequence[Statistic], incomplete: Sequence[IncompleteSetting], _: str
) -> str:
    """One row for each setting and metric, and one row for each incomplete setting."""
    records = [record | {"status": "complete"} for record in summary_records(statistics)]
    columns = list(records[0]) if records else []
    others = [one.setting | {"n": one.done, "status": "incomplete"} for one in incomplete]
    return csv_text(columns, [*records, *others])


def _summary_markdown(
    statistics: Sequence[Statistic], incomplete: Sequence[IncompleteSetting], title: str
) -> str:
    """One table for each metric."""
    lines = [f"# {title}", "", _EXPLANATION, ""]
    if incomplete:
        lines += [f"{_refusal(incomplete)}:", "", *(f"- {one.label}" for one in incomplete), ""]
    for name, rows in _by_metric(statistics):
        header, *body = _cells(rows, incomplete)
        lines += [f"## {heading(name)}", ""]
        keys = len(rows[0].setting)
        numeric = [False] * keys + [True] * (len(header) - keys)
        lines += [*markdown_table(header, body, numeric), ""]
    return "\n".join(lines)


def _summary_latex(
    statistics: Sequence[Statistic], incomplete: Sequence[IncompleteSetting], title: str
) -> str:
    """One table for each metric; LaTeX needs no package for them."""
    lines = [f"% {' '.join(title.split())}", f"% {_EXPLANATION}"]
    if incomplete:
        lines += [f"% {_refusal(incomplete)}:"]
        lines += [f"%   {' '.join(one.label.split())}" for one in incomplete]
    for name, rows in _by_metric(statistics):
        header, *body = _cells(rows, incomplete)
        keys = len(rows[0].setting)
        numeric = [False] * keys + [True] * (len(header) - keys)
        lines += latex_table(heading(name), numeric, header, body)
    return "\n".join(lines)


def _refusal(incomplete: Sequence[IncompleteSetting]) -> str:
    count = len(incomplete)
    return f"No statistics yet of {count} incomplete setting{'' if count == 1 else 's'}"


def _by_metric(statistics: Sequence[Statistic]) -> list[tuple[str, list[Statistic]]]:
    names = dict.fromkeys(one.metric for one in statistics if one.n > 0)
    return [(name, [one for one in statistics if one.metric == name]) for name in names]


def heading(name: str) -> str:
    """Label of a metric, with its unit."""
    shown = metric(name)
    return f"{shown.label} ({shown.shown_unit})" if shown.shown_unit else shown.label


def _cells(rows: Sequence[Statistic], incomplete: Sequence[IncompleteSetting]) -> list[list[str]]:
    header = [*rows[0].setting, "n", "mean", "standard deviation", "95 % interval"]
    bounded = metric(rows[0].metric).degrees_of_freedom is not None
    header += ["consistent"] if bounded else []
    cells = [header]
    for row in rows:
        ends = [(row.low, row.high), *([consistent_bounds(row)] if bounded else [])]
        numbers = [shown_value(row.metric, value) for value in (row.mean, row.std)]
        spans = [_span(row.metric, low, high) for low, high in ends]
        cells.append([*row.setting.values(), str(row.n), *numbers, *spans])
    rest = [NO_VALUE] * (3 if bounded else 2)
    for one in incomplete:
        cells.append([*one.setting.values(), str(one.done), "incomplete", *rest])
    return cells


def _span(name: str, low: float | None, high: float | None) -> str:
    if low is None:
        return NO_VALUE
    return f"{shown_value(name, low)} … {shown_value(name, high)}"
