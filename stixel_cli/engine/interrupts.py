"""Ctrl-C at a moment when nothing is half done.

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

    Elsewhere than in the main thread, and where who calls handles Ctrl-C in a way of their own,
    all is left as it is.
    """
    pending: list[int] = []

    def check() -> None:
        if pending:
            raise KeyboardInterrupt

    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield check
        return
    signal.signal(signal.SIGINT, lambda number, _: pending.append(number))
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    # It may have come after the last look.
    check()
