"""Ctrl-C, and SIGTERM where it is treated as Ctrl-C, at a moment when nothing is half done.

Raised in the midst of waiting for futures, it leaves a lock of theirs held for good; the thread
that looks after the workers then waits for it for ever, and the end of the workers for that thread.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def deferred_interrupts() -> Iterator[Callable[[], None]]:
    """Keep Ctrl-C in mind, for the function that is given to raise it as a KeyboardInterrupt.

    This changes nothing outside the main thread, nor for a signal that the caller handles in
    another way than by Python's `default_int_handler`.
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
    # It may have come after the last look.
    check()
