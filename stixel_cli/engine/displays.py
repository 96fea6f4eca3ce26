"""Where progress is shown: a bar on a terminal or in a notebook, some lines elsewhere."""

import html
import sys
import time
from importlib import import_module
from typing import Any

from stixel_cli.engine.parameters import PROGRAM
from stixel_cli.errors import escaped

LINE_INTERVAL = 5.0
"""Seconds between two lines."""

REPEAT_INTERVAL = 60.0
"""Seconds between two equal lines."""


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    # Not imported here: a notebook has imported it.
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


class Lines:
    """Where progress is shown: a line on stderr every few seconds."""

    def __init__(self):
        self._last = time.monotonic()
        self._line = ""

    def show(self, share: float, text: str) -> None:
        """Show the share that is done, 0 … 1, and a text of one line.

        A line is printed if the last one is some time ago; an equal one only after longer.
        """
        now = time.monotonic()
        line = f"{PROGRAM}: [{100.0 * share:.0f} %] {text}"
        if text and now - self._last > (REPEAT_INTERVAL if line == self._line else LINE_INTERVAL):
            self._last, self._line = now, line
            print(line, file=sys.stderr, flush=True)  # noqa: T201

    def note(self, text: str) -> bool:
        """Print one line above the progress; False if that is left to stderr."""
        return False

    def close(self) -> None:
        """Remove the progress, if it does not stay; the next `show` may show it again."""


class Bar(Lines):
    """Show a progress bar of rich, and remove it at the end."""

    def __init__(self):
        self._bar: Any = None

    def show(self, share: float, text: str) -> None:
        """Show or update the bar."""
        if self._bar is None:
            self._start()
        self._bar.update(self._task, completed=share, description=escaped(text))

    def note(self, text: str) -> bool:
        """Print a line above the bar, if it is shown."""
        if self._bar is None:
            return False
        self._bar.console.print(escaped(f"{PROGRAM}: {text}"), markup=False, highlight=False)
        return True

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def _start(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as RichProgress

        self._bar = RichProgress(
            BarColumn(),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}", markup=False),
            console=Console(file=getattr(sys.stderr, "rich_proxied_file", sys.stderr)),
            transient=True,
        )
        self._task = self._bar.add_task("", total=1.0)
        self._bar.start()


class NotebookBar(Lines):
    """Show a progress bar below the cell of a notebook, and remove it at the end."""

    def __init__(self):
        self._handle: Any = None
        self._shown = ""

    def show(self, share: float, text: str) -> None:
        """Show the bar, or update it if it has changed."""
        shown = f'<progress value="{share:.3f}" max="1"></progress> {html.escape(text)}'
        if shown == self._shown:
            return
        self._shown = shown
        # Not an import statement: only notebooks have this package.
        display = import_module("IPython.display")
        if self._handle is None:
            self._handle = display.display(display.HTML(shown), display_id=True)
        else:
            self._handle.update(display.HTML(shown))

    def close(self) -> None:
        """Remove the bar."""
        if self._handle is not None:
            self._handle.update(import_module("IPython.display").HTML(""))
            self._handle, self._shown = None, ""


def make_display() -> Lines:
    """A bar in a notebook, or if stderr is a terminal; else lines."""
    if in_notebook():
        return NotebookBar()
    return Bar() if sys.stderr.isatty() else Lines()
