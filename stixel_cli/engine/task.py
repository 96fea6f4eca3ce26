"""A node as it travels to a worker: names and keys, never arrays. And what comes back."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from stixel_cli.engine.code import Code
from stixel_cli.engine.graph import Node
from stixel_cli.engine.time_limit import TimeLimit


@dataclass(frozen=True)
class Task:
    """All that a worker needs to compute a node.

    Attributes:
        key, label, function: of the node and its stage.
        arguments: the settings, frames and seed as the function takes them.
        inputs: argument name -> keys; those in `sequences` arrive as a lazy sequence.
        previous: key of the fold's node before, None at the first; `fold` tells whether there
            is such an argument.
        code: the code as it was planned.
        notes: stored beside the value.
        limit: on the time it takes, None for none.
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


@dataclass(frozen=True)
class Outcome:
    """What became of a task.

    Attributes:
        status: `computed`, `cached` (someone else was first), `missing` (an input is not there,
            or was damaged and is set aside), or `failed`.
        seconds: spent on loading, computing and storing, not on waiting for the lock.
        size: bytes that were stored.
        missing: (key, reason) of the inputs that are not there.
        error, traceback_text: what the stage raised.
    """

    status: Literal["computed", "cached", "missing", "failed"]
    seconds: float = 0.0
    size: int = 0
    missing: tuple[tuple[str, str], ...] = ()
    error: BaseException | None = None
    traceback_text: str = ""


def task_of(node: Node, limit: TimeLimit | None = None) -> Task:
    """The task that computes `node`."""
    stage = node.stage
    arguments = dict(stage.settings)
    if stage.pattern in ("map", "fold"):
        arguments["frames"] = range(node.first, node.stop)
    elif stage.pattern == "pick":
        arguments["frame"] = node.first
    if stage.seed is not None:
        arguments["seed"] = stage.seed
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
    )
