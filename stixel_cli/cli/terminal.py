"""Tables on the terminal."""

import sys
from collections.abc import Collection, Iterable, Sequence

LONGEST_LINE = 400
"""Characters of a line where there is no terminal."""


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    right: Collection[int] = (),
    width: int = LONGEST_LINE,
) -> None:
    """Print a table; `right` are the places of the columns whose cells end in a line.

    What the cells hold is printed as it is: brackets mean nothing. `width` is that of the longest
    line where there is no terminal; what is longer goes on in the next.
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
