"""What an execution did, node by node and stage by stage."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from stixel_cli.engine.canonical import digest
from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.graph import Graph

Status = Literal["computed", "cached", "failed", "skipped"]
"""`skipped` is what depends on a node that failed."""


@dataclass(frozen=True)
class NodeRecord:
    """One node; `seconds` is 0 if it was not computed in this execution."""

    key: str
    stage: str
    label: str
    status: Status
    seconds: float


@dataclass(frozen=True)
class StageRecord:
    """All nodes of a stage.

    Attributes:
        name: of the stage.
        key: of its node; of several nodes, a digest of their keys.
        status: `failed` if any node has, else `skipped` if any was, else `computed` if any was.
        seconds: spent in this execution, over all workers.
        nodes, nodes_computed: how many there are, and how many were computed.
    """

    name: str
    key: str
    status: Status
    seconds: float
    nodes: int
    nodes_computed: int


@dataclass(frozen=True)
class Execution:
    """What an execution did.

    Attributes:
        graph: what was executed.
        records: by node id, of the targets and all that they depend on.
        failures: by node id, of the nodes that failed; only where that did not end the execution.
    """

    graph: Graph
    records: Mapping[str, NodeRecord]
    failures: Mapping[str, StageFailure] = field(default_factory=dict)

    def failure_of(self, targets: Sequence[str]) -> tuple[str, StageFailure] | None:
        """The node for which not all of `targets` are there, and how it failed; None if all are.

        Of several it is the first in the data's way.
        """
        ancestors = self.graph.ancestors(targets) if self.failures else set()
        failed = [key for key in self.failures if key in ancestors]
        first = min(failed, key=lambda key: (self.graph.nodes[key].depth, key), default=None)
        return None if first is None else (first, self.failures[first])

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
        found = {node.status for node in nodes}
        return StageRecord(
            name=name,
            key=keys[0] if len(keys) == 1 else digest(keys),
            status=next(s for s in ("failed", "skipped", "computed", "cached") if s in found),
            seconds=round(sum(node.seconds for node in nodes), 4),
            nodes=len(nodes),
            nodes_computed=computed,
        )

    def stage_records(self) -> list[dict[str, Any]]:
        """One record a stage as plain JSON, in the order of the data."""
        needed = {record.stage for record in self.records.values()}
        return [vars(self.of_stage(name)) for name in self.graph.stage_names if name in needed]
