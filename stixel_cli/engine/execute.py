"""One loop that computes what is missing, on any pool of workers."""

import heapq
import traceback
from collections import defaultdict, deque
from collections.abc import Collection, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from graphlib import TopologicalSorter

from stixel_cli.engine.durations import Durations
from stixel_cli.engine.errors import CacheError, CodeChanged, StageFailure, WorkerDied
from stixel_cli.engine.graph import Graph, Node
from stixel_cli.engine.loaded_code import may_run_here
from stixel_cli.engine.plan import Plan, missing_nodes, plan
from stixel_cli.engine.pools import ExecutorName, Pool, SerialPool, check_pool, make_pool
from stixel_cli.engine.progress import Progress, Silent
from stixel_cli.engine.records import Execution, NodeRecord
from stixel_cli.engine.run_task import run_task
from stixel_cli.engine.store import Store
from stixel_cli.engine.task import Outcome, task_of

SMALL = 1.5
"""Work below this, in seconds, is done in this process: starting workers would take as long."""

TICK = 0.25
"""Seconds between two looks at the progress."""

TRIES = 3
"""How often a node is tried whose inputs turn out to be missing or damaged."""


def execute(
    graph: Graph,
    targets: Sequence[str],
    store: Store,
    workers: int = 2,
    executor: ExecutorName = "local",
    progress: Progress | None = None,
) -> Execution:
    """Compute what the `targets` (stage names or node ids) need and `store` does not hold yet.

    Afterwards every target can be loaded from the store. `executor="local"` uses `workers`
    processes, or none where there is little to do; the results do not depend on it.

    Raises:
        StageFailure: a stage raised, or killed its worker twice. What was running is finished
            and kept, the rest is not begun.
        CacheError: the store cannot be read or written.
        CodeChanged: a stage was edited after the graph had been built.
        KeyError: no such target.
        ValueError: no such executor, or fewer than one worker.
    """
    check_pool(executor, workers)
    planned = plan(graph, targets, store)
    progress = Silent() if progress is None else progress
    durations = Durations(store.folder)
    if planned.missing:
        store.check_writable()
    nodes = [graph.nodes[key] for key in planned.missing]
    serial = executor == "local" and _is_small(nodes, durations)
    pool = SerialPool() if serial else make_pool(executor, workers)
    run = _Run(planned, store, pool, progress)
    try:
        run.all()
    finally:
        # By now nothing runs, or what does is not wanted any more.
        pool.close()
        progress.close()
        durations.learn(run.seconds_by_function())
    return Execution(graph, run.records())


def _is_small(nodes: Sequence[Node], durations: Durations) -> bool:
    estimate = durations.estimate(nodes)
    return (
        estimate is not None
        and estimate < SMALL
        and all(may_run_here(node.identity.code) for node in nodes)
    )


