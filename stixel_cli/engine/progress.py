"""Progress of an execution on stderr: a bar on a terminal, some lines elsewhere."""

import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence

from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.graph import Node
from stixel_cli.engine.parameters import PROGRAM

PATIENCE = 1.0
"""Seconds before the first output: a shorter execution shows nothing."""

LINE_INTERVAL = 5.0
"""Seconds between two lines."""


class Progress:
    """Count nodes and show only notes. All calls come from the thread of the execution."""

    def __init__(self):
        self.total: dict[str, int] = {}
        self.done: dict[str, int] = {}
        self.seconds: dict[str, float] = {}
        self.running: dict[str, str] = {}
        self.failures = 0
        self.skipped = 0
        self.cached = 0
        self.began = time.monotonic()
        self.known: Mapping[str, float] = {}
        self.workers = 1

    def expect(self, known: Mapping[str, float], workers: int) -> None:
        """Set the seconds that a node of each stage took before, and the number of workers."""
        self.known, self.workers = known, workers

    def begin(self, nodes: Sequence[Node], cached: int) -> None:
        """Start: `nodes` will be computed, `cached` others are in the store."""
        self.began = time.monotonic()
        self.cached = cached
        self.extend(nodes)

    def extend(self, nodes: Sequence[Node]) -> None:
        """Add nodes that will be computed as well."""
        for node in nodes:
            self.total[node.stage.name] = self.total.get(node.stage.name, 0) + 1

    def started(self, node: Node) -> None:
        """Count a node as running. A node whose worker crashed starts a second time."""
        self.running[node.key] = node.stage.name

    def finished(self, node: Node, seconds: float) -> None:
        """Count a node as done: its result is in the store."""
        name = node.stage.name
        self.running.pop(node.key, None)
        self.done[name] = self.done.get(name, 0) + 1
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds

    def failed(self, node: Node, failure: StageFailure, skipped: Sequence[Node]) -> None:
        """Report a failed node. The nodes `skipped` depend on it and will not be computed."""
        self.running.pop(node.key, None)
        self.failures += 1
        self.skipped += len(skipped)
        for one in (node, *skipped):
            self.total[one.stage.name] -= 1
        self.note(f"failed: {' '.join(str(failure).split())}")

    def tick(self) -> None:
        """Update the display. Called several times per second."""

    def note(self, text: str) -> None:
        """Print one line for the user."""
        print(f"{PROGRAM}: {text}", file=sys.stderr, flush=True)  # noqa: T201

    def close(self) -> None:
        """End the display; the next `tick` may show it again."""

    @property
    def all_done(self) -> int:
        """Number of finished nodes."""
        return sum(self.done.values())

    @property
    def all_total(self) -> int:
        """Number of nodes to compute."""
        return sum(self.total.values())

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self.began

    def seconds_left(self) -> float | None:
        """Estimated seconds left; None if a stage without any measured time is to be computed."""
        total = 0.0
        for name, count in self.total.items():
            done = self.done.get(name, 0)
            if count <= done:
                continue
            each = self.seconds[name] / done if done else self.known.get(name)
            if each is None:
                return None
            total += (count - done) * each
        return total / self.workers

    @property
    def text_left(self) -> str:
        """`; about 40 s left`; empty if that is unknown or all nodes are done."""
        left = self.seconds_left()
        if left is None or self.all_done >= self.all_total:
            return ""
        return f"; about {duration(left)} left"

    @property
    def running_stages(self) -> str:
        """Names of the stages that are running."""
        return ", ".join(dict.fromkeys(self.running.values()))


def crash_note(labels: Sequence[str], retry: bool) -> str:
    """Message for a worker that crashed while it ran nodes with these labels."""
    names = ", ".join(
        label if count == 1 else f"{label} ({count} nodes)"
        for label, count in Counter(labels).items()
    )
    if not retry:
        return f"a worker crashed while running {names}"
    each = f"{names} on its own" if len(labels) == 1 else "each on its own"
    return f"a worker crashed while running {names}; retrying {each}"


def make_progress() -> Progress:
    """A bar if stderr is a terminal, else lines."""
    return Bar() if sys.stderr.isatty() else Lines()


def duration(seconds: float) -> str:
    """Format a time: `40 s`, `12 min`, `3 h 20 min`."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60} min"


class Lines(Progress):
    """Print a line for each finished stage, and one every few seconds."""

    def __init__(self):
        super().__init__()
        self._last_line = 0.0

    def finished(self, node: Node, seconds: float) -> None:
        """Print a line if the stage is complete."""
        super().finished(node, seconds)
        name = node.stage.name
        if self.done[name] == self.total.get(name) and self.elapsed > PATIENCE:
            nodes = f" ({self.done[name]} nodes)" if self.done[name] > 1 else ""
            self._line(f"{name}{nodes} done in {self.seconds[name]:.1f} s of work")

    def tick(self) -> None:
        """Print a line if the last one is some time ago."""
        if self.running and self.elapsed - self._last_line > LINE_INTERVAL:
            self._line(f"running {self.running_stages}{self.text_left}")

    def _line(self, text: str) -> None:
        self._last_line = self.elapsed
        self.note(f"[{self.all_done}/{self.all_total}] {text}")


class Bar(Progress):
    """Show a progress bar of rich, and remove it at the end."""

    def __init__(self):
        super().__init__()
        self._bar = None
        self._task = None

    def tick(self) -> None:
        """Show or update the bar."""
        if self._bar is None and self.all_total and self.elapsed > PATIENCE:
            self._start()
        if self._bar is not None:
            self._bar.update(
                self._task,
                completed=self.all_done,
                total=self.all_total,
                description=self.running_stages + self.text_left,
            )

    def note(self, text: str) -> None:
        """Print a line above the bar."""
        if self._bar is None:
            super().note(text)
        else:
            self._bar.console.print(f"{PROGRAM}: {text}", markup=False, highlight=False)

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def _start(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as RichProgress

        self._bar = RichProgress(
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}"),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task("", total=self.all_total)
        self._bar.start()
