"""One thread per stage: the workers give the parallelism, and the bytes do not depend on it."""

import importlib
import os
import sys
from collections.abc import Callable, Iterator, MutableMapping
from contextlib import contextmanager
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from stixel_cli.engine.errors import ExecutorError

_LIBRARIES = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    ),
    "1",
)

ENVIRONMENT = {**_LIBRARIES, "NUMBA_NUM_THREADS": "1"}
"""For a new process. The libraries read it when they are loaded."""


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit the numerical libraries of this process to one thread, until the last caller leaves.

    A process that began with `ENVIRONMENT` needs no limit; this is for the others: a program that
    calls this package, a worker that somebody else started. Numba is left alone: its kernels here
    are not parallel, and it objects to a change after its start.

    Raises:
        ExecutorError: a library keeps more threads.
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
        self.lock = Lock()
        self.inside = 0
        self.controller: Any = None
        self.set_by_libraries: Any = None
        self.opencv_threads: int | None = None
        self.environment: dict[str, str | None] = {}

    def enter(self) -> Any:
        """Set what is not set; the controller of the libraries that are loaded."""
        with self.lock:
            if "cv2" in sys.modules:
                # Another thread may be importing it just now: this waits until it has.
                cv2 = importlib.import_module("cv2")
                if cv2.getNumThreads() != 1:
                    self.opencv_threads = cv2.getNumThreads()
                    cv2.setNumThreads(1)
            if any(os.environ.get(name) != value for name, value in _LIBRARIES.items()):
                self.environment = {name: os.environ.get(name) for name in _LIBRARIES}
                os.environ.update(_LIBRARIES)
                self.controller = None
            if self.controller is None:
                # What is loaded after this reads the environment.
                from threadpoolctl import ThreadpoolController

                self.controller = ThreadpoolController()
            if not self.inside and any(
                library["num_threads"] != 1 for library in self.controller.info()
            ):
                self.set_by_libraries = _in_a_thread(lambda: self.controller.limit(limits=1))
            self.inside += 1
            return self.controller

    def leave(self) -> None:
        with self.lock:
            self.inside -= 1
            if self.inside:
                return
            if self.set_by_libraries is not None:
                _in_a_thread(self.set_by_libraries.restore_original_limits)
            if self.opencv_threads is not None:
                sys.modules["cv2"].setNumThreads(self.opencv_threads)
            _restore(os.environ, self.environment)
            self.set_by_libraries, self.opencv_threads, self.environment = None, None, {}


def _in_a_thread(call: Callable[[], Any]) -> Any:
    """The result of `call()` in a thread of its own.

    threadpoolctl lets one thread alone set limits of OpenBLAS: the first that does, until that
    thread ends. It ignores all others, without an error.
    """
    results: list[Any] = []
    thread = Thread(target=lambda: results.append(call()))
    thread.start()
    thread.join()
    return results[0]


def _restore(environment: MutableMapping[str, str], before: dict[str, str | None]) -> None:
    for name, value in before.items():
        if value is None:
            environment.pop(name, None)
        else:
            environment[name] = value


_limits = _Limits()
