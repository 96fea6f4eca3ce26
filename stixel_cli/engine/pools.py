"""Pools of workers: processes of loky, threads, or this thread. `dask_pool` has the one of Dask."""

import os
import signal
import threading
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol

from stixel_cli.engine.cache_folder import inside
from stixel_cli.engine.limits import ENVIRONMENT

ORPHAN_INTERVAL = 0.5
"""Seconds between two checks of a worker that its parent is alive."""
FEEDER = "QueueFeederThread"
"""Name of the thread by which loky sends tasks to its processes."""
FEEDER_TIME = 1.0
"""Maximum wait for such threads, in seconds: one may hang in a pipe that no process reads."""


class Pool(Protocol):
    """Workers for the scheduler. The defaults are those of workers in this process.

    Attributes:
        limit: maximum number of submitted tasks: one more than run, so that no worker waits.
        all_die_together: whether all running tasks fail if one worker crashes.
        kills: whether tasks run in processes of their own, which a time limit may end.
    """

    limit = 1
    all_die_together = False
    kills = False

    @abstractmethod
    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` in a worker."""

    def died(self, error: BaseException | None) -> bool:
        """Whether the error of a future means that its worker crashed."""
        return False

    def renew(self) -> None:
        """Replace crashed workers, if the pool does not do so by itself."""

    def tend(self, note: Callable[[str], None]) -> None:
        """Report by `note` that the tasks wait for workers. Called while tasks run.

        ExecutorError if no worker came for too long.
        """

    def close(self) -> None:
        """End the workers, also those that still run a task."""


class ProcessPool(Pool):
    """Processes of loky, started with the first task. If one crashes, all running tasks fail.

    With `may_fork` they are copies of this process, if a copy is safe: that is ready at once, while
    a new process imports Python, NumPy and the engine first.
    """

    all_die_together = True
    kills = True

    def __init__(self, workers: int, may_fork: bool = False):
        self.limit = workers + 1
        self._workers = workers
        self._may_fork = may_fork
        self._executor = None

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` in a process."""
        if self._executor is None:
            self._executor = self._start()
        try:
            with without_interrupts():
                return self._executor.submit(function, *arguments)
        except BrokenExecutor as error:
            # A worker crashed just now: this task fails with the running ones.
            future: Future = Future()
            future.set_exception(error)
            return future

    def _start(self) -> Any:
        from multiprocessing import get_context, resource_tracker

        from loky import ProcessPoolExecutor

        options = {"initializer": _prepare_worker, "initargs": (os.getpid(),), "env": ENVIRONMENT}
        if self._may_fork and fork_is_safe():
            return ProcessPoolExecutor(self._workers, context=get_context("fork"), **options)
        from loky.backend import resource_tracker as loky_tracker

        # Starting these unblocks Ctrl-C, so start them before it is blocked in `submit`.
        resource_tracker.ensure_running()
        loky_tracker.ensure_running()
        return ProcessPoolExecutor(self._workers, **options)

    def died(self, error: BaseException | None) -> bool:
        """Whether a process crashed."""
        return isinstance(error, BrokenExecutor)

    def renew(self) -> None:
        """End the remaining processes; the next task starts new ones."""
        self.close()

    def close(self) -> None:
        """Kill the processes."""
        if self._executor is not None:
            self._executor.shutdown(wait=True, kill_workers=True)
            self._executor = None
            # loky does not join its feeder thread. If this process ends while that thread deletes a
            # semaphore, Python's tracker of resources reports a leak.
            deadline = time.monotonic() + FEEDER_TIME
            for thread in threading.enumerate():
                if thread.name == FEEDER:
                    thread.join(max(deadline - time.monotonic(), 0.0))


class ThreadPool(Pool):
    """Daemon threads of this process: unlike the standard library's, they do not delay its end."""

    def __init__(self, workers: int):
        self.limit = workers + 1
        self._tasks: SimpleQueue[tuple[Future, Callable[..., Any], tuple] | None] = SimpleQueue()
        self._threads = [threading.Thread(target=self._work, daemon=True) for _ in range(workers)]
        for thread in self._threads:
            thread.start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` in a thread."""
        future: Future = Future()
        self._tasks.put((future, function, arguments))
        return future

    def close(self) -> None:
        """End idle threads. After an interrupt, threads that still run a task are left."""
        for _ in self._threads:
            self._tasks.put(None)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            future, function, arguments = task
            if future.set_running_or_notify_cancel():
                settle(future, function, arguments)


class SerialPool(Pool):
    """This thread: `submit` returns when the task is done."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` now."""
        future: Future = Future()
        settle(future, function, arguments)
        return future


def fork_is_safe() -> bool:
    """Whether this process has one thread and was started with `ENVIRONMENT`, as by `stixel`.

    In a copy of a process with several threads, the locks of the others stay locked for ever.
    """
    threads = inside(Path("/proc/self/task"))  # Empty if this is not Linux.
    return len(threads) == 1 and all(os.environ.get(name) == n for name, n in ENVIRONMENT.items())


def settle(future: Future, function: Callable[..., Any], arguments: tuple) -> None:
    """Give the future the result of a call, or its error."""
    try:
        future.set_result(function(*arguments))
    except Exception as error:
        future.set_exception(error)


def error_of(future: Future) -> BaseException | None:
    """The exception of a finished future, or None."""
    return CancelledError() if future.cancelled() else future.exception()


@contextmanager
def deferred_interrupts() -> Iterator[Callable[[], None]]:
    """Defer Ctrl-C, and SIGTERM if handled as Ctrl-C, until the yielded function is called.

    That function raises KeyboardInterrupt. Raised inside `wait`, it would leave the lock of a
    future acquired, and the thread that manages the workers would wait for that lock forever.

    Nothing changes outside the main thread, nor for a signal with another handler than Python's
    `default_int_handler`.
    """
    pending: list[int] = []

    def check() -> None:
        if pending:
            raise KeyboardInterrupt

    here = threading.current_thread() is threading.main_thread()
    ours = [
        number
        for number in (signal.SIGINT, signal.SIGTERM)
        if here and signal.getsignal(number) is signal.default_int_handler
    ]
    for number in ours:
        signal.signal(number, lambda number, _: pending.append(number))
    try:
        yield check
    finally:
        for number in ours:
            signal.signal(number, signal.default_int_handler)
    # A signal may have arrived after the last call.
    check()


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Block Ctrl-C inside the `with` block.

    Ctrl-C reaches the whole process group. A process that is started in the block inherits the
    blocked signal, so that it does not end with a traceback before its initialiser runs.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _prepare_worker(parent: int) -> None:
    # Ctrl-C reaches the whole process group. Only the parent handles it, and ends the workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A copy of the parent has its handler.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    from loky import process_executor

    # loky replaces a worker that grows by 300 MB, as large libraries and compiled kernels make it.
    # Before it measures first, it searches all objects for garbage, 0.1 s.
    process_executor._get_memory_usage = lambda pid, force_gc=False: 0


def _end_with(parent: int) -> None:
    """End this worker if its parent was killed; otherwise it would wait for work forever."""
    while os.getppid() == parent:
        time.sleep(ORPHAN_INTERVAL)
    os._exit(1)
