"""Workers of Dask: those of a running scheduler, or of a cluster that `dask_cluster` starts.

Nodes and outcomes contain names, settings and keys, but no arrays. Results are exchanged through
the store, which all workers must share.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future, InvalidStateError
from contextlib import ExitStack, contextmanager, suppress
from types import ModuleType
from typing import TYPE_CHECKING, Any

from stixel_cli.engine.dask_cluster import Cluster
from stixel_cli.engine.errors import ExecutorError
from stixel_cli.engine.parameters import PROGRAM, DaskExecutor
from stixel_cli.engine.pools import Pool

if TYPE_CHECKING:
    from distributed import Client

PATIENCE = 20.0
"""Seconds to wait for a scheduler to answer."""

COUNT_INTERVAL = 2.0
"""Seconds between two counts of the workers."""

LONG_PATIENCE = 600.0
"""Seconds to wait for a worker if a scheduler has none."""

RESULT_PATIENCE = 60.0
"""Seconds to wait for the outcome of a finished task. It is small."""

UNREACHABLE = (OSError, ValueError, RuntimeError, TypeError)
"""Errors of a client if the scheduler does not answer or the address is not valid."""


class DaskPool(Pool):
    """Submits tasks to a Dask scheduler, as futures of the standard library."""

    kills = True

    def __init__(self, executor: DaskExecutor):
        """Connect to the executor's address, or start a cluster on this machine.

        Raises:
            ExecutorError: Dask is not installed, or no scheduler answers; one line.
        """
        self._workers = executor.workers
        self._cluster: Cluster | None = None
        self._counted = 0.0
        self._threads = 0
        self._waiting_since: float | None = None
        self._noted = False
        # What fails, also Ctrl-C, does not wait until the workers have started.
        with ExitStack() as opened:
            opened.enter_context(_silence())
            if executor.address is None:
                # The cluster imports Dask at the same time as this process.
                self._cluster = Cluster(executor.workers)
                opened.callback(self._cluster.close)
            self._client = opened.enter_context(_client(executor, self._cluster))
            self._opened = opened.pop_all()
        self._address = self._client.scheduler.address
        with suppress(AttributeError):
            # Dask's client collects messages for 10 ms, longer than an empty node takes.
            self._client.scheduler_comm.interval = 0.001

    @property
    def limit(self) -> int:
        """One more than the number of workers, or than the configured number.

        The number of workers may change; an adaptive cluster starts workers for waiting tasks.
        """
        self._count()
        return max(self._workers, self._threads) + 1

    def tend(self, note: Callable[[str], None]) -> None:
        """Report that there are no workers. A queue or an adaptive cluster may still start some.

        Raises:
            ExecutorError: no worker came for `LONG_PATIENCE`.
        """
        self._count()
        if self._threads or self._cluster is not None:
            self._waiting_since, self._noted = None, False
            return
        now = time.monotonic()
        if self._waiting_since is None:
            self._waiting_since = now
        elif now - self._waiting_since > LONG_PATIENCE:
            raise ExecutorError(
                f"no worker at the Dask scheduler {self._address} for {LONG_PATIENCE / 60:.0f} min"
            )
        elif now - self._waiting_since > COUNT_INTERVAL and not self._noted:
            note(f"waiting for workers at {self._address}, {LONG_PATIENCE / 60:.0f} min at most")
            self._noted = True

    def _count(self) -> None:
        if self._cluster is None and time.monotonic() - self._counted > COUNT_INTERVAL:
            with suppress(Exception):
                # If the scheduler is lost, the running tasks fail.
                self._threads = sum(self._client.nthreads().values())
            self._counted = time.monotonic()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` in a worker.

        Raises:
            ExecutorError: the scheduler is lost.
        """
        if self._client.status != "running":
            raise self._lost()
        future: Future = Future()
        try:
            self._start(future, function, arguments)
        except Exception as error:
            raise self._lost() from error
        return future

    def _start(self, future: Future, function: Callable[..., Any], arguments: tuple) -> None:
        """Submit a task to Dask. When it is finished, its outcome becomes that of `future`.

        Dask's own executor is not used: its futures may stay open forever if a worker is killed
        just after it has finished a task.
        """
        task = self._client.submit(function, *arguments, pure=False)

        def cancel(future: Future) -> None:
            if future.cancelled():
                future.set_running_or_notify_cancel()
                task.cancel()

        async def settle() -> None:
            gathering = self._client.gather(task, asynchronous=True)
            try:
                outcome = await asyncio.wait_for(gathering, RESULT_PATIENCE)
            except TimeoutError:
                # The outcome is lost. The task finds its result in the store.
                self._start(future, function, arguments)
            except (Exception, CancelledError, asyncio.CancelledError) as error:
                # Dask cancels a task whose scheduler is lost, by errors of several names.
                lost = "CancelledError" in type(error).__name__
                with suppress(InvalidStateError):
                    future.set_exception(self._lost() if lost else error)
            else:
                with suppress(InvalidStateError):
                    future.set_result(outcome)

        future.add_done_callback(cancel)
        task.add_done_callback(lambda _: self._client.loop.add_callback(settle))

    def died(self, error: BaseException | None) -> bool:
        """Whether the worker crashed."""
        return isinstance(error, _distributed().scheduler.KilledWorker)

    def close(self) -> None:
        """Disconnect from the scheduler, and end a cluster on this machine."""
        self._opened.close()

    def _lost(self) -> ExecutorError:
        return ExecutorError(
            f"the Dask scheduler at {self._address} was lost; computed results are kept"
        )


def probe_scheduler(executor: DaskExecutor) -> None:
    """Check that Dask is installed and, with an address, that a scheduler answers.

    Raises:
        ExecutorError: one of these fails; one line.
    """
    _distributed()
    if executor.address is not None:
        with _silence(), _client(executor, None):
            pass


@contextmanager
def _client(executor: DaskExecutor, cluster: Cluster | None) -> Iterator["Client"]:
    """A client of the cluster, or of the scheduler at the executor's address."""
    distributed = _distributed()
    try:
        address = executor.address if cluster is None else cluster.address()
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except UNREACHABLE as error:
        where = "on this machine" if executor.address is None else f"at {executor.address}"
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        text = f"executor.address: no Dask scheduler {where} ({reason})"
        raise ExecutorError(text) from error
    try:
        yield client
    finally:
        with suppress(Exception):
            client.close(timeout=1.0)


def _distributed() -> ModuleType:
    try:
        import distributed
    except ImportError as error:
        raise ExecutorError(
            f"executor=dask requires Dask: pip install '{PROGRAM}[dask]'"
        ) from error
    return distributed


@contextmanager
def _silence() -> Iterator[None]:
    """Silence the logger of Dask inside the `with` block."""
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
