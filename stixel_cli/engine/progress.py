"""How far an execution is, on stderr: a bar on a terminal, now and then a line elsewhere."""

import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Protocol

from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.graph import Node

PATIENCE = 1.0
"""What is over before this many seconds is not shown."""

LINE_INTERVAL = 5.0


class Progress(Protocol):
    """What an execution tells; all calls come from its own thread."""

    def expect(self, known: Mapping[str, float], workers: int) -> None:
        """A node took `known` seconds formerly, by the stage's name; `workers` share the work."""

    def begin(self, nodes: Sequence[Node], cached: int) -> None:
        """`nodes` are to be computed, `cached` more are not."""

    def extend(self, nodes: Sequence[Node]) -> None:
        """These are to be computed as well."""

    def started(self, node: Node) -> None:
        """The node was handed to a worker (again, if that had died)."""

    def finished(self, node: Node, seconds: float) -> None:
        """The node is in the store."""

    def failed(self, node: Node, failure: StageFailure, skipped: Sequence[Node]) -> None:
        """The node failed while the rest goes on; `skipped` depend on it and will not be tried."""

    def tick(self) -> None:
        """A little time has passed."""

    def note(self, text: str) -> None:
        """One line that the user should see."""

    def close(self) -> None:
        """It is over, well or badly."""


def make_progress() -> Progress:
    """A bar if stderr is a terminal, else lines."""
    return Bar() if sys.stderr.isatty() else Lines()


class Silent:
    """Counts, and shows nothing but notes."""

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
        """Keep them, see `seconds_left`."""
        self.known, self.workers = known, workers

    def begin(self, nodes: Sequence[Node], cached: int) -> None:
        """Begin to count, and to measure the time."""
        self.began = time.monotonic()
        self.cached = cached
        self.extend(nodes)

    def extend(self, nodes: Sequence[Node]) -> None:
        """Count these as still to come."""
        for node in nodes:
            self.total[node.stage.name] = self.total.get(node.stage.name, 0) + 1

    def started(self, node: Node) -> None:
        """Count the node as running."""
        self.running[node.key] = node.stage.name

    def finished(self, node: Node, seconds: float) -> None:
        """Count the node as done."""
        name = node.stage.name
        self.running.pop(node.key, None)
        self.done[name] = self.done.get(name, 0) + 1
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds

    def failed(self, node: Node, failure: StageFailure, skipped: Sequence[Node]) -> None:
        """Count them, and say what failed."""
        self.running.pop(node.key, None)
        self.failures += 1
        self.skipped += len(skipped)
        for one in (node, *skipped):
            self.total[one.stage.name] -= 1
        self.note(f"failed: {' '.join(str(failure).split())}")

    def tick(self) -> None:
        """Show nothing."""

    def note(self, text: str) -> None:
        """Print a line on stderr."""
        print(f"stixel: {text}", file=sys.stderr, flush=True)  # noqa: T201

    def close(self) -> None:
        """Nothing to end."""

    @property
    def all_done(self) -> int:
        """How many nodes are done."""
        return sum(self.done.values())

    @property
    def all_total(self) -> int:
        """How many nodes there are."""
        return sum(self.total.values())

    @property
    def elapsed(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self.began

    def seconds_left(self) -> float | None:
        """What remains, by what nodes of each stage took; None while that is not known."""
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
        """`; about 40 s left`, or nothing where that is not known, or nothing is left."""
        left = self.seconds_left()
        if left is None or self.all_done >= self.all_total:
            return ""
        return f"; about {duration(left)} left"

    @property
    def running_stages(self) -> str:
        """The stages that have nodes with the workers."""
        return ", ".join(dict.fromkeys(self.running.values()))


def obituary(labels: Sequence[str], again: bool) -> str:
    """What is said of a worker that died with nodes of these labels, to be tried again or not."""
    counts = Counter(labels).items()
    told = ", ".join(
        label if count == 1 else f"{label} ({count} points)" for label, count in counts
    )
    if not again:
        return f"a worker died of {told}"
    if len(labels) == 1:
        return f"a worker died while it ran {told}, which is tried once more, alone"
    return f"a worker died while these were running: {told}; each is tried again, alone"


def duration(seconds: float) -> str:
    """A time as one says it: `40 s`, `12 min`, `3 h 20 min`."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60} min"


class Lines(Silent):
    """A line when a stage is complete, and every few seconds."""

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
        """Print a line if there was none for some time."""
        if self.running and self.elapsed - self._last_line > LINE_INTERVAL:
            self._line(f"running {self.running_stages}{self.text_left}")

    def _line(self, text: str) -> None:
        self._last_line = self.elapsed
        self.note(f"[{self.all_done}/{self.all_total}] {text}")


class Bar(Silent):
    """A bar of rich that goes away at the end."""

    def __init__(self):
        super().__init__()
        self._bar = None
        self._task = None

    def tick(self) -> None:
        """Show the bar, or bring it up to date."""
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
            self._bar.console.print(f"stixel: {text}", markup=False, highlight=False)

    def close(self) -> None:
        """Take the bar away."""
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
