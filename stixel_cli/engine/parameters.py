"""Parameters of the groups `executor` and `cache`, and the sizes and ages in them.

No stage reads them, so no key and no result depends on them.
"""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, MinLen

from stixel_cli.parameters import parameters

_SIZES = {"": 1, "B": 1}
_SIZES |= {f"{prefix}B": 1000**power for power, prefix in enumerate("KMGT", 1)}
_SIZES |= {f"{prefix}IB": 1024**power for power, prefix in enumerate("KMGT", 1)}
_AGES = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}


def parse_size(text: str) -> int:
    """Bytes of `500MB`, `10 GB`, `1.5TiB`, `4096`; ValueError, in one line, of another text."""
    return int(_parsed(text, _SIZES, "size: write 500MB, 10GB, 1.5TB"))


def parse_age(text: str) -> float:
    """Seconds of `90s`, `10min`, `12h`, `30d`, `4w`; ValueError, in one line, of another text."""
    return _parsed(text, _AGES, "age: write 10min, 12h, 30d, 4w")


def duration(seconds: float) -> str:
    """Format a time: `40 s`, `12 min`, `3 h 20 min`, `7 d`."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    days = f"{minutes / 1440:.0f} d"
    return days if minutes >= 2880 else f"{minutes // 60} h {minutes % 60} min"


def _parsed(text: str, units: Mapping[str, float], right: str) -> float:
    """A number with one of the `units`; a unit of capitals may be typed in small letters."""
    found = re.fullmatch(r"\s*(\d{1,15}(?:\.\d{1,9})?)\s*([A-Za-z]*)\s*", text, re.ASCII)
    factor = found and units.get(found[2], units.get(found[2].upper()))
    if factor is None:
        raise ValueError(f"{text!r} is not a valid {right}")
    return float(found[1]) * factor


PROGRAM = __name__.partition(".")[0].removesuffix("_cli")
"""Name of the program in messages, and of its folder in the user's cache."""

CACHE_VARIABLE = f"{PROGRAM.upper()}_CACHE"
"""Environment variable that names the folder of the store."""


Workers = Annotated[int, Ge(1), Le(4096)]
TimeLimit = Annotated[float, Gt(0), Le(1e7)]


def default_cache_folder() -> Path:
    """The folder named by the environment, else the program's folder in the user's cache."""
    named = os.environ.get(CACHE_VARIABLE)
    if named:
        return Path(named).expanduser().absolute()
    import platformdirs

    return platformdirs.user_cache_path(PROGRAM, appauthor=False)


@parameters
class LocalExecutor:
    """Processes on this machine.

    Attributes:
        workers: number of processes; each runs one node at a time, on one thread.
        time_limit: maximum seconds per node, from loading its inputs to storing its result. A node
            that takes longer is ended and fails. Null for no limit.
    """

    kind: Literal["local"]
    workers: Workers
    time_limit: TimeLimit | None


@parameters
class ThreadsExecutor:
    """Threads of this process. A thread cannot be ended, so there is no time limit.

    Attributes:
        workers: number of threads.
    """

    kind: Literal["threads"]
    workers: Workers


@parameters
class DaskExecutor:
    """Workers of a running Dask scheduler; requires the optional dependencies `dask`.

    Attributes:
        workers: least number of nodes that are submitted at a time.
        time_limit: see `LocalExecutor`.
        address: of the scheduler, such as tcp://10.0.0.7:8786; required.
    """

    kind: Literal["dask"]
    workers: Workers
    time_limit: TimeLimit | None
    address: Annotated[str, MinLen(1)] | None


Executor = LocalExecutor | ThreadsExecutor | DaskExecutor


@parameters
class CacheParameters:
    """The store of results.

    Attributes:
        folder: null for the folder that the environment names, or else the user's cache.
        max_size: such as 20GB. Each execution removes the least recently used results beyond it,
            except those that a running process uses. Null for no limit.
    """

    folder: Annotated[str, MinLen(1)] | None
    max_size: str | None

    def check(self) -> None:
        """Raise ValueError if `max_size` is not a valid size."""
        if self.max_size is not None:
            try:
                parse_size(self.max_size)
            except ValueError as fault:
                raise ValueError(f"cache.max_size: {fault}, or null") from None
