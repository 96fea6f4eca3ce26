"""The loop that submits nodes to a pool of workers and collects their outcomes."""

import heapq
import pickle
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from pathlib import Path
from typing import Any, Literal, get_args

from stixel_cli.border.origins import unpickled
from stixel_cli.engine import errors
from stixel_cli.engine.cache_folder import Lease, new_name
from stixel_cli.engine.entries import keep_limit
from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.graph import Node
from stixel_cli.engine.keys import CHUNKED
from stixel_cli.engine.limits import TimeLimit, limited, mark_text, one_thread
from stixel_cli.engine.loaded_code import planned_function
from stixel_cli.engine.plan import Plan, missing_nodes
from stixel_cli.engine.pools import Pool, SerialPool, deferred_interrupts, error_of
from stixel_cli.engine.progress import Progress, crash_note
from stixel_cli.engine.store import Store
from stixel_cli.engine.versions import check_versions


@dataclass(frozen=True)
class Outcome:
    """Outcome of the computation of a node."""

    status: Literal["computed", "cached", "missing", "failed"]
    """`computed`, `cached` (another process was first), `missing` (an input is missing or damaged),
    or `failed`."""
    seconds: float = 0.0
    """Time to load, compute and store, without the wait for the lock."""
    size: int = 0
    """Bytes that were stored."""
    error: Exception | None = None
    """MissingEntry of the missing input, or the stage's error."""
    traceback_text: str = ""
    """See `StageFailure`."""


class ChunkSequence(Sequence):
    """The chunks of an input in order. Each access loads the chunk from the store."""

    def __init__(self, keys: tuple[str, ...], load: Callable[[str], Any]):
        self._keys = keys
        self._load = load

    def __len__(self) -> int:
        return len(self._keys)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return ChunkSequence(self._keys[index], self._load)
        return self._load(self._keys[index])


def run_node(node: Node, folder: Path, limit: TimeLimit | None = None) -> Outcome:
    """Compute a node and store it at `folder`, unless the store has it by now."""
    store = Store(folder)
    started = time.perf_counter()
    try:
        with store.lock(node.key):
            if store.has(node.key):
                return Outcome("cached")
            started = time.perf_counter()
            with limited(limit):
                size = _compute(node, store)
            return Outcome("computed", time.perf_counter() - started, size)
    except Exception as error:
        seconds = time.perf_counter() - started
        if isinstance(error, MissingEntry) and error.key in node.sources:
            return Outcome("missing", seconds, error=error)
        return Outcome("failed", seconds, error=_portable(error), traceback_text=_own_part(error))


def _compute(node: Node, store: Store) -> int:
    """Load, call and store; return the size of the result in bytes."""
    # CPU time of this thread does not depend on the load of the machine. It does not include
    # processes that the function starts.
    started, cpu_started = time.perf_counter(), time.thread_time()
    check_versions(node.identity.content)
    code = node.identity.code
    function = planned_function(node.stage.function, code)
    arguments = _arguments(node, store)
    with one_thread():
        value = function(**arguments)
    return store.save(
        node.key,
        value,
        **node.identity.content,
        label=node.label,
        frames=node.frames,
        inputs={name: list(keys) for name, keys in node.inputs.items()},
        previous=node.previous,
        modules=code.modules,
        seconds=round(time.perf_counter() - started, 4),
        cpu_seconds=round(time.thread_time() - cpu_started, 6),
        created=round(time.time(), 3),
    )


def _arguments(node: Node, store: Store) -> dict[str, Any]:
    """The settings, frames, seed and files of a node, and its inputs, loaded from the store."""
    stage = node.stage
    arguments = dict(stage.settings)
    if stage.pattern in CHUNKED:
        arguments["frames"] = range(node.first, node.stop)
    elif stage.pattern == "pick":
        arguments["frame"] = node.first
    if stage.seed is not None:
        arguments["seed"] = stage.seed
    if stage.gives_files:
        arguments["files"] = stage.files
    for name, keys in node.inputs.items():
        lazy = name in node.sequences
        arguments[name] = ChunkSequence(keys, store.load) if lazy else store.load(keys[0])
    if stage.pattern == "fold":
        arguments["previous"] = None if node.previous is None else store.load(node.previous)
    return arguments


def _own_part(error: Exception) -> str:
    """The traceback without the first frames, which are of this module."""
    trace = error.__traceback__
    while trace and trace.tb_next and trace.tb_frame.f_code.co_filename == __file__:
        trace = trace.tb_next
    return "".join(traceback.format_exception(type(error), error, trace))


def _portable(error: Exception) -> Exception:
    """The error, or its text if it cannot be pickled."""
    with suppress(Exception):
        if str(unpickled(pickle.dumps(error))) == str(error):
            return error
    return RuntimeError(f"{type(error).__name__}: {error}")


Status = Literal["failed", "skipped", "computed", "cached"]
"""`skipped`: depends on a node that failed."""
STATUSES = get_args(Status)

TICK = 0.25
"""Seconds between two updates of the progress."""

