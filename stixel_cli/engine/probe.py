"""What would keep an execution from beginning, asked before anything is made for its results."""

from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.parameters import DaskExecutor, Executor
from stixel_cli.engine.store import Store


def probe(missing: int, store: Store, executor: Executor | None) -> None:
    """Raise what `execute` would, before anything is computed, with `missing` nodes to compute.

    A cache that lacks nothing need not be written, and nobody is needed to compute anything.

    Raises:
        CacheError: results cannot be stored.
        ExecutorError: Dask is not installed, or no scheduler answers at the executor's address.
    """
    if not missing:
        return
    check_writable(missing, store)
    if isinstance(executor, DaskExecutor):
        from stixel_cli.engine.dask_pool import probe_scheduler

        probe_scheduler(executor)


def check_writable(missing: int, store: Store) -> None:
    """Raise CacheError if the store lacks results and cannot be written."""
    if not missing:
        return
    try:
        store.check_writable()
    except CacheError as error:
        results = "1 of the results" if missing == 1 else f"{missing} of the results"
        raise CacheError(
            f"{error}; it lacks {results} needed (STIXEL_CACHE or cache.folder=… names another)"
        ) from error
