"""Limits of a node in the process that runs it: one thread, and a maximum time.

Parallel work comes from the workers, and results do not depend on it.

A stage may hang in compiled code that holds the interpreter lock, so a Python thread cannot end it.
The watchdog of `faulthandler` ends the process and writes the traceback to a file, the *mark*. The
mark tells the parent that the node exceeded its limit, and that the worker did not crash.
"""

import faulthandler
import importlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stixel_cli.engine.errors import ExecutorError, TimeLimitExceeded, writing

_LIBRARIES = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "BLIS")}
_LIBRARIES |= {"VECLIB_MAXIMUM_THREADS": "1", "OPENCV_FOR_THREADS_NUM": "1"}

ENVIRONMENT = {**_LIBRARIES, "NUMBA_NUM_THREADS": "1"}
"""Environment of a new process. Libraries read it when they are loaded."""


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit the numerical libraries of this process to one thread, until the last caller leaves.

    A process that started with `ENVIRONMENT` needs no limit. Others do: a program that calls this
    package, or a worker that another program started. Numba is not limited: its kernels here are
    not parallel, and it rejects a change after its start. ExecutorError if a library still uses
    more threads.
    """
    controller = _limits.enter()
    try:
        # OpenMP and MKL have a limit for each thread, OpenBLAS has one for the process.
        with controller.limit(limits=1):
            _check(controller.info())
            yield
    finally:
        _limits.leave()


def _check(libraries: list[dict[str, Any]]) -> None:
    for library in libraries:
        if library["num_threads"] not in (1, None):
            raise ExecutorError(
                f"{Path(library['filepath']).name}: uses {library['num_threads']} threads, and a "
                "stage needs one: remove the limits that other threads of this process have set "
                "with threadpoolctl, or set OPENBLAS_NUM_THREADS=1 and OMP_NUM_THREADS=1 before "
                "NumPy is imported"
            )


class _Limits:
    """The limits of a process, for as long as at least one thread needs them."""

    def __init__(self):
        self.lock = threading.Lock()
        self.inside = 0
        self.controller: Any = None
        self.undo = ExitStack()

    def enter(self) -> Any:
        """Set missing limits; return the controller of the loaded libraries."""
        with self.lock:
            if "cv2" in sys.modules:
                # Another thread may be importing it: this waits for the import.
                cv2 = importlib.import_module("cv2")
                if cv2.getNumThreads() != 1:
                    self.undo.callback(cv2.setNumThreads, cv2.getNumThreads())
                    cv2.setNumThreads(1)
            if any(os.environ.get(name) != value for name, value in _LIBRARIES.items()):
                before = {name: os.environ[name] for name in _LIBRARIES if name in os.environ}
                self.undo.callback(os.environ.update, before)
                for name in _LIBRARIES.keys() - before:
                    self.undo.callback(os.environ.pop, name, None)
                os.environ.update(_LIBRARIES)
                self.controller = None
            if self.controller is None:
                # Libraries that are loaded later read the environment.
                from threadpoolctl import ThreadpoolController

                self.controller = ThreadpoolController()
            if not self.inside and any(
                library["num_threads"] != 1 for library in self.controller.info()
            ):
                limited = _in_a_thread(lambda: self.controller.limit(limits=1))
                self.undo.callback(_in_a_thread, limited.restore_original_limits)
            self.inside += 1
            return self.controller

    def leave(self) -> None:
        with self.lock:
            self.inside -= 1
            if not self.inside:
                self.undo.close()


def _in_a_thread(call: Callable[[], Any]) -> Any:
    """Run `call()` in a new thread and return its result.

    Only the first thread that sets a limit of OpenBLAS can set one, until that thread ends.
    threadpoolctl ignores other threads without an error.
    """
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(call).result()


_limits = _Limits()


@dataclass(frozen=True)
class TimeLimit:
    """Time limit of one node."""

    seconds: float
    """Maximum time."""
    mark: Path | None
    """File that the watchdog writes; None in the calling process, which must not be ended: there
    the stage is interrupted."""

    @property
    def error(self) -> TimeLimitExceeded:
        """Error of a node that exceeded the limit."""
        return TimeLimitExceeded(f"exceeded its time limit of {self.seconds:g} s and was ended")


def limited(limit: TimeLimit | None) -> AbstractContextManager[None]:
    """A context that enforces `limit`.

    TimeLimitExceeded if the block took too long in the calling process; or, at once, the node took
    too long in another worker (Dask retries the tasks of a lost worker).
    """
    if limit is None:
        return nullcontext()
    if limit.mark is None:
        return _interrupted(limit)
    if mark_text(limit) is not None:
        raise limit.error
    return _killed(limit, limit.mark)


def can_interrupt() -> bool:
    """Whether a stage can be interrupted by an alarm: only in the main thread."""
    return hasattr(signal, "setitimer") and (threading.current_thread() is threading.main_thread())


def mark_text(limit: TimeLimit | None) -> str | None:
    """Traceback of a node that exceeded its limit in another process; None if it did not."""
    if limit is None or limit.mark is None:
        return None
    with suppress(OSError):
        return limit.mark.read_text("utf-8", errors="replace") or None
    return None


@contextmanager
def _killed(limit: TimeLimit, mark: Path) -> Iterator[None]:
    with writing(mark.parents[1]):
        mark.parent.mkdir(parents=True, exist_ok=True)
        file = mark.open("w")
    with file:
        faulthandler.dump_traceback_later(limit.seconds, exit=True, file=file)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
            with suppress(OSError):
                mark.unlink()


@contextmanager
def _interrupted(limit: TimeLimit) -> Iterator[None]:
    def stop(*_) -> None:
        raise limit.error

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, limit.seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
