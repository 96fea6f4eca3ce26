"""Tables and JSON on the terminal."""

import sys
from collections.abc import Collection, Iterable, Sequence
from typing import Any

LONGEST_LINE = 400
"""Characters of a line where stdout is not a terminal."""


def print_json(value: Any) -> None:
    """Print a value in plain types as JSON."""
    from stixel_cli.results.text import json_text

    sys.stdout.write(json_text(value))


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    right: Collection[int] = (),
    width: int = LONGEST_LINE,
) -> None:
    """Print a table.

    Cells are printed verbatim: brackets are not markup.

    Args:
        columns: the header.
        rows: one cell per column.
        right: indices of the right-aligned columns.
        width: characters of a line where stdout is not a terminal; longer lines are wrapped.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for i, column in enumerate(columns):
        side = "right" if i in right else "left"
        table.add_column(Text(column), justify=side, overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    Console(highlight=False, width=None if sys.stdout.isatty() else width).print(table)


def counted(count: int, noun: str) -> str:
    """`1 run`, `2 runs`."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
