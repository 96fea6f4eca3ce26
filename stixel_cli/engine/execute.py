"""Compute what is missing, on any pool of workers."""

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from stixel_cli.engine.bytecode import check_bytecode
from stixel_cli.engine.durations import Durations
from stixel_cli.engine.graph import Graph, Node
from stixel_cli.engine.leases import Lease
from stixel_cli.engine.loaded_code import may_run_here
from stixel_cli.engine.loop import Run
from stixel_cli.engine.one_thread import one_thread
from stixel_cli.engine.parameters import Executor, LocalExecutor
from stixel_cli.engine.plan import plan
from stixel_cli.engine.pools import ExecutorName, SerialPool, executor_of, make_pool
from stixel_cli.engine.probe import check_writable
from stixel_cli.engine.progress import Progress, Silent
from stixel_cli.engine.records import Execution
from stixel_cli.engine.sources import keep_sources
from stixel_cli.engine.store import Store
from stixel_cli.engine.time_limit import can_interrupt

SMALL = 1.5
"""Work below this, in seconds, is done in this process: starting workers would take as long."""


def execute(
    graph: Graph,
    targets: Sequence[str],
    store: Store,
    workers: int = 2,
    executor: Executor | ExecutorName = "local",
    progress: Progress | None = None,
    keep_going: bool = False,
) -> Execution:
    """Compute what the `targets` (stage names or node ids) need and `store` does not hold yet.

    Afterwards every target can be loaded from the store, and the store's limit is kept. The
    results do not depend on the executor; `workers` belongs to one that is given by its name.
    Where there is little to do, "local" starts no processes.

    With `keep_going` a node that fails fails alone: what depends on it is skipped, the rest goes
    on, and the failures are in the execution that is returned.

    Raises:
        StageFailure: a stage raised, took longer than it may, or killed its worker twice. What was
            running is finished and kept, the rest is not begun. Not with `keep_going`.
        CacheError: the store cannot be read or written.
        CodeChanged: a stage was edited after the graph had been built.
        ExecutorError: the workers cannot be had, or were lost for good; or a library keeps more
            than one thread.
        KeyError: no such target.
        ValueError: no such executor, or fewer than one worker.
    """
    chosen = executor_of(executor, workers)
    progress = Silent() if progress is None else progress
    durations = Durations(store.folder)
    lease = Lease(store.folder)
    try:
        lease.take(sorted(graph.ancestors(graph.expand(targets))))
        planned = plan(graph, targets, store)
        nodes = [graph.nodes[key] for key in planned.missing]
        check_writable(len(nodes), store)
        keep_sources(store.folder, {node.stage.name: node.identity.code for node in nodes}.values())
        check_bytecode(_modules(nodes))
        here = not nodes or _runs_here(chosen, nodes, durations)
        pool = SerialPool() if here else make_pool(chosen)
        progress.expect(durations.by_stage(nodes), 1 if here else chosen.workers)
        time_limit = getattr(chosen, "time_limit", None)
        run = Run(planned, store, pool, progress, time_limit, keep_going, lease)
        try:
            # For the whole run where it is in this process: by the thread that calls, which may
            # have limits of its own.
            with nullcontext() if pool.kills or not nodes else one_thread():
                run.all()
        finally:
            # By now nothing runs, or what does is not wanted any more.
            pool.close()
            progress.close()
            durations.learn(graph, run.seconds)
        run.keep_limit()
    finally:
        lease.end()
    return Execution(graph, run.records(), run.failures)


def _modules(nodes: Sequence[Node]) -> dict[str, Path]:
    """The modules of the nodes' code: name to file."""
    codes = {id(node.identity.code): node.identity.code for node in nodes}.values()
    return {name: path for code in codes for name, (path, _) in code.files.items()}


def _runs_here(executor: Executor | None, nodes: Sequence[Node], durations: Durations) -> bool:
    """Whether starting workers would take longer than the work."""
    if executor is None:
        return True
    if not isinstance(executor, LocalExecutor):
        return False
    estimate = durations.estimate(nodes)
    return (
        estimate is not None
        and estimate < SMALL
        and (executor.time_limit is None or can_interrupt())
        and all(may_run_here(node.identity.code) for node in nodes)
    )
