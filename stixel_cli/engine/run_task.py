"""What a worker does with a task: lock, look again, load, call, store."""

import pickle
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.loaded_code import check_versions, planned_function
from stixel_cli.engine.one_thread import one_thread
from stixel_cli.engine.store import Store
from stixel_cli.engine.task import Outcome, Task
from stixel_cli.engine.time_limit import limited


class ChunkSequence(Sequence):
    """The chunks of an input in order, each loaded when it is asked for and not kept."""

    def __init__(self, keys: tuple[str, ...], load: Callable[[str], Any]):
        self._keys = keys
        self._load = load

    def __len__(self) -> int:
        return len(self._keys)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return ChunkSequence(self._keys[index], self._load)
        return self._load(self._keys[index])


def run_task(task: Task, folder: Path) -> Outcome:
    """Compute a task's node, unless it is in the store at `folder` by now, and store it there."""
    store = Store(folder)
    inputs = _Inputs(store)
    started = time.perf_counter()
    try:
        with store.lock(task.key):
            if store.has(task.key):
                return Outcome("cached")
            started = time.perf_counter()
            with limited(task.limit):
                size = _compute(task, inputs, store)
            return Outcome("computed", time.perf_counter() - started, size)
    except Exception as error:
        seconds = time.perf_counter() - started
        if inputs.missing:
            return Outcome("missing", seconds, missing=tuple(inputs.missing.items()))
        return Outcome("failed", seconds, error=_portable(error), traceback_text=_own_part(error))


def _compute(task: Task, inputs: "_Inputs", store: Store) -> int:
    """Load, call and store; the size of the result in bytes."""
    # The thread's own CPU time, for chunks run on one thread: it does not depend on how busy the
    # machine is. A process that the function starts is not in it.
    started, cpu_started = time.perf_counter(), time.thread_time()
    check_versions(task.notes)
    function = planned_function(task.function, task.code)
    with one_thread():
        value = function(**_arguments(task, inputs))
    return store.save(
        task.key,
        value,
        **task.notes,
        modules=task.code.modules,
        seconds=round(time.perf_counter() - started, 4),
        cpu_seconds=round(time.thread_time() - cpu_started, 6),
        created=round(time.time(), 3),
    )


class _Inputs:
    """Loads inputs, and keeps in mind which were not there."""

    def __init__(self, store: Store):
        self.store = store
        self.missing: dict[str, str] = {}

    def load(self, key: str) -> Any:
        try:
            return self.store.load(key)
        except MissingEntry as error:
            self.missing[key] = error.reason
            raise


def _arguments(task: Task, inputs: _Inputs) -> dict[str, Any]:
    arguments = dict(task.arguments)
    for name, keys in task.inputs.items():
        if name in task.sequences:
            arguments[name] = ChunkSequence(keys, inputs.load)
        else:
            arguments[name] = inputs.load(keys[0])
    if task.fold:
        arguments["previous"] = None if task.previous is None else inputs.load(task.previous)
    return arguments


def _own_part(error: Exception) -> str:
    """The traceback without this module's own frames at its beginning."""
    trace = error.__traceback__
    while (
        trace is not None
        and trace.tb_next is not None
        and trace.tb_frame.f_code.co_filename == __file__
    ):
        trace = trace.tb_next
    return "".join(traceback.format_exception(type(error), error, trace))


def _portable(error: Exception) -> Exception:
    """The error, or its text where it cannot travel between processes."""
    try:
        copy = pickle.loads(pickle.dumps(error))
        if str(copy) == str(error):
            return error
    except Exception:
        pass
    return RuntimeError(f"{type(error).__name__}: {error}")
