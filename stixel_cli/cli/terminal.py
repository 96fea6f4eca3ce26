"""Tables on the terminal."""

import sys
from collections.abc import Iterable, Sequence


def print_table(columns: Sequence[str], rows: Iterable[Sequence[str]], right: str = "") -> None:
    """Print a table; `right` names the columns, by their place, whose cells end in a line.

    What the cells hold is printed as it is: brackets mean nothing.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for i, column in enumerate(columns):
        side = "right" if str(i) in right else "left"
        table.add_column(Text(column), justify=side, overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    # Where there is no terminal, a line is as long as it takes.
    width = None if sys.stdout.isatty() else 400
    Console(highlight=False, width=width).print(table)
