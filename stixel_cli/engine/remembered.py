"""Keep results that are no nodes of a graph, such as the figures of a sweep, in the store."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from stixel_cli.engine.code import CodeIndex
from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.keys import LAYOUT, digest
from stixel_cli.engine.loaded_code import may_run_here
from stixel_cli.engine.source_files import save_digests
from stixel_cli.engine.store import Store
from stixel_cli.engine.versions import python_version


def remembered(
    store: Store, name: str, modules: Sequence[str], content: Any, compute: Callable[[], Any]
) -> Any:
    """The stored result for the same code and the same `content`; else that of `compute()`.

    Nothing is stored in a store that is read-only, or if this process runs other code than the
    files have by now.

    Args:
        store: of the results.
        name: what it is, in the place of a stage's name.
        modules: the code of `compute`, with all that it imports.
        content: all else that the result depends on, a JSON tree; lists where the order matters.
        compute: a pure function of `content`.
    """
    code = CodeIndex(store.folder).code(modules)
    # Otherwise each process parses these modules: only they may be missing in the store.
    save_digests(store.folder)
    if not may_run_here(code):
        return compute()
    versions = {"python": python_version(), **code.versions}
    key = digest([LAYOUT, name, code.digest, versions, content])
    with suppress(MissingEntry):
        return store.load(key)
    started, cpu_started = time.perf_counter(), time.thread_time()
    value = compute()
    with suppress(CacheError):
        store.save(
            key,
            value,
            stage=name,
            label=name,
            modules=code.modules,
            seconds=round(time.perf_counter() - started, 4),
            cpu_seconds=round(time.thread_time() - cpu_started, 6),
            created=round(time.time(), 3),
        )
    return value
