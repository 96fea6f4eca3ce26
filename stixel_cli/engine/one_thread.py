"""One thread a stage: the workers give the parallelism, and the bytes do not depend on it."""

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

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
    """Keep the numerical libraries of this process to one thread, until the last one leaves.

    Numba is left alone: its kernels here are not parallel, and it objects to a change on the way.
    """
    _limits.enter()
    try:
        yield
    finally:
        _limits.leave()


class _Limits:
    """The limits of a process whose threads come and go."""

    def __init__(self):
        self.lock = Lock()
        self.inside = 0
        self.set_by_libraries = []
        self.opencv_threads: int | None = None
        self.environment: dict[str, str | None] = {}

    def enter(self) -> None:
        with self.lock:
            self.inside += 1
            if "cv2" in sys.modules:
                # Another thread may be importing it just now: this waits until it has.
                cv2 = importlib.import_module("cv2")
                if cv2.getNumThreads() != 1:
                    self.opencv_threads = cv2.getNumThreads()
                    cv2.setNumThreads(1)
            if any(os.environ.get(name) != value for name, value in _LIBRARIES.items()):
                self.environment = {name: os.environ.get(name) for name in _LIBRARIES}
                os.environ.update(_LIBRARIES)
            if self.environment:
                # A worker has the environment from its start: there is nothing to look for.
                from threadpoolctl import threadpool_limits

                self.set_by_libraries.append(threadpool_limits(limits=1))

    def leave(self) -> None:
        with self.lock:
            self.inside -= 1
            if self.inside:
                return
            for limits in reversed(self.set_by_libraries):
                limits.restore_original_limits()
            if self.opencv_threads is not None:
                sys.modules["cv2"].setNumThreads(self.opencv_threads)
            for name, value in self.environment.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value
            self.set_by_libraries, self.opencv_threads, self.environment = [], None, {}


_limits = _Limits()
