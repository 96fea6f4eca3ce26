"""A limit on the time that a node takes, kept in the process that runs it.

A stage may hang in compiled code that holds the interpreter, so a thread of Python's is no good:
faulthandler's own watchdog ends the process, and leaves in a file where it hung. By that file, the
*mark*, the parent tells a node over its limit from one whose worker died of something else.
"""

import faulthandler
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from stixel_cli.engine.errors import CacheError, TimeLimitExceeded


@dataclass(frozen=True)
class TimeLimit:
    """What a worker needs to know.

    Attributes:
        seconds: that the node may take.
        mark: file that tells that it took longer; None in the calling process itself, which is
            not to be killed: there the stage is interrupted.
    """

    seconds: float
    mark: Path | None

    @property
    def error(self) -> TimeLimitExceeded:
        """What is said of a node that took longer."""
        return TimeLimitExceeded(f"over its time limit of {self.seconds:g} s, and was ended")


@contextmanager
def limited(limit: TimeLimit | None) -> Iterator[None]:
    """Keep what is within to `limit`.

    Raises:
        TimeLimitExceeded: in the calling process; or at once, if the node was over it elsewhere
            (Dask hands what a lost worker ran to the next).
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
    """Whether a stage can be interrupted where this is called: by an alarm, in the main thread."""
    return hasattr(signal, "setitimer") and (threading.current_thread() is threading.main_thread())


def mark_text(limit: TimeLimit | None) -> str | None:
    """Where the node hung, if it was over its limit in another process; None if it was not."""
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
        raise CacheError(
            f"cannot write in the cache {mark.parents[1]}: {error.strerror or error}"
        ) from error
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