class _Run:
    """The state of one execution."""

    def __init__(self, planned: Plan, store: Store, pool: Pool, progress: Progress):
        self.graph = planned.graph
        self.planned = planned
        self.store = store
        self.pool = pool
        self.progress = progress
        self.seconds: dict[str, float] = {}
        """Of the nodes that were computed; what someone else computed meanwhile is not among."""
        self.done: set[str] = set()
        self.tries: dict[str, int] = defaultdict(int)
        self.deaths: dict[str, int] = defaultdict(int)
        self.in_flight: dict[Future, str] = {}
        self.suspects: deque[str] = deque()
        """Nodes that were in flight when a worker died: tried again, each with nothing beside."""
        self.failure: BaseException | None = None

    def all(self) -> None:
        """Compute all that is missing. Inputs that turn out damaged make for another round."""
        missing: Collection[str] = self.planned.missing
        cached = len(self.planned.needed) - len(missing)
        self.progress.begin([self.graph.nodes[key] for key in missing], cached)
        while missing:
            self.round(missing)
            if self.failure is not None:
                raise self.failure
            undone = [key for key in missing if key not in self.done]
            missing = missing_nodes(self.graph, undone, self.store)
            again = set(missing).difference(undone)
            self.done -= again
            self.progress.extend([self.graph.nodes[key] for key in again])

    def round(self, keys: Collection[str]) -> None:
        """Compute `keys`, but for those whose inputs are found missing."""
        wanted = set(keys)
        nodes = self.graph.nodes
        sorter = TopologicalSorter(
            {key: [s for s in nodes[key].sources if s in wanted] for key in keys}
        )
        sorter.prepare()
        ready: list[tuple[int, int, str]] = []
        order = {key: position for position, key in enumerate(keys)}
        while True:
            for key in sorter.get_ready():
                # What lies deepest first: chunks come to their end early.
                heapq.heappush(ready, (-nodes[key].depth, order[key], key))
            self.hand_out(ready)
            if not self.in_flight:
                return
            finished, _ = wait(self.in_flight, timeout=TICK, return_when=FIRST_COMPLETED)
            for key in self.collect(finished):
                sorter.done(key)
            self.progress.tick()

    def hand_out(self, ready: list[tuple[int, int, str]]) -> None:
        """Give the pool what it can take."""
        if self.failure is not None:
            return
        if self.suspects:
            if not self.in_flight:
                self.submit(self.suspects.popleft())
            return
        while ready and len(self.in_flight) < self.pool.limit:
            self.submit(heapq.heappop(ready)[2])

    def submit(self, key: str) -> None:
        node = self.graph.nodes[key]
        self.progress.started(node)
        try:
            future = self.pool.submit(run_task, task_of(node), self.store.folder)
        except BrokenExecutor as error:
            # A worker died just now. This one is as suspect as those in flight, no more.
            future = Future()
            future.set_exception(error)
        self.in_flight[future] = key

    def collect(self, finished: Collection[Future]) -> list[str]:
        """Take in what has finished; the keys of the nodes that are in the store now."""
        if any(isinstance(_error(future), BrokenExecutor) for future in finished):
            # All in flight fail with a worker, but for those that were through before it died.
            finished, _ = wait(self.in_flight)
        done, dead = [], []
        for future in [future for future in self.in_flight if future in finished]:
            key = self.in_flight.pop(future)
            error = _error(future)
            if isinstance(error, BrokenExecutor):
                dead.append(key)
            elif isinstance(error, CancelledError):
                continue
            elif error is not None:
                self.fail(key, error, "".join(traceback.format_exception(error)))
            elif self.take(key, future.result()):
                done.append(key)
        if dead:
            self.pool.renew()
            self.bury(dead)
        if self.failure is not None:
            for future in self.in_flight:
                future.cancel()
        return done

    def take(self, key: str, outcome: Outcome) -> bool:
        """Take in what became of a node; whether it is in the store now."""
        node = self.graph.nodes[key]
        if outcome.status == "failed":
            self.fail(key, outcome.error, outcome.traceback_text)
            return False
        if outcome.status == "missing":
            self.tries[key] += 1
            labels = [(self.graph.nodes[k].label, reason) for k, reason in outcome.missing]
            for label, reason in labels:
                self.progress.note(f"cached result of {label} is not usable: {reason}; made again")
            if self.tries[key] >= TRIES:
                label, reason = labels[0]
                self.failure = CacheError(
                    f"the cached result of {label} in {self.store.folder} cannot be used "
                    f"nor replaced: {reason}"
                )
            return False
        if outcome.status == "computed":
            self.seconds[key] = self.seconds.get(key, 0.0) + outcome.seconds
        self.done.add(key)
        self.progress.finished(node, outcome.seconds)
        return True

    def bury(self, dead: list[str]) -> None:
        """A worker died with these in flight. The culprit is who dies alone, and did before."""
        for key in dead:
            self.deaths[key] += 1
            if len(dead) == 1 and self.deaths[key] > 1:
                self.fail(key, WorkerDied("it killed the process that ran it, twice"), "")
            else:
                self.suspects.append(key)
        labels = ", ".join(self.graph.nodes[key].label for key in dead)
        self.progress.note(f"a worker died while these were running: {labels}")

    def fail(self, key: str, error: BaseException, traceback_text: str) -> None:
        if self.failure is not None:
            return
        if isinstance(error, CacheError | CodeChanged):
            self.failure = error
            return
        node = self.graph.nodes[key]
        self.failure = StageFailure(node.stage.name, node.label, error, traceback_text)
        self.failure.__cause__ = error

    def records(self) -> dict[str, NodeRecord]:
        return {
            key: NodeRecord(
                key=key,
                stage=node.stage.name,
                label=node.label,
                status="computed" if key in self.seconds else "cached",
                seconds=round(self.seconds.get(key, 0.0), 4),
            )
            for key, node in self.graph.nodes.items()
            if key in self.planned.needed
        }

    def seconds_by_function(self) -> dict[str, list[float]]:
        by_function: dict[str, list[float]] = {}
        for key, seconds in self.seconds.items():
            by_function.setdefault(self.graph.nodes[key].stage.function, []).append(seconds)
        return by_function


def _error(future: Future) -> BaseException | None:
    """What a finished future ended with, None if with a result."""
    return CancelledError() if future.cancelled() else future.exception()
