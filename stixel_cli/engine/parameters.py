"""Parameters of the engine: the schemas of the groups `executor` and `cache`.

No stage reads them, so no key and no result depends on them.
"""

from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, MinLen

from stixel_cli.engine.units import parse_size
from stixel_cli.parameters import parameters

Workers = Annotated[int, Ge(1), Le(4096)]
TimeLimit = Annotated[float, Gt(0), Le(1e7)]


@parameters
class LocalExecutor:
    """Processes of this machine.

    Attributes:
        workers: how many; each runs one node at a time, on one thread.
        time_limit: seconds that a node may take, from loading its inputs to storing its result;
            one that takes longer is killed and has failed. Null for no limit.
    """

    kind: Literal["local"]
    workers: Workers
    time_limit: TimeLimit | None


@parameters
class ThreadsExecutor:
    """Threads of this process. A thread cannot be killed, so there is no time limit.

    Attributes:
        workers: how many.
    """

    kind: Literal["threads"]
    workers: Workers


@parameters
class DaskExecutor:
    """Workers of Dask; needs `pip install 'stixel[dask]'`.

    Attributes:
        workers: how many processes a cluster of its own has; with an address, how many nodes are
            handed out at a time.
        time_limit: as `LocalExecutor` has it.
        address: of a scheduler that runs, such as tcp://10.0.0.7:8786; null to start a cluster of
            processes on this machine.
    """

    kind: Literal["dask"]
    workers: Workers
    time_limit: TimeLimit | None
    address: Annotated[str, MinLen(1)] | None


Executor = LocalExecutor | ThreadsExecutor | DaskExecutor


@parameters
class CacheParameters:
    """Where results are kept, and how many.

    Attributes:
        folder: null for the folder named by STIXEL_CACHE, or else the user's cache.
        max_size: such as 20GB, kept after every execution by removing what was not used for the
            longest time; what a running process uses stays in any case. Null for no limit.
    """

    folder: Annotated[str, MinLen(1)] | None
    max_size: str | None

    def check(self) -> None:
        """Raise ValueError if the size is none."""
        if self.max_size is not None:
            try:
                parse_size(self.max_size)
            except ValueError as fault:
                raise ValueError(f"cache.max_size: {fault}, or null") from None
