"""Compute and store a node in a worker.

A node travels between processes with its names, settings and keys, never with arrays.
"""

import pickle
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from stixel_cli.border import unpickled_bytes
from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.graph import Node
from stixel_cli.engine.keys import CHUNKED
from stixel_cli.engine.limits import TimeLimit, limited, one_thread
from stixel_cli.engine.loaded_code import planned_function
from stixel_cli.engine.store import Store
from stixel_cli.engine.versions import check_versions


@dataclass(frozen=True)
class Outcome:
    """Outcome of the computation of a node.

    Attributes:
        status: `computed`, `cached` (another process was first), `missing` (an input is missing or
            damaged), or `failed`.
        seconds: time to load, compute and store, without the wait for the lock.
        size: bytes that were stored.
        error: MissingEntry of the missing input, or the stage's error.
        traceback_text: see `StageFailure`.
    """

    status: Literal["computed", "cached", "missing", "failed"]
    seconds: float = 0.0
    size: int = 0
    error: Exception | None = None
    traceback_text: str = ""


class ChunkSequence(Sequence):
    """The chunks of an input in order. Each access loads the chunk from the store."""

    def __init__(self, keys: tuple[str, ...], load: Callable[[str], Any]):
        self._keys = keys
        self._load = load

    def __len__(self) -> int:
        return len(self._keys)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return ChunkSequence(self._keys[index], self._load)
        return self._load(self._keys[index])


def run_node(node: Node, folder: Path, limit: TimeLimit | None = None) -> Outcome:
    """Compute a node and store it at `folder`, unless the store has it by now."""
    # The store needs it; its import is no part of the node's time.
    import_module("joblib")
    store = Store(folder)
    started = time.perf_counter()
    try:
        with store.lock(node.key):
            if store.has(node.key):
                return Outcome("cached")
            started = time.perf_counter()
            with limited(limit):
                size = _compute(node, store)
            return Outcome("computed", time.perf_counter() - started, size)
    except Exception as error:
        seconds = time.perf_counter() - started
        if isinstance(error, MissingEntry) and error.key in node.sources:
            return Outcome("missing", seconds, error=error)
        return Outcome("failed", seconds, error=_portable(error), traceback_text=_own_part(error))


def _compute(node: Node, store: Store) -> int:
    """Load, call and store; return the size of the result in bytes."""
    # CPU time of this thread does not depend on the load of the machine. It does not include
    # processes that the function starts.
    started, cpu_started = time.perf_counter(), time.thread_time()
    check_versions(node.identity.content)
    code = node.identity.code
    function = planned_function(node.stage.function, code)
    arguments = _arguments(node, store)
    with one_thread():
        value = function(**arguments)
    return store.save(
        node.key,
        value,
        **node.identity.content,
        label=node.label,
        frames=node.frames,
        inputs={name: list(keys) for name, keys in node.inputs.items()},
        previous=node.previous,
        modules=code.modules,
        seconds=round(time.perf_counter() - started, 4),
        cpu_seconds=round(time.thread_time() - cpu_started, 6),
        created=round(time.time(), 3),
    )


def _arguments(node: Node, store: Store) -> dict[str, Any]:
    """The settings, frames, seed and files of a node, and its inputs, loaded from the store."""
    stage = node.stage
    arguments = dict(stage.settings)
    if stage.pattern in CHUNKED:
        arguments["frames"] = range(node.first, node.stop)
    elif stage.pattern == "pick":
        arguments["frame"] = node.first
    if stage.seed is not None:
        arguments["seed"] = stage.seed
    if stage.gives_files:
        arguments["files"] = stage.files
    for name, keys in node.inputs.items():
        if name in node.sequences:
            arguments[name] = ChunkSequence(keys, store.load)
        else:
            arguments[name] = store.load(keys[0])
    if stage.pattern == "fold":
        arguments["previous"] = None if node.previous is None else store.load(node.previous)
    return arguments


def _own_part(error: Exception) -> str:
    """The traceback without the first frames, which are of this module."""
    trace = error.__traceback__
    while (
        trace is not None
        and trace.tb_next is not None
        and trace.tb_frame.f_code.co_filename == __file__
    ):
        trace = trace.tb_next
    return "".join(traceback.format_exception(type(error), error, trace))


def _portable(error: Exception) -> Exception:
    """The error, or its text if it cannot be pickled."""
    try:
        copy = unpickled_bytes(pickle.dumps(error))
        if str(copy) == str(error):
            return error
    except Exception:
        pass
    return RuntimeError(f"{type(error).__name__}: {error}")
