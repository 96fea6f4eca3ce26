"""What is to be computed for some targets, given what the store holds."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from stixel_cli.engine.graph import Graph
from stixel_cli.engine.store import Store


@dataclass(frozen=True)
class Plan:
    """What an execution would do.

    Attributes:
        graph: what it is about.
        targets: ids of the nodes that are asked for.
        needed: ids of the targets and all that they depend on.
        missing: ids of those that have to be computed, in an order that they can be.
    """

    graph: Graph
    targets: tuple[str, ...]
    needed: frozenset[str]
    missing: tuple[str, ...]


def plan(graph: Graph, targets: Sequence[str], store: Store, verify: bool = True) -> Plan:
    """What is to be computed for `targets` (stage names or node ids): what they need and only that.

    Targets that are there are read and believed only if their digest is right, since they will
    be loaded; of what lies before them it is enough that it is there. Without `verify` this is
    enough of the targets too: a forecast for many is made in no time.

    Raises:
        KeyError: no such target.
        CacheError: the store cannot be read.
    """
    ids = graph.expand(targets)
    there = store.verify if verify else store.has
    missing = missing_nodes(graph, [key for key in ids if not there(key)], store)
    return Plan(graph, tuple(ids), frozenset(graph.ancestors(ids)), tuple(missing))


def missing_nodes(graph: Graph, wanted: Collection[str], store: Store) -> list[str]:
    """`wanted` and those of their ancestors that have to be computed first, in such an order."""
    found: dict[str, None] = {}
    # Among equals, who is wanted first comes first: the points of a sweep run in their order.
    pending = list(wanted)[::-1]
    while pending:
        key = pending.pop()
        if key not in found:
            found[key] = None
            pending += [s for s in graph.nodes[key].sources if s not in found and not store.has(s)]
    return sorted(found, key=lambda key: (graph.nodes[key].depth, graph.nodes[key].first or 0))
