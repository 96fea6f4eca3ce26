"""Compute the missing results with any pool of workers, and record what was done."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from stixel_cli.engine.cache_folder import Lease
from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.graph import Graph, Node
from stixel_cli.engine.keys import digest
from stixel_cli.engine.limits import can_interrupt
from stixel_cli.engine.loaded_code import check_bytecode, import_function, may_run_here
from stixel_cli.engine.parameters import DaskExecutor, Executor, LocalExecutor, ThreadsExecutor
from stixel_cli.engine.plan import Durations, plan, undeclared_reads
from stixel_cli.engine.pools import Pool, ProcessPool, SerialPool, ThreadPool, fork_is_safe
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.scheduler import STATUSES, Scheduler, Status
from stixel_cli.engine.source_files import save_digests
from stixel_cli.engine.store import Store


@dataclass(frozen=True)
class Execution:
    """Record of an execution."""

    graph: Graph
    """The executed graph."""
    status: Mapping[str, Status]
    """By node id, of the targets and all nodes that they depend on."""
    seconds: Mapping[str, float]
    """By node id, of the nodes that this execution computed."""
    failures: Mapping[str, StageFailure] = field(default_factory=dict)
    """By node id, of the failed nodes; only with `keep_going`."""
    store: Store | None = None
    """That has the results; None in the record of a part."""

    def failure_of(self, targets: Sequence[str]) -> tuple[str, StageFailure] | None:
        """The first failed node that `targets` depend on, and its failure; None if none failed.

        First means nearest to the inputs of the graph.
        """
        ancestors = self.graph.ancestors(targets) if self.failures else set()
        failed = [key for key in self.failures if key in ancestors]
        first = min(failed, key=lambda key: (self.graph.nodes[key].depth, key), default=None)
        return None if first is None else (first, self.failures[first])

    def stage_records(self) -> list[dict[str, Any]]:
        """A record of each stage as plain JSON, each after its inputs.

        `key` of its node, or the digest of the keys of its nodes; `status`, the first of `failed`,
        `skipped`, `computed`, `cached` that any node has; `seconds`, summed over all workers;
        `nodes`, `nodes_computed`, their numbers.
        """
        records = []
        for name, nodes in self.graph.stages.items():
            keys = [key for key in nodes if key in self.status]
            states = [self.status[key] for key in keys]
            seconds = [self.seconds.get(key, 0.0) for key in keys]
            if keys:
                records.append(
                    {
                        "name": name,
                        "key": keys[0] if len(keys) == 1 else digest(keys),
                        "status": min(states, key=STATUSES.index),
                        "seconds": round(sum(round(one, 4) for one in seconds), 4),
                        "nodes": len(keys),
                        "nodes_computed": states.count("computed"),
                    }
                )
        return records


SMALL, SMALL_FOR_COPIES = 1.5, 0.5
"""Seconds of work that are done in this process: starting workers, or copies, takes as long."""


def execute(
    graph: Graph,
    targets: Sequence[str],
    store: Store,
    executor: Executor | None = None,
    progress: Progress | None = None,
    keep_going: bool = False,
    first: Sequence[str] = (),
    on_first: Callable[[], None] | None = None,
) -> Execution:
    """Compute the results that `targets` (stage names or node ids) need and `store` lacks.

    Afterwards every target can be loaded from the store, and the store's limit is kept. Results do
    not depend on the executor. Without one, and for little work, no worker is started.

    With `keep_going` a failing node does not stop the others: nodes that depend on it are skipped,
    and the failures are in the returned execution.

    The nodes that the targets `first` need are computed before all others; while this process does
    one, the workers do others. `on_first` is called once, as soon as `first` are in the store.

    Raises:
        StageFailure: a stage raised an error, exceeded its time limit, or crashed its worker twice.
            Running nodes are finished and stored, others are not started. Not with `keep_going`.
        CacheError: the store cannot be read or written.
        CodeChanged: a stage was edited after the graph was built.
        ExecutorError: no workers are available, all were lost, or a library uses more than one
            thread.
        KeyError: no such target.
    """
    progress = Progress() if progress is None else progress
    with Lease(store.folder, sorted(graph.ancestors(targets))) as lease:
        planned = plan(graph, targets, store)
        nodes = [graph.nodes[key] for key in planned.missing]
        needed_first = graph.ancestors(first)
        nodes_first = [node for node in nodes if node.key in needed_first]
        _prepare(nodes, store, progress)
        durations = Durations(store.folder)
        small = (some for some in (nodes, nodes_first) if _runs_here(executor, some, durations))
        here = next(small, [])
        all_here = len(here) == len(nodes)
        pool = SerialPool() if all_here else make_pool(executor, nodes, here)
        progress.known = durations.by_stage(nodes)
        progress.workers = 1 if all_here else executor.workers
        time_limit = getattr(executor, "time_limit", None)
        scheduler = Scheduler(
            planned, store, pool, progress, time_limit, keep_going, lease, on_first=on_first
        )
        scheduler.first = frozenset(node.key for node in nodes_first)
        scheduler.here = frozenset(node.key for node in here)
        try:
            scheduler.all()
        finally:
            # Nothing runs any more, or its result is not wanted.
            pool.close()
            progress.close()
            durations.learn(graph, scheduler.seconds, progress.workers)
        scheduler.keep_limit()
    return Execution(graph, scheduler.statuses(), scheduler.seconds, scheduler.failures, store)


def _prepare(nodes: Sequence[Node], store: Store, progress: Progress) -> None:
    """Check that Python can store results, and runs the sources that nodes reach."""
    for text in undeclared_reads(nodes) if progress.advice else ():
        progress.note(text)
    if nodes:
        import_module("joblib")  # Of the store; in a copy of this process as well.
        store.check_writable()
    codes = {id(node.identity.code): node.identity.code for node in nodes}.values()
    save_digests(store.folder)
    check_bytecode({name: file for code in codes for name, (file, _) in code.files.items()})


def make_pool(executor: Executor, nodes: Sequence[Node], here: Sequence[Node]) -> Pool:
    """Make the pool of an executor for `nodes`, those `here` excepted.

    ExecutorError if its workers cannot be started or reached; one line.
    """
    if isinstance(executor, ThreadsExecutor):
        return ThreadPool(executor.workers)
    if isinstance(executor, DaskExecutor):
        from stixel_cli.engine.dask_pool import DaskPool

        return DaskPool(executor)
    # A copy of this process must not run modules that were edited after their import.
    copies = all(may_run_here(node.identity.code) for node in nodes)
    pool = ProcessPool(executor.workers, may_fork=copies)
    for node in _to_import(nodes, here, executor.workers):
        pool.submit(import_function, node.stage.function, node.identity.code)
    return pool


def _to_import(nodes: Sequence[Node], here: Sequence[Node], workers: int) -> list[Node]:
    """Nodes whose code the workers import that have nothing to compute at first.

    They are of different stages, those with most nodes first.
    """
    missing = {node.key for node in nodes}
    given = missing.difference(node.key for node in here)
    ready = {n.key for n in nodes if n.key in given and missing.isdisjoint(n.sources)}
    later = {n.stage.function: n for n in nodes if n.key in given - ready}
    counts = Counter(node.stage.function for node in nodes)
    chosen = sorted(later, key=lambda function: -counts[function])
    return [later[function] for function in chosen[: max(0, workers - len(ready))]]


def _runs_here(executor: Executor | None, nodes: Sequence[Node], durations: Durations) -> bool:
    """Whether starting workers would take longer than the work."""
    if executor is None or not nodes:
        return True
    if not isinstance(executor, LocalExecutor):
        return False
    seconds, unknown = durations.estimate(nodes)
    return (
        not unknown
        and seconds < (SMALL_FOR_COPIES if fork_is_safe() else SMALL)
        and (executor.time_limit is None or can_interrupt())
        and all(may_run_here(node.identity.code) for node in nodes)
    )
