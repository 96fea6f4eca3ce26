"""The command `stixel`, also as `python -m stixel_cli`: a process that ends with its command."""

import atexit
import os
import sys
from contextlib import suppress

from stixel_cli.cli.app import main


def console() -> None:
    """Run the command line of this process, and end it: Python would free every object, 0.02 s."""
    codes: list[int] = []
    # The first to be registered is the last to be called.
    atexit.register(lambda: [os._exit(code) for code in codes])
    codes.append(main())
    with suppress(OSError):
        sys.stdout.flush()


if __name__ == "__main__":
    console()
