"""Text, tables and JSON on the terminal, where no foreign text may move the cursor."""

import json
import shutil
import sys
import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from stixel_cli.errors import escaped

if TYPE_CHECKING:
    from rich.console import Console

NARROW = 16
"""Characters to which the text of a column is wrapped before a column is left out."""

GAP = 3
"""Characters between two columns."""


class _Escaping:
    """A stream that escapes what would control the terminal; Rich writes to the stream itself."""

    def __init__(self, stream: Any):
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        """Write the text, escaped."""
        return self.rich_proxied_file.write(escaped(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


@contextmanager
def escaping() -> Iterator[None]:
    """Standard streams that escape invisible characters."""
    before = {name: getattr(sys, name) for name in ("stdout", "stderr")}
    ours = {name: _Escaping(stream) for name, stream in before.items()}
    vars(sys).update(ours)
    try:
        yield
    finally:
        # A stream that failed has been replaced, and stays so.
        vars(sys).update({n: before[n] for n in before if getattr(sys, n) is ours[n]})


def console(width: int | None = None) -> "Console":
    """Rich's console on stdout; it escapes what would control the terminal."""
    from rich.console import Console

    class Escaping(Console):
        def render(self, renderable: Any, options: Any = None) -> Iterator[Any]:
            for part in super().render(renderable, options):
                yield part if part.control else part._replace(text=escaped(part.text))

    return Escaping(highlight=False, soft_wrap=width is None, width=width)


def say(*lines: object) -> None:
    """Print lines verbatim on stdout."""
    sys.stdout.write("".join(f"{line}\n" for line in lines))


def say_wrapped(text: str, style: str = "") -> None:
    """Print a text on stdout, wrapped at its spaces; a longer word, like a path, stays whole."""
    width = shutil.get_terminal_size().columns
    for line in textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False):
        console().print(line, style=style, markup=False)


def print_json(value: Any) -> None:
    """Print a value in plain types as JSON, in ASCII: nothing in it controls the terminal."""
    sys.stdout.write(json.dumps(value, indent=2, allow_nan=False) + "\n")


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    right: Collection[int] = (),
    leave_out: Sequence[int] = (),
) -> None:
    """Print a table that is no wider than the screen, if its words allow that.

    Lines break at spaces only, so that a path or a number stays whole. Cells are printed verbatim:
    brackets are not markup.

    Args:
        columns: the header.
        rows: one cell per column.
        right: indices of the right-aligned columns.
        leave_out: indices of columns whose cells are not wrapped. If the screen is too narrow, they
            are left out in this order, and a line names them.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    header, *cells = [[Text(escaped(cell)) for cell in row] for row in (columns, *rows)]
    widths, least = [], []
    for i, name in enumerate(header):
        column = [row[i] for row in cells]
        words = (word for cell in (name, *column) for word in cell.split(" "))
        longest_word = max((word.cell_len for word in words), default=0)
        widths.append(max(cell.cell_len for cell in (name, *column)))
        widest = max((cell.cell_len for cell in column), default=0)
        least.append(max(longest_word, widest if i in leave_out else min(widest, NARROW)))
    shown, screen = list(range(len(columns))), shutil.get_terminal_size().columns
    for i in leave_out:
        if _line_width(least, shown) > screen:
            shown.remove(i)
    while _line_width(widths, shown) > screen and any(widths[i] > least[i] for i in shown):
        widths[max(shown, key=lambda i: widths[i] - least[i])] -= 1
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for i in shown:
        table.add_column(header[i], justify="right" if i in right else "left", width=widths[i])
    for row in cells:
        table.add_row(*(row[i] for i in shown))
    console(_line_width(widths, shown)).print(table, soft_wrap=False)
    missing = [name for i, name in enumerate(columns) if i not in shown]
    if missing:
        say_wrapped(f"Not shown on a screen of {screen} columns: {'; '.join(missing)}")


def _line_width(widths: Sequence[int], shown: Sequence[int]) -> int:
    return sum(widths[i] for i in shown) + GAP * (len(shown) - 1)
