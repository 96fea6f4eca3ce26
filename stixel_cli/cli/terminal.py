"""Text, tables and JSON on the terminal, where no foreign text may move the cursor."""

import json
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from stixel_cli.errors import escaped

if TYPE_CHECKING:
    from rich.console import Console

LONGEST_LINE = 400
"""Characters of a line where stdout is not a terminal."""


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


def print_json(value: Any) -> None:
    """Print a value in plain types as JSON, in ASCII: nothing in it controls the terminal."""
    sys.stdout.write(json.dumps(value, indent=2, allow_nan=False) + "\n")


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
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for i, column in enumerate(columns):
        side = "right" if i in right else "left"
        table.add_column(Text(escaped(column)), justify=side, overflow="fold")
    for row in rows:
        table.add_row(*(Text(escaped(cell)) for cell in row))
    printer = console(None if sys.stdout.isatty() else width)
    printer.print(table, soft_wrap=False)
