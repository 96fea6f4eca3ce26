"""Workers of a running Dask scheduler.

Nodes and outcomes contain names, settings and keys, but no arrays. Results are exchanged through
the store, which all workers must share.
"""

import logging
import pickle
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import ExitStack, suppress
from types import ModuleType
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from stixel_cli.border.origins import connected, unpickled
from stixel_cli.engine.errors import ExecutorError, WorkerDied
from stixel_cli.engine.parameters import PROGRAM, DaskExecutor
from stixel_cli.engine.pools import Pool, settle
from stixel_cli.errors import located

if TYPE_CHECKING:
    from distributed import Client

PATIENCE = 20.0
"""Seconds to wait for a scheduler to answer."""

COUNT_INTERVAL = 2.0
"""Seconds between two counts of the workers."""

LONG_PATIENCE = 600.0
"""Seconds to wait for a worker if a scheduler has none."""

UNREACHABLE = (OSError, ValueError, RuntimeError, TypeError)
"""Errors of a client if the scheduler does not answer or the address is not valid."""


class DaskPool(Pool):
    """Submits tasks to a Dask scheduler, as futures of the standard library."""

    kills = True

    def __init__(self, executor: DaskExecutor):
        """Connect to the executor's address.

        ExecutorError if Dask is not installed, or no scheduler answers; one line.
        """
        self._workers = executor.workers
        self._counted = 0.0
        self._threads = 0
        self._seen = time.monotonic()
        self._noted = False
        logger = logging.getLogger("distributed")
        with ExitStack() as opened:
            opened.callback(logger.setLevel, logger.level)
            logger.setLevel(logging.CRITICAL)
            self._client = _client(executor)
            self._opened = opened.pop_all()
        self._address = self._client.scheduler.address
        self._open: dict[str, Future] = {}
        self._client.subscribe_topic(PROGRAM, self._receive)
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
        """End the futures of tasks that have no outcome, and report that there are no workers.

        A queue or an adaptive cluster may still start some. ExecutorError if no worker came for
        `LONG_PATIENCE`.
        """
        for key, future in list(self._open.items()):
            if future.cancelled():
                future.task.cancel()
            status = future.task.status
            if status == "pending" or self._open.pop(key, None) is None:
                continue
            if future.set_running_or_notify_cancel():
                # Dask cancels a task whose scheduler is lost.
                error = self._lost() if status == "cancelled" else WorkerDied("no outcome came")
                future.set_exception(future.task.exception() if status == "error" else error)
        self._count()
        if self._threads:
            self._seen, self._noted = time.monotonic(), False
        waited, most = time.monotonic() - self._seen, f"{LONG_PATIENCE / 60:.0f} min"
        if waited > LONG_PATIENCE:
            raise ExecutorError(f"no worker at the Dask scheduler {self._address} for {most}")
        if waited > COUNT_INTERVAL and not self._noted:
            note(f"waiting for workers at {self._address}, {most} at most")
            self._noted = True

    def _count(self) -> None:
        if time.monotonic() - self._counted > COUNT_INTERVAL:
            with suppress(Exception):
                # If the scheduler is lost, the running tasks fail.
                self._threads = sum(self._client.nthreads().values())
            self._counted = time.monotonic()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` in a worker.

        Dask's own executor is not used: its futures may stay open forever if a worker is killed
        just after it has finished a task. ExecutorError if the scheduler is lost.
        """
        if self._client.status != "running":
            raise self._lost()
        key = f"{PROGRAM}-{uuid4()}"
        # The outcome may come before Dask's `submit` returns.
        future = self._open[key] = Future()
        try:
            # Unlike Python's own, Dask's also encodes what is defined in a script.
            call = _distributed().protocol.pickle.dumps((function, arguments))
            future.task = self._client.submit(_run, call, key=key, pure=False)
        except Exception as error:
            del self._open[key]
            raise self._lost() from error
        return future

    def _receive(self, event: tuple[float, tuple[str, bytes]]) -> None:
        """Take the outcome of a task. Those of other programs' tasks come too."""
        key, outcome = event[1]
        future = self._open.pop(key, None)
        if future is not None and future.set_running_or_notify_cancel():
            settle(future, unpickled, (outcome,))

    def died(self, error: BaseException | None) -> bool:
        """Whether the worker crashed."""
        return isinstance(error, (WorkerDied, _distributed().scheduler.KilledWorker))

    def close(self) -> None:
        """Disconnect from the scheduler."""
        with self._opened, suppress(Exception):
            self._client.close(timeout=1.0)

    def _lost(self) -> ExecutorError:
        return ExecutorError(f"the Dask scheduler at {self._address} is gone; results are kept")


def _run(call: bytes) -> None:
    """Run a task in a worker, and send its outcome just before Dask's message that it is finished.

    To fetch the result of a task takes two more round trips. The scheduler does not decode bytes.
    """
    function, arguments = unpickled(call)
    outcome = pickle.dumps(function(*arguments))
    worker = _distributed().get_worker()
    worker.log_event(PROGRAM, (worker.get_current_task(), outcome))


def _client(executor: DaskExecutor) -> "Client":
    """A client of the scheduler at the executor's address."""
    _distributed()
    if executor.address is None:
        raise ExecutorError(
            "executor.address: is required with executor=dask, such as tcp://10.0.0.7:8786; "
            "executor=local starts processes on this machine"
        )
    try:
        return connected(executor.address, PATIENCE)
    except UNREACHABLE as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        text = f"executor.address: no Dask scheduler at {executor.address} ({reason})"
        raise ExecutorError(text) from error


def _distributed() -> ModuleType:
    required = f"executor=dask requires Dask: pip install '{PROGRAM}[dask]'"
    with located(required, ExecutorError, ImportError):
        import distributed
    return distributed
