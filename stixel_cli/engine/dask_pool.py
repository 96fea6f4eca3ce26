"""Workers of Dask: of a scheduler that runs somewhere, or of a cluster of its own on this machine.

What travels is small: a task goes out as names and keys, an outcome comes back. Results go through
the cache, which all workers must share.
"""

import logging
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from types import ModuleType
from typing import Any

from stixel_cli.engine.dask_cluster import Cluster
from stixel_cli.engine.errors import ExecutorError
from stixel_cli.engine.parameters import DaskExecutor

PATIENCE = 20.0
"""Seconds to wait for a scheduler to answer."""

COUNT_INTERVAL = 2.0
"""Seconds between two looks at how many workers there are."""

LONG_PATIENCE = 600.0
"""Seconds to wait for a scheduler's first worker, or for another when all are gone."""


UNREACHABLE = (OSError, ValueError, RuntimeError, TypeError)
"""What a client raises for a scheduler that does not answer, or an address that is none."""


class DaskPool:
    """Tasks by a client of a scheduler; the loop sees futures of the standard library."""

    all_die_together = False
    kills = True

    def __init__(
        self, client: Any, cluster: Cluster | None, workers: int, restore: Callable[[], None]
    ):
        from distributed.scheduler import KilledWorker

        with suppress(AttributeError):
            # Dask's client gathers messages for 10 ms, which is longer than an empty node takes.
            client.scheduler_comm.interval = 0.001
        self._client = client
        self._cluster = cluster
        self._executor = client.get_executor(pure=False)
        self._workers = workers
        self._restore = restore
        self._counted = 0.0
        self._threads = 0
        self._alone_since: float | None = None
        self._told = False
        self._death = KilledWorker

    @property
    def limit(self) -> int:
        """One task more than there are workers, and than were asked for.

        Workers come and go; and a cluster that grows with its work must see some.
        """
        self._count()
        return max(self._workers, self._threads) + 1

    def tend(self, note: Callable[[str], None]) -> None:
        """Say that there are no workers, if so for some seconds. They may come: of a queue, or by a
        cluster that grows with its work.

        Raises:
            ExecutorError: none came for long.
        """
        self._count()
        if self._threads or self._cluster is not None:
            self._alone_since, self._told = None, False
            return
        now = time.monotonic()
        if self._alone_since is None:
            self._alone_since = now
        elif now - self._alone_since > LONG_PATIENCE:
            raise ExecutorError(
                f"no worker at the Dask scheduler {self._address} for {LONG_PATIENCE / 60:.0f} min"
            )
        elif now - self._alone_since > COUNT_INTERVAL and not self._told:
            note(f"waiting for workers at {self._address}, {LONG_PATIENCE / 60:.0f} min at most")
            self._told = True

    def _count(self) -> None:
        if self._cluster is None and time.monotonic() - self._counted > COUNT_INTERVAL:
            with suppress(Exception):
                # Where it cannot be told, the tasks in flight fail by themselves.
                self._threads = sum(self._client.nthreads().values())
            self._counted = time.monotonic()

    @property
    def _address(self) -> str:
        return self._client.scheduler.address

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
            self._cluster.close()
        self._restore()

    def _lost(self) -> ExecutorError:
        return ExecutorError(
            f"the Dask scheduler at {self._address} was lost; what was computed is kept"
        )


def make_dask_pool(executor: DaskExecutor) -> DaskPool:
    """A pool at the executor's address, or of a new cluster of processes on this machine.

    Raises:
        ExecutorError: in one line, if Dask is not installed or no scheduler answers.
    """
    # It imports Dask while this process does.
    cluster = Cluster(executor.workers) if executor.address is None else None
    try:
        distributed = _distributed()
        restore = _hush()
        try:
            address = executor.address if cluster is None else cluster.address()
            client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        except UNREACHABLE as error:
            restore()
            raise _no_scheduler(executor, error) from error
    except BaseException:
        # Ctrl-C among them, which does not wait for workers that are being started.
        if cluster is not None:
            cluster.close()
        raise
    return DaskPool(client, cluster, executor.workers, restore)


def probe_scheduler(executor: DaskExecutor) -> None:
    """See whether Dask is installed and, at an address, that a scheduler answers.

    Raises:
        ExecutorError: in one line, if not.
    """
    distributed = _distributed()
    if executor.address is None:
        return
    restore = _hush()
    try:
        distributed.Client(executor.address, timeout=PATIENCE, set_as_default=False).close()
    except UNREACHABLE as error:
        raise _no_scheduler(executor, error) from error
    finally:
        restore()


def _distributed() -> ModuleType:
    try:
        import distributed
    except ImportError as error:
        raise ExecutorError("executor=dask needs Dask: pip install 'stixel[dask]'") from error
    return distributed


def _hush() -> Callable[[], None]:
    """Silence Dask, which would tell of lost workers; the function that lets it speak again."""
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    return lambda: logger.setLevel(level)


def _no_scheduler(executor: DaskExecutor, error: Exception) -> ExecutorError:
    where = "on this machine" if executor.address is None else f"at {executor.address}"
    reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
    return ExecutorError(f"executor.address: no Dask scheduler {where} ({reason})")
