"""Workers of Dask: of a scheduler that runs somewhere, or of a cluster of its own on this machine.

What travels is small: a task goes out as names and keys, an outcome comes back. Results go through
the cache, which all workers must share.
"""

import logging
import os
import signal
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from multiprocessing import resource_tracker
from threading import Event, Thread
from typing import Any

from stixel_cli.engine.errors import ExecutorError
from stixel_cli.engine.one_thread import ENVIRONMENT
from stixel_cli.engine.parameters import DaskExecutor

PATIENCE = 20.0
"""Seconds to wait for a scheduler to answer."""

COUNT_INTERVAL = 2.0
"""Seconds between two looks at how many workers there are."""


class DaskPool:
    """Tasks by a client of a scheduler; the loop sees futures of the standard library."""

    all_die_together = False
    kills = True

    def __init__(self, client: Any, cluster: Any, workers: int, restore: Callable[[], None]):
        from distributed.scheduler import KilledWorker

        self._client = client
        self._cluster = cluster
        self._executor = client.get_executor(pure=False)
        self._workers = workers
        self._restore = restore
        self._counted = 0.0
        self._threads = 0
        self._death = KilledWorker

    @property
    def limit(self) -> int:
        """One task more than there are workers, and than were asked for.

        Workers come and go; and a cluster that grows with its work must see some.
        """
        if self._cluster is None and time.monotonic() - self._counted > COUNT_INTERVAL:
            with suppress(Exception):
                # Where it cannot be told, the tasks in flight fail by themselves.
                self._threads = sum(self._client.nthreads().values())
            self._counted = time.monotonic()
        return max(self._workers, self._threads) + 1

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` at a worker.

        Raises:
            ExecutorError: the scheduler is lost.
        """
        if self._client.status != "running":
            raise self._lost()
        try:
            return self._executor.submit(function, *arguments)
        except Exception as error:
            raise self._lost() from error

    def died(self, error: BaseException | None) -> bool:
        """Whether the worker died; a future that someone cancelled tells of a lost scheduler.

        Raises:
            ExecutorError: it is lost.
        """
        if isinstance(error, CancelledError) or "CancelledError" in type(error).__name__:
            raise self._lost()
        return isinstance(error, self._death)

    def renew(self) -> None:
        """Workers are the cluster's to replace."""

    def close(self) -> None:
        """Leave the scheduler; a cluster of its own is ended."""
        with suppress(Exception):
            self._executor.shutdown(wait=False)
        with suppress(Exception):
            self._client.close(timeout=1.0)
        if self._cluster is not None:
            _end(self._cluster)
        self._restore()

    def _lost(self) -> ExecutorError:
        return ExecutorError(
            f"the Dask scheduler at {self._client.scheduler.address} was lost; what was computed "
            "is kept"
        )


def make_dask_pool(executor: DaskExecutor) -> DaskPool:
    """A pool at the executor's address, or of a new cluster of processes on this machine.

    Raises:
        ExecutorError: in one line, if Dask is not installed or no scheduler answers.
    """
    try:
        import distributed
    except ImportError as error:
        raise ExecutorError("executor=dask needs Dask: pip install 'stixel[dask]'") from error
    cluster = None
    # What it has to say of lost workers, the engine says in its own words.
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        if executor.address is None:
            cluster = _start_cluster(executor.workers)
        address = cluster if cluster is not None else executor.address
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, RuntimeError, TypeError) as error:
        if cluster is not None:
            _end(cluster)
        logger.setLevel(level)
        where = "on this machine" if executor.address is None else f"at {executor.address}"
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise ExecutorError(f"executor.address: no Dask scheduler {where} ({reason})") from error
    return DaskPool(client, cluster, executor.workers, lambda: logger.setLevel(level))


def _start_cluster(workers: int) -> Any:
    """A cluster of processes that Ctrl-C does not reach: the parent alone answers it."""
    import distributed

    made: list[Any] = []
    abandoned = Event()

    def start() -> None:
        # What is started here, now or when a worker is replaced, inherits the blocked signal. The
        # tracker that comes with the first process would unblock it.
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                memory_limit=0,
                scheduler_kwargs={"allowed_failures": 0},
                env=ENVIRONMENT,
                silence_logs=logging.CRITICAL,
            )
        except Exception as error:
            made.append(error)
            return
        if abandoned.is_set():
            _end(cluster)
        made.append(cluster)

    thread = Thread(target=start, daemon=True, name="stixel-dask")
    thread.start()
    try:
        while thread.is_alive():
            thread.join(0.1)
    except BaseException:
        # Ctrl-C does not wait for workers that are being started.
        abandoned.set()
        raise
    if isinstance(made[0], Exception):
        raise RuntimeError(str(made[0])) from made[0]
    return made[0]


def _end(cluster: Any) -> None:
    """End a cluster at once: what its workers run is not wanted any more."""
    for worker in list(cluster.workers.values()):
        pid = getattr(getattr(worker, "process", None), "pid", None)
        with suppress(OSError, TypeError):
            os.kill(pid, signal.SIGKILL)
    with suppress(Exception):
        cluster.close(timeout=2.0)
