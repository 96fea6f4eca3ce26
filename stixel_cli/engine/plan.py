"""What an execution would compute, how long that would take, and whether it can start."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from stixel_cli.engine.cache_folder import store_json, stored_json
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.graph import Graph, Node
from stixel_cli.engine.parameters import DaskExecutor, Executor
from stixel_cli.engine.source_files import undeclared_read
from stixel_cli.engine.store import Store


@dataclass(frozen=True)
class Plan:
    """What an execution would do."""

    graph: Graph
    """Of all nodes."""
    targets: tuple[str, ...]
    """Ids of the target nodes."""
    needed: frozenset[str]
    """Ids of the targets and of all nodes that they depend on."""
    missing: tuple[str, ...]
    """Ids of the nodes to compute, each after its inputs."""


def undeclared_reads(nodes: Iterable[Node]) -> list[str]:
    """One line for each of the user's modules that may read files which no key contains."""
    codes = {id(one.identity.code): one.identity.code for one in nodes if one.stage.own}
    files = sorted({path for code in codes.values() for path in code.of_user.values()})
    advice = 'the cache does not notice changes of a file: declare FILES = ["NAME"], or FILES = []'
    return [f"{call}: {advice} (tutorial 4)" for call in map(undeclared_read, files) if call]


def plan(graph: Graph, targets: Sequence[str], store: Store, verify: bool = True) -> Plan:
    """Find the nodes to compute for `targets` (stage names or node ids).

    The digests of stored targets are verified, since they will be loaded; for other nodes it is
    enough that an entry exists. With `verify=False` this is enough for the targets too: fast for
    many targets. KeyError if there is no such target, CacheError if the store cannot be read.
    """
    ids, needed = graph.expand(targets), frozenset(graph.ancestors(targets))
    stored = store.verify if verify else store.has
    missing = missing_nodes(graph, [key for key in ids if not stored(key)], store)
    return Plan(graph, tuple(ids), needed, tuple(missing))


def missing_nodes(graph: Graph, wanted: Collection[str], store: Store) -> list[str]:
    """`wanted` and their missing ancestors, each node after its inputs."""
    found: dict[str, None] = {}
    # Nodes of equal depth stay in the order of `wanted`.
    pending = list(wanted)[::-1]
    while pending:
        key = pending.pop()
        if key not in found:
            found[key] = None
            pending += [s for s in graph.nodes[key].sources if s not in found and not store.has(s)]
    return sorted(found, key=lambda key: (graph.nodes[key].depth, graph.nodes[key].first or 0))


DURATIONS = "durations-3.json"
"""File of the store; older versions have other units and forms."""


class Durations:
    """Seconds of each stage's function for one unit of work, kept in the store at `folder`."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._seconds: dict[str, float] = stored_json(folder, "", DURATIONS) or {}

    def estimate(self, nodes: Iterable[Node]) -> tuple[float, list[str]]:
        """Seconds for `nodes`, one after the other, and the stages that were never measured.

        The seconds are those of the others.
        """
        seconds, unknown = 0.0, dict[str, None]()
        for node in nodes:
            if node.stage.function in self._seconds:
                seconds += self._seconds[node.stage.function] * node.work
            else:
                unknown[node.stage.name] = None
        return seconds, list(unknown)

    def by_stage(self, nodes: Iterable[Node]) -> dict[str, float]:
        """Seconds per node by the stage's name, without stages that were never measured."""
        found = {node.stage.name: self.estimate([node]) for node in nodes}
        return {name: seconds for name, (seconds, unknown) in found.items() if not unknown}

    def learn(self, graph: Graph, seconds: Mapping[str, float], workers: int) -> None:
        """Update the estimates with measured seconds, by key in the order in which they came.

        The first ones of a function, one for each of the `workers`, also load and compile code. The
        others count: half old value, half new mean. Without others, the first ones can only lower
        the estimate.
        """
        if not seconds:
            return
        by_function: dict[str, list[str]] = {}
        for key in seconds:
            by_function.setdefault(graph.nodes[key].stage.function, []).append(key)
        for function, every in by_function.items():
            others = every[workers:]
            keys = others or every
            mean = sum(seconds[key] for key in keys) / sum(graph.nodes[key].work for key in keys)
            old = self._seconds.get(function, mean)
            new = 0.5 * (old + mean) if others else min(old, mean)
            self._seconds[function] = float(f"{new:.4g}")
        # Only an estimate: it may fail to be written, or be overwritten by another process.
        with suppress(OSError, CacheError):
            store_json(self._folder, "", DURATIONS, self._seconds)


def probe(missing: int, store: Store, executor: Executor | None) -> None:
    """Raise what `execute` would raise before it computes `missing` nodes.

    Without missing nodes neither a writable store nor workers are needed. CacheError if results
    cannot be stored, ExecutorError as of `DaskPool`.
    """
    if missing:
        store.check_writable()
    if missing and isinstance(executor, DaskExecutor):
        from stixel_cli.engine.dask_pool import DaskPool

        DaskPool(executor).close()
