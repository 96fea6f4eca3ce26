"""One thread per stage: parallel work comes from the workers, and results do not depend on it."""

import importlib
import os
import sys
from collections.abc import Callable, Iterator
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
"""Environment of a new process. Libraries read it when they are loaded."""


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit the numerical libraries of this process to one thread, until the last caller leaves.

    A process that started with `ENVIRONMENT` needs no limit. Others do: a program that calls this
    package, or a worker that another program started. Numba is not limited: its kernels here are
    not parallel, and it rejects a change after its start.

    Raises:
        ExecutorError: a library still uses more threads.
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
        """Set missing limits; return the controller of the loaded libraries."""
        with self.lock:
            if "cv2" in sys.modules:
                # Another thread may be importing it: this waits for the import.
                cv2 = importlib.import_module("cv2")
                if cv2.getNumThreads() != 1:
                    self.opencv_threads = cv2.getNumThreads()
                    cv2.setNumThreads(1)
            if any(os.environ.get(name) != value for name, value in _LIBRARIES.items()):
                self.environment = {name: os.environ.get(name) for name in _LIBRARIES}
                os.environ.update(_LIBRARIES)
                self.controller = None
            if self.controller is None:
                # Libraries that are loaded later read the environment.
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
            for name, value in self.environment.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value
            self.set_by_libraries, self.opencv_threads, self.environment = None, None, {}


def _in_a_thread(call: Callable[[], Any]) -> Any:
    """Run `call()` in a new thread and return its result.

    Only the first thread that sets a limit of OpenBLAS can set one, until that thread ends.
    threadpoolctl ignores other threads without an error.
    """
    results: list[Any] = []
    thread = Thread(target=lambda: results.append(call()))
    thread.start()
    thread.join()
    return results[0]


_limits = _Limits()
