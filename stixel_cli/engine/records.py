"""What an execution did, node by node and stage by stage."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from stixel_cli.engine.canonical import digest
from stixel_cli.engine.graph import Graph


@dataclass(frozen=True)
class NodeRecord:
    """One node: computed in this execution, or had from the cache (then `seconds` is 0)."""

    key: str
    stage: str
    label: str
    status: Literal["computed", "cached"]
    seconds: float


@dataclass(frozen=True)
class StageRecord:
    """All nodes of a stage.

    Attributes:
        name: of the stage.
        key: of its node; of several nodes, a digest of their keys.
        status: `computed` if any node was.
        seconds: spent in this execution, over all workers.
        nodes, nodes_computed: how many there are, and how many were computed.
    """

    name: str
    key: str
    status: Literal["computed", "cached"]
    seconds: float
    nodes: int
    nodes_computed: int


@dataclass(frozen=True)
class Execution:
    """What an execution did.

    Attributes:
        graph: what was executed.
        records: by node id, of the targets and all that they depend on.
    """

    graph: Graph
    records: Mapping[str, NodeRecord]

    def of_stage(self, name: str) -> StageRecord:
        """The record of a stage.

        Raises:
            KeyError: no target needed a node of such a stage.
        """
        keys = [key for key in self.graph.stages[name] if key in self.records]
        if not keys:
            raise KeyError(name)
        nodes = [self.records[key] for key in keys]
        computed = sum(node.status == "computed" for node in nodes)
        return StageRecord(
            name=name,
            key=keys[0] if len(keys) == 1 else digest(keys),
            status="computed" if computed else "cached",
            seconds=round(sum(node.seconds for node in nodes), 4),
            nodes=len(nodes),
            nodes_computed=computed,
        )

    def stage_records(self) -> list[dict[str, Any]]:
        """One record a stage as plain JSON, in the order of the data."""
        needed = {record.stage for record in self.records.values()}
        return [vars(self.of_stage(name)) for name in self.graph.stage_names if name in needed]
