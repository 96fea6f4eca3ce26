"""Progress of an execution: counts of nodes and frames, the time left, and where they are shown."""

import sys
import time
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.graph import Node
from stixel_cli.engine.parameters import PROGRAM, duration
from stixel_cli.errors import escaped

PATIENCE = 1.0
"""Seconds before the first output: a shorter execution shows nothing."""

LINE_INTERVAL = 5.0
"""Seconds between two lines."""

BAR_WIDTH = 20
"""Characters of the bar on a terminal."""

REPEAT_INTERVAL = 60.0
"""Seconds between two equal lines."""


class Display:
    """Where progress is shown: a bar on a terminal, else a line on stderr every few seconds."""

    def __init__(self):
        self._bar: Any = None
        self._began: float | None = None
        self._last = time.monotonic()
        self._line = ""

    def show(self, share: float, text: str) -> None:
        """Show the share that is done, 0 … 1, and a text of one line.

        Without a terminal a line is printed if the last one is some time ago; an equal one only
        after longer.
        """
        if sys.stderr.isatty():
            self._show_bar(share, text)
            return
        now = time.monotonic()
        line = f"{PROGRAM}: [{100.0 * share:.0f} %] {text}"
        if text and now - self._last > (REPEAT_INTERVAL if line == self._line else LINE_INTERVAL):
            self._last, self._line = now, line
            print(line, file=sys.stderr, flush=True)  # noqa: T201

    def _show_bar(self, share: float, text: str) -> None:
        if self._bar is None:
            self._bar = _rich_bar()
            self._bar.start()
            # A bar that is shown again counts on.
            (task,) = self._bar.tasks
            task.start_time = self._began = self._began or task.start_time
        self._bar.update(self._bar.task_ids[0], completed=share, description=escaped(text))

    def note(self, text: str) -> None:
        """Print one line, above the bar if it is shown."""
        if self._bar is None:
            print(f"{PROGRAM}: {text}", file=sys.stderr, flush=True)  # noqa: T201
        else:
            self._bar.console.print(escaped(f"{PROGRAM}: {text}"), markup=False, highlight=False)

    def close(self) -> None:
        """Remove the bar; the next `show` may show it again."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def _rich_bar() -> Any:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.table import Column

    # Only the text is cut where the terminal is narrow.
    whole, rest = Column(no_wrap=True), Column(no_wrap=True, overflow="ellipsis", ratio=1)
    bar = Progress(
        BarColumn(BAR_WIDTH, table_column=whole),
        TaskProgressColumn(table_column=whole),
        TimeElapsedColumn(table_column=whole),
        TextColumn("{task.description}", markup=False, table_column=rest),
        console=Console(file=getattr(sys.stderr, "rich_proxied_file", sys.stderr)),
        transient=True,
        expand=True,
    )
    bar.add_task("", total=1.0)
    return bar


class Progress(Display):
    """Count nodes and frames, and show them if `visible`; notes are always shown.

    All calls come from the thread of the execution. With `advice`, files are noted that the user's
    code may read without declaring them.
    """

    def __init__(self, visible: bool = False, advice: bool = False):
        super().__init__()
        self.visible, self.advice = visible, advice
        # By the name of the stage.
        self.total: Counter[str] = Counter()
        self.done: Counter[str] = Counter()
        self.frames_total: Counter[str] = Counter()
        self.frames_done: Counter[str] = Counter()
        # Of the nodes that estimates are made of.
        self.seconds: defaultdict[str, list[float]] = defaultdict(list)
        self.running: dict[str, str] = {}
        self.failures = 0
        self.cached = 0
        self.began = time.monotonic()
        # The seconds that a node of each stage took before, and the number of workers.
        self.known: Mapping[str, float] = {}
        self.workers = 1
        self._share = 0.0

    def begin(self, nodes: Sequence[Node], cached: int) -> None:
        """Start: `nodes` will be computed, `cached` others are in the store."""
        self.began = time.monotonic()
        self.cached = cached
        self.extend(nodes)

    def extend(self, nodes: Sequence[Node]) -> None:
        """Add nodes that will be computed as well."""
        for node in nodes:
            self.total[node.stage.name] += 1
            self.frames_total[node.stage.name] += node.frame_count

    def started(self, node: Node) -> None:
        """Count a node as running. A node whose worker crashed starts a second time."""
        self.running[node.key] = node.stage.name

    def finished(self, node: Node, seconds: float) -> None:
        """Count a node as done: its result is in the store.

        Estimates leave out the first ones of a stage, one for each worker, as `Durations.learn`.
        """
        name = node.stage.name
        self.running.pop(node.key, None)
        self.done[name] += 1
        self.frames_done[name] += node.frame_count
        if self.done[name] > self.workers:
            self.seconds[name].append(seconds)

    def failed(
        self, node: Node, failure: StageFailure, skipped: Sequence[Node], of: str = ""
    ) -> None:
        """Report a failed node, of a run that `of` names if there are several.

        The nodes `skipped` depend on it and will not be computed.
        """
        self.running.pop(node.key, None)
        self.failures += 1
        for one in (node, *skipped):
            self.total[one.stage.name] -= 1
            self.frames_total[one.stage.name] -= one.frame_count
        self.note(" ".join(f"failed: {of}{failure}".split()))

    def tick(self) -> None:
        """Update the display. Called several times per second."""
        if self.visible and self.all_total and time.monotonic() - self.began > PATIENCE:
            self.show(self.share, self.text)

    @property
    def all_done(self) -> int:
        """Number of finished nodes."""
        return self.done.total()

    @property
    def all_total(self) -> int:
        """Number of nodes to compute."""
        return self.total.total()

    @property
    def share(self) -> float:
        """Share of the work that is done, 0 … 1: of the nodes' seconds; it never falls.

        While the seconds of a stage are unknown, it is the share of the nodes.
        """
        whole, left = self._work(self.total), self._work(self.total - self.done)
        if whole is None:
            whole, left = self.all_total, self.all_total - self.all_done
        self._share = max(self._share, 1.0 - left / whole if whole > 0.0 else 1.0)
        return self._share

    def _work(self, nodes: Counter[str]) -> float | None:
        """Estimated seconds of so many nodes of each stage; None if a stage's are unknown."""
        seen = {name: sum(own) / len(own) for name, own in self.seconds.items()}
        times = {**self.known, **seen}
        if any(count and name not in times for name, count in nodes.items()):
            return None
        return sum(count * times.get(name, 0.0) for name, count in nodes.items())

    def seconds_left(self) -> float | None:
        """Estimated seconds until the workers are done; None if that is unknown."""
        left = self._work(self.total - self.done)
        return None if left is None else left / self.workers

    @property
    def text_left(self) -> str:
        """`about 40 s left; `; empty if that is unknown or all nodes are done."""
        left = self.seconds_left() if self.all_done < self.all_total else None
        return "" if left is None else f"about {duration(left)} left; "

    @property
    def text(self) -> str:
        """The time left, and what is running, in one line."""
        running = ", ".join(map(self._stage_text, dict.fromkeys(self.running.values())))
        return (self.text_left + running).removesuffix("; ")

    def _stage_text(self, name: str) -> str:
        """`match 20/100 frames`; only the name of a stage that does not run over frames."""
        total = self.frames_total[name]
        return f"{name} {self.frames_done[name]}/{total} frames" if total else name


def crash_note(labels: Sequence[str], retry: bool) -> str:
    """Message for a worker that crashed while it ran nodes with these labels."""
    names = ", ".join(
        label if count == 1 else f"{label} ({count} nodes)"
        for label, count in Counter(labels).items()
    )
    again = "; retrying it" if len(labels) == 1 else "; retrying them one at a time"
    return f"a worker crashed while running {names}{again if retry else ''}"
