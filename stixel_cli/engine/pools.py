"""Where tasks run: in loky's processes, in threads, or right here. One loop drives them all.

A pool has `limit` (how many tasks to hand it at a time: one more than it runs, so that no worker
waits for the next), `submit(function, *arguments)` that gives a `concurrent.futures.Future`,
`died(error)` that tells whether a future's error is the death of its worker, `all_die_together`,
`kills` (whether a task may end the process that it runs in), `renew()` after workers died,
`tend(note)` now and then while tasks are in flight, and `close()`. Dask's is in a module of its
own.
"""

import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Thread
from typing import Any, Literal, Protocol

from stixel_cli.engine.one_thread import ENVIRONMENT
from stixel_cli.engine.parameters import DaskExecutor, Executor, LocalExecutor, ThreadsExecutor

ExecutorName = Literal["local", "threads", "dask", "serial"]
ORPHAN_INTERVAL = 0.5
"""Seconds between two looks of a worker at whether its parent lives."""

NAMES = ("local", "threads", "dask", "serial")


class Pool(Protocol):
    """What the loop of `execute` needs."""

    all_die_together: bool
    kills: bool

    @property
    def limit(self) -> int:
        """How many tasks to hand it at a time."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Have a worker run `function`."""

    def died(self, error: BaseException | None) -> bool:
        """Whether a future ended with `error` because its worker died."""

    def renew(self) -> None:
        """Workers died: see that there are others."""

    def tend(self, note: Callable[[str], None]) -> None:
        """Say by `note` what keeps the workers from work.

        Raises:
            ExecutorError: there are none, and none will come.
        """

    def close(self) -> None:
        """End the workers, with what they still run."""


class ProcessPool:
    """Processes of loky, started with the first task. When one dies, all tasks in flight fail."""

    all_die_together = True
    kills = True

    def __init__(self, workers: int):
        self.limit = workers + 1
        self._workers = workers
        self._executor = None

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` in a process."""
        if self._executor is None:
            from multiprocessing import resource_tracker

            from joblib.externals.loky import ProcessPoolExecutor
            from joblib.externals.loky.backend import resource_tracker as loky_tracker

            # Starting these lets Ctrl-C through again, which is to be held back, see below.
            resource_tracker.ensure_running()
            loky_tracker.ensure_running()
            self._executor = ProcessPoolExecutor(
                self._workers,
                initializer=_prepare_worker,
                initargs=(os.getpid(),),
                env=ENVIRONMENT,
            )
        try:
            with _without_interrupts():
                return self._executor.submit(function, *arguments)
        except BrokenExecutor as error:
            # A worker died just now. This task is as suspect as those in flight, no more.
            future: Future = Future()
            future.set_exception(error)
            return future

    def died(self, error: BaseException | None) -> bool:
        """Whether a process died."""
        return isinstance(error, BrokenExecutor)

    def renew(self) -> None:
        """Leave what remains of the processes; the next task starts new ones."""
        self.close()

    def tend(self, note: Callable[[str], None]) -> None:
        """They come with the first task."""

    def close(self) -> None:
        """Kill the processes."""
        if self._executor is not None:
            self._executor.shutdown(wait=True, kill_workers=True)
            self._executor = None


class _InThisProcess:
    """What is so of every pool without processes of its own."""

    all_die_together = False
    kills = False

    def died(self, error: BaseException | None) -> bool:
        """It would be this process."""
        return False

    def renew(self) -> None:
        """There is nothing to renew."""

    def tend(self, note: Callable[[str], None]) -> None:
        """Its workers are always there."""


class ThreadPool(_InThisProcess):
    """Threads of this process. They do not hold up its end, as the standard library's would."""

    def __init__(self, workers: int):
        self.limit = workers + 1
        self._tasks: SimpleQueue[tuple[Future, Callable[..., Any], tuple] | None] = SimpleQueue()
        self._threads = [Thread(target=self._work, daemon=True) for _ in range(workers)]
        for thread in self._threads:
            thread.start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` in a thread."""
        future: Future = Future()
        self._tasks.put((future, function, arguments))
        return future

    def close(self) -> None:
        """Send the threads home. Those that still run something, after an interrupt, are left."""
        for _ in self._threads:
            self._tasks.put(None)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            future, function, arguments = task
            if future.set_running_or_notify_cancel():
                _settle(future, function, arguments)


class SerialPool(_InThisProcess):
    """This thread: each task is done when `submit` comes back."""

    limit = 1

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` now."""
        future: Future = Future()
        _settle(future, function, arguments)
        return future

    def close(self) -> None:
        """There is nothing to close."""


def executor_of(executor: Executor | ExecutorName, workers: int) -> Executor | None:
    """The executor of a name with `workers` and no time limit, or itself; None for "serial".

    Raises:
        ValueError: in one line, if there is no such executor or there are no workers.
    """
    if not isinstance(executor, str):
        return executor
    if executor not in NAMES:
        raise ValueError(f"executor: there is no {executor!r}, only {', '.join(NAMES)}")
    if workers < 1:
        raise ValueError(f"workers: {workers} is too few, at least 1")
    if executor == "local":
        return LocalExecutor("local", workers, None)
    if executor == "threads":
        return ThreadsExecutor("threads", workers)
    return DaskExecutor("dask", workers, None, None) if executor == "dask" else None


def make_pool(executor: Executor) -> Pool:
    """The pool of an executor.

    Raises:
        ExecutorError: in one line, if its workers cannot be had.
    """
    if isinstance(executor, LocalExecutor):
        return ProcessPool(executor.workers)
    if isinstance(executor, ThreadsExecutor):
        return ThreadPool(executor.workers)
    from stixel_cli.engine.dask_pool import make_dask_pool

    return make_dask_pool(executor)


def _settle(future: Future, function: Callable[..., Any], arguments: tuple) -> None:
    try:
        future.set_result(function(*arguments))
    except Exception as error:
        future.set_exception(error)


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Hold Ctrl-C back until afterwards.

    It reaches the whole group of processes. One that is started within holds it back for good, and
    so does not die of it with a traceback while it still imports what would have it ignored.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _prepare_worker(parent: int) -> None:
    # Ctrl-C reaches the whole group of processes; the parent alone answers it, and kills these.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with, args=(parent,), daemon=True).start()
    from joblib.externals.loky import process_executor

    # With psutil installed, loky replaces a worker that has grown by 300 MB, taking it for a leak.
    # Loading Open3D and compiled kernels grows it by as much.
    process_executor._MAX_MEMORY_LEAK_SIZE = float("inf")


def _end_with(parent: int) -> None:
    """End this worker when its parent was killed, which loky's would outlive, waiting for work."""
    while os.getppid() == parent:
        time.sleep(ORPHAN_INTERVAL)
    os._exit(1)
