"""Progress of an execution: counts of nodes and frames, and the time left."""

import sys
import time
from collections import Counter
from collections.abc import Collection, Mapping, Sequence

from stixel_cli.engine.displays import Lines, make_display
from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.graph import Node
from stixel_cli.engine.parameters import PROGRAM

PATIENCE = 1.0
"""Seconds before the first output: a shorter execution shows nothing."""


class Progress:
    """Count nodes and frames, and show them on a display, if there is one; notes are always shown.

    All calls come from the thread of the execution.

    Args:
        display: None to show only notes.
        uncompiled: modules whose machine code is not cached: the first node of a stage that reaches
            one of them compiles it.
        advice: whether to note files that the user's code may read without declaring them.
    """

    def __init__(
        self,
        display: Lines | None = None,
        uncompiled: Collection[str] = (),
        advice: bool = False,
    ):
        self.display, self.advice = display, advice
        self.uncompiled = frozenset(uncompiled)
        self.total: dict[str, int] = {}
        self.done: dict[str, int] = {}
        self.frames_total: Counter[str] = Counter()
        self.frames_done: Counter[str] = Counter()
        self.seconds: dict[str, float] = {}
        self.running: dict[str, str] = {}
        self.compiling: set[str] = set()
        self.failures = 0
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
            self.frames_total[node.stage.name] += _frames(node)

    def started(self, node: Node) -> None:
        """Count a node as running. A node whose worker crashed starts a second time."""
        name = node.stage.name
        self.running[node.key] = name
        if name not in self.done and not self.uncompiled.isdisjoint(node.identity.code.modules):
            self.compiling.add(name)

    def finished(self, node: Node, seconds: float) -> None:
        """Count a node as done: its result is in the store."""
        name = node.stage.name
        self.running.pop(node.key, None)
        self.compiling.discard(name)
        self.done[name] = self.done.get(name, 0) + 1
        self.frames_done[name] += _frames(node)
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds

    def failed(self, node: Node, failure: StageFailure, skipped: Sequence[Node]) -> None:
        """Report a failed node. The nodes `skipped` depend on it and will not be computed."""
        self.running.pop(node.key, None)
        self.failures += 1
        for one in (node, *skipped):
            self.total[one.stage.name] -= 1
            self.frames_total[one.stage.name] -= _frames(one)
        self.note(f"failed: {' '.join(str(failure).split())}")

    def tick(self) -> None:
        """Update the display. Called several times per second."""
        if self.display is not None and self.all_total and self.elapsed > PATIENCE:
            self.display.show(self.share, self.text)

    def note(self, text: str) -> None:
        """Print one line for the user."""
        if self.display is None or not self.display.note(text):
            print(f"{PROGRAM}: {text}", file=sys.stderr, flush=True)  # noqa: T201

    def close(self) -> None:
        """End the display; the next `tick` may show it again."""
        if self.display is not None:
            self.display.close()

    @property
    def all_done(self) -> int:
        """Number of finished nodes."""
        return sum(self.done.values())

    @property
    def all_total(self) -> int:
        """Number of nodes to compute."""
        return sum(self.total.values())

    @property
    def share(self) -> float:
        """Share of the work that is done, 0 … 1: of frames, summed over the stages."""
        done = sum(max(self.frames_done[name], count) for name, count in self.done.items())
        total = sum(max(self.frames_total[name], count) for name, count in self.total.items())
        return min(1.0, done / total) if total else 1.0

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self.began

    def seconds_left(self) -> float | None:
        """Estimated seconds left; None if nothing is known about a stage.

        As soon as any frame was measured in this execution, a frame of a stage without any measured
        time counts as an average one, and a stage that does not run over frames as nothing.
        """
        frames = sum(self.frames_done.values())
        spent = sum(self.seconds[name] for name in self.done if self.frames_done[name])
        total = 0.0
        for name, count in self.total.items():
            done = self.done.get(name, 0)
            if count <= done:
                continue
            each = self.seconds[name] / done if done else self.known.get(name)
            if each is not None:
                total += (count - done) * each
            elif not frames:
                return None
            else:
                total += self.frames_total[name] * spent / frames
        return total / self.workers

    @property
    def text_left(self) -> str:
        """`; about 40 s left`; empty if that is unknown or all nodes are done."""
        left = self.seconds_left()
        if left is None or self.all_done >= self.all_total:
            return ""
        return f"; about {duration(left)} left"

    @property
    def text(self) -> str:
        """What is running, and the time left, in one line."""
        running = ", ".join(map(self._stage_text, dict.fromkeys(self.running.values())))
        return (running + self.text_left).removeprefix("; ")

    def _stage_text(self, name: str) -> str:
        """`match 20/100 frames`; only the name of a stage that does not run over frames."""
        if name in self.compiling:
            return f"{name}: compiling (first run only)"
        total = self.frames_total[name]
        return f"{name} {self.frames_done[name]}/{total} frames" if total else name


def _frames(node: Node) -> int:
    """Number of frames of a node; 0 for one that does not run over frames."""
    return 0 if node.first is None else node.stop - node.first


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


def make_progress(uncompiled: Collection[str] = (), advice: bool = False) -> Progress:
    """Progress with the display that suits stderr; `uncompiled` and `advice` as in `Progress`."""
    return Progress(make_display(), uncompiled, advice)


def duration(seconds: float) -> str:
    """Format a time: `40 s`, `12 min`, `3 h 20 min`."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60} min"
