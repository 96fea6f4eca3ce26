"""Progress of a sweep, counted in runs and nodes."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.graph import Node
from stixel_cli.engine.progress import Progress
from stixel_cli.sweeps.runs import PlannedRun


class SweepProgress(Progress):
    """Counts runs and nodes, and reports each run as soon as all its results are in the store."""

    def __init__(
        self,
        waiting: Sequence[PlannedRun],
        on_run: Callable[[PlannedRun, Mapping[str, float]], None],
        done: int = 0,
        label: str = "",
        prepare: Callable[[], None] = lambda: None,
        **shown: Any,
    ):
        """Start with no run of `waiting` done.

        Args:
            waiting: the runs to compute.
            on_run: called with each complete run, and the seconds of all nodes computed so far,
                by key.
            done: number of runs that are already done.
            label: prefix of the counts.
            prepare: called once, as soon as the first nodes run: the workers start meanwhile.
            shown: `display` and `uncompiled`, as in `Progress`.
        """
        super().__init__(**shown)
        self.runs_total = done + len(waiting)
        self.runs_done = done
        self.runs_failed = 0
        self.node_seconds: dict[str, float] = {}
        self._on_run = on_run
        self._prepare: Callable[[], None] | None = prepare
        self._label = f"{label}: " if label else ""
        self._left = {one.index: set(one.targets) for one in waiting}
        self._waiting_for: dict[str, list[PlannedRun]] = defaultdict(list)
        for one in waiting:
            for target in one.targets:
                self._waiting_for[target].append(one)

    def begin(self, nodes: Sequence[Node], cached: int) -> None:
        """Count the nodes, and report runs that need no node to run."""
        super().begin(nodes, cached)
        to_run = {node.key for node in nodes}
        for target in [target for target in self._waiting_for if target not in to_run]:
            self._done(target)

    def tick(self) -> None:
        """Update the display; the first time, prepare the end of the sweep."""
        super().tick()
        if self._prepare is not None:
            self._prepare()
            self._prepare = None

    def finished(self, node: Node, seconds: float) -> None:
        """Count the node, and report the runs that waited only for it."""
        super().finished(node, seconds)
        self.node_seconds[node.key] = seconds
        self._done(node.key)

    def failed(self, node: Node, failure: StageFailure, skipped: Sequence[Node]) -> None:
        """Report the failure, and count the runs that cannot become complete."""
        super().failed(node, failure, skipped)
        for one in (node, *skipped):
            for run in self._waiting_for.get(one.key, ()):
                if self._left.pop(run.index, None) is not None:
                    self.runs_failed += 1

    @property
    def text(self) -> str:
        """All counts in one line."""
        failed = f", {self.runs_failed} failed" if self.runs_failed else ""
        parts = [
            f"{self._label}{self.runs_done}/{self.runs_total} runs{failed}",
            f"nodes: {self.all_done}/{self.all_total} done, {self.cached} cached, "
            f"{len(self.running)} running" + (f", {self.failures} failed" if self.failures else ""),
        ]
        if self.compiling:
            parts.append(f"{', '.join(sorted(self.compiling))}: compiling (first run only)")
        return "; ".join(parts) + self.text_left

    def _done(self, target: str) -> None:
        for run in self._waiting_for.get(target, ()):
            left = self._left.get(run.index, set())
            if left == {target}:
                del self._left[run.index]
                self.runs_done += 1
                self._on_run(run, self.node_seconds)
            left.discard(target)
