"""Time limit of a node, enforced in the process that runs it.

A stage may hang in compiled code that holds the interpreter lock, so a Python thread cannot end it.
The watchdog of `faulthandler` ends the process and writes the traceback to a file, the *mark*. The
mark tells the parent that the node exceeded its limit, and that the worker did not crash.
"""

import faulthandler
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from stixel_cli.engine.errors import TimeLimitExceeded
from stixel_cli.engine.locks import unwritable


@dataclass(frozen=True)
class TimeLimit:
    """Time limit of one node.

    Attributes:
        seconds: maximum time.
        mark: file that the watchdog writes; None in the calling process, which must not be ended:
            there the stage is interrupted.
    """

    seconds: float
    mark: Path | None

    @property
    def error(self) -> TimeLimitExceeded:
        """Error of a node that exceeded the limit."""
        return TimeLimitExceeded(f"exceeded its time limit of {self.seconds:g} s and was ended")


@contextmanager
def limited(limit: TimeLimit | None) -> Iterator[None]:
    """Enforce `limit` inside the `with` block.

    Raises:
        TimeLimitExceeded: the block took too long in the calling process; or, at once, the node
            took too long in another worker (Dask retries the tasks of a lost worker).
    """
    if limit is None:
        yield
    elif limit.mark is None:
        with _interrupted(limit):
            yield
    else:
        if mark_text(limit) is not None:
            raise limit.error
        with _killed(limit, limit.mark):
            yield


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
    try:
        mark.parent.mkdir(parents=True, exist_ok=True)
        file = mark.open("w")
    except OSError as error:
        raise unwritable(mark.parents[1], error) from error
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
