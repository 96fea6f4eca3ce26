"""How long a node of each stage took, kept in the store to tell small work from large."""

import json
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from stixel_cli.engine.graph import Graph, Node


class Durations:
    """Seconds a node, by the stage's function."""

    def __init__(self, folder: Path):
        self._path = folder / "durations.json"
        self._seconds: dict[str, float] = {}
        with suppress(OSError, ValueError, TypeError, AttributeError):
            known = json.loads(self._path.read_text(encoding="utf-8"))
            self._seconds = {str(name): float(seconds) for name, seconds in known.items()}

    def estimate(self, nodes: Iterable[Node]) -> float | None:
        """Seconds that `nodes` take one after the other; None if one of a kind is unknown."""
        total = 0.0
        for node in nodes:
            seconds = self._seconds.get(node.stage.function)
            if seconds is None:
                return None
            total += seconds
        return total

    def by_stage(self, nodes: Iterable[Node]) -> dict[str, float]:
        """Seconds that a node of each stage takes, by the stage's name, where that is known."""
        names = {node.stage.name: self._seconds.get(node.stage.function) for node in nodes}
        return {name: seconds for name, seconds in names.items() if seconds is not None}

    def learn(self, graph: Graph, seconds: Mapping[str, float]) -> None:
        """Take up what nodes of `graph` took, by key; half of an older figure fades each time."""
        by_function: dict[str, list[float]] = {}
        for key, value in seconds.items():
            by_function.setdefault(graph.nodes[key].stage.function, []).append(value)
        for function, values in by_function.items():
            mean = sum(values) / len(values)
            old = self._seconds.get(function, mean)
            self._seconds[function] = round(0.5 * (old + mean), 4)
        if not seconds:
            return
        # An estimate only: if it cannot be written, or two runs write at once, nothing is lost.
        with suppress(OSError):
            partial = self._path.with_name(f"durations-{os.getpid()}.json")
            partial.write_text(json.dumps(self._seconds, indent=1, sort_keys=True), "utf-8")
            partial.replace(self._path)
