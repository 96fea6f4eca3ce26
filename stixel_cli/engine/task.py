"""Compute and store a node in a worker, or a result that is no node.

Names and keys travel between processes, never arrays.
"""

import pickle
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from stixel_cli.engine.code import Code, CodeIndex
from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.graph import Node
from stixel_cli.engine.keys import LAYOUT, digest
from stixel_cli.engine.loaded_code import may_run_here, planned_function
from stixel_cli.engine.one_thread import one_thread
from stixel_cli.engine.source_files import save_digests
from stixel_cli.engine.store import Store
from stixel_cli.engine.time_limit import TimeLimit, limited
from stixel_cli.engine.versions import check_versions, python_version


@dataclass(frozen=True)
class Task:
    """Everything a worker needs to compute a node.

    Attributes:
        key, label, function: of the node and its stage.
        arguments: settings, frames and seed, as the function takes them.
        inputs: argument name -> keys; those in `sequences` are passed as a lazy sequence.
        fold: whether the function has the argument `previous`.
        previous: key of the node before in a fold, None for the first.
        code: the code that the key was made from.
        notes: stored with the value.
        limit: time limit of the node, None for no limit.
        watched: see `Stage`.
    """

    key: str
    label: str
    function: str
    arguments: Mapping[str, Any]
    inputs: Mapping[str, tuple[str, ...]]
    sequences: frozenset[str]
    fold: bool
    previous: str | None
    code: Code
    notes: Mapping[str, Any]
    limit: TimeLimit | None
    watched: str = ""


SLOW = 5.0
"""Seconds of one step of a stage above which it is reported."""


class Steps:
    """The slowest step of a stage, as seconds and text; `begin` ends the step before."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter):
        self._clock, self._began, self._text = clock, 0.0, ""
        self.slowest = (0.0, "")

    def begin(self, text: str) -> None:
        """Begin the step `text`, unless it is the present one."""
        if text != self._text:
            now = self._clock()
            if self._text:
                self.slowest = max(self.slowest, (now - self._began, self._text))
            self._began, self._text = now, text

    @property
    def note(self) -> str:
        """What took long, in one line; empty if no step did."""
        seconds, text = self.slowest
        return f"took {seconds:.0f} s for {text}" if seconds > SLOW else ""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a task.

    Attributes:
        status: `computed`, `cached` (another process was first), `missing` (an input is missing or
            damaged), or `failed`.
        seconds: time to load, compute and store, without the wait for the lock.
        size: bytes that were stored.
        missing: (key, reason) of the missing inputs.
        error, traceback_text: see `StageFailure`.
        note: what took long in a computed node; "" for nothing.
    """

    status: Literal["computed", "cached", "missing", "failed"]
    seconds: float = 0.0
    size: int = 0
    missing: tuple[tuple[str, str], ...] = ()
    error: BaseException | None = None
    traceback_text: str = ""
    note: str = ""


def task_of(node: Node, limit: TimeLimit | None = None) -> Task:
    """Make the task that computes `node`."""
    stage = node.stage
    arguments = dict(stage.settings)
    if stage.pattern in ("map", "fold"):
        arguments["frames"] = range(node.first, node.stop)
    elif stage.pattern == "pick":
        arguments["frame"] = node.first
    if stage.seed is not None:
        arguments["seed"] = stage.seed
    if stage.gives_files:
        arguments["files"] = stage.files
    notes = {
        **node.identity.content,
        "label": node.label,
        "frames": None if node.first is None else [node.first, node.stop],
        "inputs": {name: list(keys) for name, keys in node.inputs.items()},
        "previous": node.previous,
    }
    return Task(
        key=node.key,
        label=node.label,
        function=stage.function,
        arguments=arguments,
        inputs=node.inputs,
        sequences=node.sequences,
        fold=stage.pattern == "fold",
        previous=node.previous,
        code=node.identity.code,
        notes=notes,
        limit=limit,
        watched=stage.watched,
    )


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


def run_task(task: Task, folder: Path) -> Outcome:
    """Compute a node and store it at `folder`, unless the store has it by now."""
    # The store needs it; its import is no part of the node's time.
    import_module("joblib")
    store = Store(folder)
    inputs = _Inputs(store)
    started = time.perf_counter()
    try:
        with store.lock(task.key):
            if store.has(task.key):
                return Outcome("cached")
            started = time.perf_counter()
            with limited(task.limit):
                size, note = _compute(task, inputs, store)
            return Outcome("computed", time.perf_counter() - started, size, note=note)
    except Exception as error:
        seconds = time.perf_counter() - started
        if inputs.missing:
            return Outcome("missing", seconds, missing=tuple(inputs.missing.items()))
        return Outcome("failed", seconds, error=_portable(error), traceback_text=_own_part(error))


def _compute(task: Task, inputs: "_Inputs", store: Store) -> tuple[int, str]:
    """Load, call and store; return the size of the result in bytes, and a note on slow steps."""
    # CPU time of this thread does not depend on the load of the machine. It does not include
    # processes that the function starts.
    started, cpu_started = time.perf_counter(), time.thread_time()
    check_versions(task.notes)
    function = planned_function(task.function, task.code)
    arguments, steps = _arguments(task, inputs), Steps()
    if task.watched:
        arguments[task.watched] = arguments[task.watched].watched(steps.begin)
    with one_thread():
        value = function(**arguments)
    steps.begin("the end")
    size = store.save(
        task.key,
        value,
        **task.notes,
        modules=task.code.modules,
        **_times(started, cpu_started),
    )
    return size, steps.note


def _times(started: float, cpu_started: float) -> dict[str, float]:
    """The notes on the time of a result that is computed now."""
    return {
        "seconds": round(time.perf_counter() - started, 4),
        "cpu_seconds": round(time.thread_time() - cpu_started, 6),
        "created": round(time.time(), 3),
    }


class _Inputs:
    """Load inputs, and record the missing ones."""

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
        copy = pickle.loads(pickle.dumps(error))
        if str(copy) == str(error):
            return error
    except Exception:
        pass
    return RuntimeError(f"{type(error).__name__}: {error}")


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
            **_times(started, cpu_started),
        )
    return value
