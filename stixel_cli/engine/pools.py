"""Where tasks run: in loky's processes, in threads, or right here. One loop drives them all.

A pool has `limit` (how many tasks to hand it at a time: one more than it runs, so that no worker
waits for the next), `submit(function, *arguments)` that gives a `concurrent.futures.Future`,
`renew()` after its workers died, and `close()`.
"""

import signal
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from threading import Thread
from typing import Any, Literal

from stixel_cli.engine.one_thread import ENVIRONMENT

ExecutorName = Literal["local", "threads", "serial"]


class ProcessPool:
    """Processes of loky, started with the first task."""

    def __init__(self, workers: int):
        self.limit = workers + 1
        self._workers = workers
        self._executor = None

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` in a process; a BrokenExecutor error tells that the process died."""
        if self._executor is None:
            from joblib.externals.loky import ProcessPoolExecutor

            self._executor = ProcessPoolExecutor(
                self._workers, initializer=_prepare_worker, env=ENVIRONMENT
            )
        return self._executor.submit(function, *arguments)

    def renew(self) -> None:
        """Leave what remains of the processes; the next task starts new ones."""
        self.close()

    def close(self) -> None:
        """Kill the processes."""
        if self._executor is not None:
            self._executor.shutdown(wait=True, kill_workers=True)
            self._executor = None


class ThreadPool:
    """Threads of this process. They do not hold up its end, as the standard library's would."""

    def __init__(self, workers: int):
        self.limit = workers + 1
        self._tasks: SimpleQueue = SimpleQueue()
        self._threads = [Thread(target=self._work, daemon=True) for _ in range(workers)]
        for thread in self._threads:
            thread.start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` in a thread."""
        future: Future = Future()
        self._tasks.put((future, function, arguments))
        return future

    def renew(self) -> None:
        """Threads do not die."""

    def close(self) -> None:
        """Send the threads home. Those that still run something, after an interrupt, are left."""
        for _ in self._threads:
            self._tasks.put(None)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            future, function, arguments = task
            if future.set_running_or_notify_cancel():
                _settle(future, function, arguments)


class SerialPool:
    """This thread: each task is done when `submit` comes back."""

    limit = 1

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Run `function` now."""
        future: Future = Future()
        _settle(future, function, arguments)
        return future

    def renew(self) -> None:
        """There is nothing to renew."""

    def close(self) -> None:
        """There is nothing to close."""


Pool = ProcessPool | ThreadPool | SerialPool


POOLS = {
    "local": ProcessPool,
    "threads": ThreadPool,
    "serial": lambda workers: SerialPool(),
}


def check_pool(executor: str, workers: int) -> None:
    """Raise ValueError, in one line, if there is no such pool."""
    if executor not in POOLS:
        raise ValueError(f"executor: there is no {executor!r}, only {', '.join(POOLS)}")
    if workers < 1:
        raise ValueError(f"workers: {workers} is too few, at least 1")


def make_pool(executor: ExecutorName, workers: int) -> Pool:
    """The pool of a name, see `check_pool`."""
    return POOLS[executor](workers)


def _settle(future: Future, function: Callable[..., Any], arguments: tuple) -> None:
    try:
        future.set_result(function(*arguments))
    except Exception as error:
        future.set_exception(error)


def _prepare_worker() -> None:
    # Ctrl-C reaches the whole group of processes; the parent alone answers it, and kills these.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    from joblib.externals.loky import process_executor

    # With psutil installed, loky replaces a worker that has grown by 300 MB, taking it for a leak.
    # Loading Open3D and compiled kernels grows it by as much.
    process_executor._MAX_MEMORY_LEAK_SIZE = float("inf")
