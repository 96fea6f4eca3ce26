"""The scores as a table on the terminal."""

from collections.abc import Mapping

from rich import box
from rich.table import Table

from stixel_cli.evaluation.metric_table import metric
from stixel_cli.report.metrics import format_value


def scores_table(metrics: Mapping[str, float | int | None]) -> Table:
    """A table of metrics, in their order: name, value, unit; a dash where there is no value."""
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    table.add_column("score")
    table.add_column("value", justify="right")
    table.add_column("unit")
    for name, value in metrics.items():
        shown = metric(name)
        table.add_row(shown.label, format_value(value), shown.unit)
    return table