TRIES = 3
"""Number of attempts for a node whose inputs turn out to be missing or damaged."""

SLACK = 0.05
"""During an execution the limit of the store is kept each time this share of it is written."""

FATAL = (errors.CacheError, errors.CodeChanged, errors.ExecutorError)
"""Errors that the next node would meet as well."""


@dataclass
class Scheduler:
    """The state of one execution; for `store`, `progress` and `keep_going` see `execute`."""

    planned: Plan
    store: Store
    pool: Pool
    """Where tasks run."""
    progress: Progress
    time_limit: float | None
    """Of a node, in seconds; None for no limit."""
    keep_going: bool
    lease: Lease
    """On the needed keys; already taken."""
    first: frozenset[str] = frozenset()
    """Missing keys to compute before all others."""
    on_first: Callable[[], None] | None = None
    """Called once, when no key of `first` is left to compute."""
    here: frozenset[str] = frozenset()
    """Missing keys to compute in this process, whatever the pool."""
    seconds: dict[str, float] = field(default_factory=dict)
    """By key, of the nodes that this execution computed."""
    failures: dict[str, errors.StageFailure] = field(default_factory=dict)
    """By key, of the failed nodes, with `keep_going`."""

    def __post_init__(self):
        self.graph = self.planned.graph
        self._name = new_name()
        self._written = 0
        self._done: set[str] = set()
        self._skipped: set[str] = set()
        self._tries: Counter[str] = Counter()
        self._deaths: Counter[str] = Counter()
        self._in_flight: dict[Future, str] = {}
        self._suspects: deque[str] = deque()
        """Nodes that were running when a worker crashed. Each is retried on its own."""
        self._fatal: BaseException | None = None
        self._check_interrupt: Callable[[], None] = lambda: None

    def all(self) -> None:
        """Compute all missing nodes. Damaged inputs are recomputed in another round.

        Ctrl-C takes effect between two waits for futures; a stage in this process ends at once.
        """
        missing: Collection[str] = self.planned.missing
        with ExitStack() as entered:
            if missing and (self.here or not self.pool.kills):
                # The calling thread may have set limits of its own, so it keeps these all the time.
                entered.enter_context(one_thread())
            if not isinstance(self.pool, SerialPool):
                self._check_interrupt = entered.enter_context(deferred_interrupts())
            cached = len(self.planned.needed) - len(missing)
            self.progress.begin([self.graph.nodes[key] for key in missing], cached)
            self._report_first()
            while missing:
                self._round(missing)
                if self._fatal is not None:
                    raise self._fatal
                undone = self._undone(missing)
                missing = missing_nodes(self.graph, undone, self.store)
                again = set(missing).difference(undone)
                self._done -= again
                self.progress.extend([self.graph.nodes[key] for key in again])

    def keep_limit(self) -> None:
        """Keep the limit of the store, if it has one and results were written."""
        if self.store.max_size is not None and self._written:
            self._written = 0
            # The targets, and inputs that are still needed, must stay in the store.
            undone = self._undone(self.planned.missing)
            sources = {source for key in undone for source in self.graph.nodes[key].sources}
            self.lease.take(sorted(sources.union(undone, self.planned.targets)))
            keep_limit(self.store)

    def _undone(self, keys: Iterable[str]) -> list[str]:
        over = self._done | self._skipped | self.failures.keys()
        return [key for key in keys if key not in over]

    def statuses(self) -> dict[str, Status]:
        """Status of each node that the targets need, in the order of the graph."""
        groups = dict(zip(STATUSES, (self.failures, self._skipped, self.seconds), strict=False))
        return {
            key: next((name for name, group in groups.items() if key in group), "cached")
            for key in self.graph.nodes
            if key in self.planned.needed
        }

    def _round(self, keys: Collection[str]) -> None:
        """Compute `keys`, except nodes whose inputs fail or are missing."""
        wanted = set(keys)
        nodes = self.graph.nodes
        sources = {key: [s for s in nodes[key].sources if s in wanted] for key in keys}
        sorter = TopologicalSorter(sources)
        sorter.prepare()
        # Of the workers, and of this process.
        self._ready: dict[bool, list[tuple[bool, int, int, str]]] = {False: [], True: []}
        self._order = {key: position for position, key in enumerate(keys)}
        while True:
            for key in sorter.get_ready():
                self._push(key)
            self._submit_ready()
            if not self._in_flight:
                return
            finished, _ = wait(self._in_flight, timeout=TICK, return_when=FIRST_COMPLETED)
            self._check_interrupt()
            for key in self._collect(finished):
                sorter.done(key)
            self._report_first()
            if self.store.max_size and self._written > self.store.max_size * SLACK:
                self.keep_limit()
            self.pool.tend(self.progress.note)
            self.progress.tick()

    def _report_first(self) -> None:
        if self.on_first is not None and self._done.issuperset(self.first):
            # `on_first` may print to the terminal that shows the progress.
            self.progress.close()
            self.on_first()
            self.on_first = None

    def _push(self, key: str) -> None:
        # Deepest first, so that each chunk finishes early.
        depth, order = self.graph.nodes[key].depth, self._order[key]
        heapq.heappush(self._ready[key in self.here], (key not in self.first, -depth, order, key))

    def _submit_ready(self) -> None:
        """Submit ready nodes up to the limit of the pool."""
        if self._fatal is not None:
            return
        if self._suspects:
            if not self._in_flight:
                self._submit(self._suspects.popleft())
            return
        of_workers, here = self._ready[False], self._ready[True]
        # Last in this process, which is busy then: no other task waits ahead of what follows it.
        limit = self.pool.limit - bool(here)
        while of_workers and len(self._in_flight) < limit and self._fatal is None:
            self._submit(heapq.heappop(of_workers)[-1])
        if here and self._fatal is None:
            self._submit(heapq.heappop(here)[-1])

    def _submit(self, key: str) -> None:
        node = self.graph.nodes[key]
        self.progress.started(node)
        pool = SerialPool() if key in self.here else self.pool
        try:
            future = pool.submit(run_node, node, self.store.folder, self._limit(key))
            self._in_flight[future] = key
        except errors.ExecutorError as error:
            self._fatal = error

    def _limit(self, key: str) -> TimeLimit | None:
        if self.time_limit is None:
            return None
        mark = self.store.folder / "tmp" / f"limit-{self._name}-{key[:16]}"
        in_a_process = self.pool.kills and key not in self.here
        return TimeLimit(self.time_limit, mark if in_a_process else None)

    def _collect(self, finished: Collection[Future]) -> list[str]:
        """Process finished futures; return the keys of the nodes that are in the store now."""
        crashed = any(self.pool.died(error_of(future)) for future in finished)
        if crashed and self.pool.all_die_together:
            # All running tasks fail with a worker, except those that finished before it crashed.
            finished, _ = wait(self._in_flight)
        done, dead = [], []
        for future in [future for future in self._in_flight if future in finished]:
            key = self._in_flight.pop(future)
            error = error_of(future)
            if self.pool.died(error):
                dead.append(key)
            elif isinstance(error, CancelledError) and self._fatal is not None:
                continue
            elif error is not None:
                self._fail(key, error, "".join(traceback.format_exception(error)))
            elif self._take(key, future.result()):
                done.append(key)
        if dead:
            self.pool.renew()
            self._crashed(dead)
        if self._fatal is not None:
            for future in self._in_flight:
                future.cancel()
        return done

    def _take(self, key: str, outcome: Outcome) -> bool:
        """Process the outcome of a node; return whether it is in the store now."""
        node = self.graph.nodes[key]
        if outcome.status == "failed":
            self._fail(key, outcome.error, outcome.traceback_text)
            return False
        if outcome.status == "missing":
            self._tries[key] += 1
            reason = outcome.error.reason
            what = f"cached result of {self.graph.nodes[outcome.error.key].label}"
            self.progress.note(f"{what} is unusable ({reason}); recomputing it")
            if self._tries[key] >= TRIES and self._fatal is None:
                self._fatal = errors.CacheError(
                    f"the {what} in {self.store.folder} is unusable and cannot be replaced: "
                    f"{reason}"
                )
            return False
        # A worker may have stored the result just before it crashed with another task.
        if outcome.status == "computed" or self._deaths[key]:
            self.seconds[key] = self.seconds.get(key, 0.0) + outcome.seconds
            self._written += outcome.size
        self._done.add(key)
        self.progress.finished(node, outcome.seconds)
        return True

    def _crashed(self, dead: list[str]) -> None:
        """Handle the nodes that were running when a worker crashed or exceeded a time limit."""
        over = {key: text for key in dead if (text := mark_text(self._limit(key))) is not None}
        for key, text in over.items():
            self._fail(key, self._limit(key).error, text)
        if over:
            for key in set(dead).difference(over):
                self._push(key)
            return
        for key in dead:
            self._deaths[key] += 1
            if len(dead) == 1 and self._deaths[key] > 1:
                self._fail(key, errors.WorkerDied("it crashed its worker twice"), "")
            else:
                self._suspects.append(key)
        labels = [self.graph.nodes[key].label for key in dead]
        self.progress.note(crash_note(labels, any(key in self._suspects for key in dead)))

    def _fail(self, key: str, error: BaseException, traceback_text: str) -> None:
        if self._fatal is not None or isinstance(error, FATAL):
            self._fatal = self._fatal or error
            return
        node = self.graph.nodes[key]
        files = frozenset(map(str, node.identity.code.of_user.values() if node.stage.own else ()))
        failure = errors.StageFailure(node.stage.name, node.label, error, traceback_text, files)
        failure.__cause__, failure.key = error, key
        if not self.keep_going:
            self._fatal = failure
            return
        self.failures[key] = failure
        skipped = self.graph.dependents(key, self.planned.missing) - self._done - self._skipped
        self._skipped |= skipped
        self.progress.failed(node, failure, [self.graph.nodes[key] for key in sorted(skipped)])
