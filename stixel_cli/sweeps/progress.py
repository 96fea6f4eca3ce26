"""Progress of a sweep on stderr, runs and nodes: a bar on a terminal, lines elsewhere."""

import sys
from collections.abc import Callable, Mapping, Sequence

from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.graph import Node
from stixel_cli.engine.progress import LINE_INTERVAL, PATIENCE, Progress
from stixel_cli.sweeps.graphs import PlannedRun


class SweepProgress(Progress):
    """Counts runs and nodes, and reports each run as soon as all its results are in the store."""

    def __init__(
        self,
        waiting: Sequence[PlannedRun],
        finished: int,
        workers: int,
        known_seconds: Mapping[str, float],
        on_run: Callable[[PlannedRun, Mapping[str, float]], None],
        visible: bool = True,
        label: str = "",
    ):
        """Start with no run of `waiting` done.

        Args:
            waiting: the runs to compute.
            finished: number of runs that are already done.
            workers: number of workers.
            known_seconds: recorded seconds of a node, by stage name.
            on_run: called with each complete run, and the seconds of all nodes computed so far,
                by key.
            visible: show more than notes.
            label: prefix of the counts.
        """
        super().__init__()
        self.runs_total = finished + len(waiting)
        self.runs_done = finished
        self.runs_failed = 0
        self.node_seconds: dict[str, float] = {}
        self.expect(known_seconds, workers)
        self._on_run = on_run
        self._label = f"{label}: " if label else ""
        self._left = {one.run.index: set(one.targets) for one in waiting}
        self._runs = {one.run.index: one for one in waiting}
        self._waiting_for: dict[str, list[int]] = {}
        for one in waiting:
            for target in one.targets:
                self._waiting_for.setdefault(target, []).append(one.run.index)
        self._display = _display() if visible else None

    def begin(self, nodes: Sequence[Node], cached: int) -> None:
        """Count the nodes, and report runs that need no node to run."""
        super().begin(nodes, cached)
        to_run = {node.key for node in nodes}
        for target in [target for target in self._waiting_for if target not in to_run]:
            self._done(target)

    def finished(self, node: Node, seconds: float) -> None:
        """Count the node, and report the runs that waited only for it."""
        super().finished(node, seconds)
        self.node_seconds[node.key] = seconds
        self._done(node.key)

    def failed(self, node: Node, failure: StageFailure, skipped: Sequence[Node]) -> None:
        """Report the failure, and count the runs that cannot become complete."""
        super().failed(node, failure, skipped)
        for one in (node, *skipped):
            for index in self._waiting_for.get(one.key, ()):
                if self._left.pop(index, None) is not None:
                    self.runs_failed += 1

    def tick(self) -> None:
        """Show the progress."""
        if self._display is not None and self.elapsed > PATIENCE:
            self._display.show(self)

    def note(self, text: str) -> None:
        """Print a line on stderr, above a bar."""
        if self._display is None or not self._display.note(text):
            super().note(text)

    def close(self) -> None:
        """Remove the bar."""
        if self._display is not None:
            self._display.close()

    @property
    def text(self) -> str:
        """All counts in one line."""
        failed = f", {self.runs_failed} failed" if self.runs_failed else ""
        parts = [
            f"{self._label}{self.runs_done}/{self.runs_total} runs{failed}",
            f"nodes: {self.all_done}/{self.all_total} done, {self.cached} cached, "
            f"{len(self.running)} running" + (f", {self.failures} failed" if self.failures else ""),
        ]
        return "; ".join(parts) + self.text_left

    def _done(self, target: str) -> None:
        for index in self._waiting_for.get(target, ()):
            left = self._left.get(index)
            if left is None:
                continue
            left.discard(target)
            if not left:
                del self._left[index]
                self.runs_done += 1
                self._on_run(self._runs[index], self.node_seconds)


def _display() -> "_Lines | _Bar":
    return _Bar() if sys.stderr.isatty() else _Lines()


class _Lines:
    """A line every few seconds."""

    def __init__(self):
        self._last = 0.0

    def show(self, progress: SweepProgress) -> None:
        if progress.elapsed - self._last > LINE_INTERVAL:
            self._last = progress.elapsed
            progress.note(progress.text)

    def note(self, text: str) -> bool:
        return False

    def close(self) -> None:
        pass


class _Bar:
    """A bar of rich, removed at the end."""

    def __init__(self):
        self._bar = None

    def show(self, progress: SweepProgress) -> None:
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn

            self._bar = Progress(
                BarColumn(),
                TextColumn("{task.description}"),
                console=Console(stderr=True),
                transient=True,
            )
            self._task = self._bar.add_task("")
            self._bar.start()
        self._bar.update(
            self._task,
            completed=progress.all_done,
            total=progress.all_total,
            description=progress.text,
        )

    def note(self, text: str) -> bool:
        if self._bar is None:
            return False
        self._bar.console.print(f"stixel: {text}", markup=False, highlight=False)
        return True

    def close(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
