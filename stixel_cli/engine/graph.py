"""The graph of nodes, which are built from stages. Each node is one stored result."""

import pickle
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from stixel_cli.engine.code import CodeIndex
from stixel_cli.engine.keys import CHUNKED, Identity, Stage, node_key, stage_identity
from stixel_cli.engine.source_files import load_digests


@dataclass(frozen=True)
class Node:
    """One result: a stage on a range of frames."""

    key: str
    """Key of the result, and id of the node. A result that two graphs share is one node."""
    stage: Stage
    """The stage."""
    identity: Identity
    """The part of the key that all nodes of the stage share."""
    first: int | None
    stop: int | None
    """`first`, `stop`: the frames are first … stop - 1; None for `once`."""
    inputs: Mapping[str, tuple[str, ...]]
    """Argument name -> keys of the nodes that provide it."""
    sequences: frozenset[str]
    """Arguments that are passed as a lazy sequence."""
    previous: str | None
    """Key of the node before in a fold, or None."""
    depth: int
    """Length of the longest path from a node without inputs."""

    @property
    def label(self) -> str:
        """`average[0:10]`, `plot[12]` or `load`."""
        frames = {"once": "", "pick": f"[{self.first}]"}
        return self.stage.name + frames.get(self.stage.pattern, f"[{self.first}:{self.stop}]")

    @property
    def frames(self) -> list[int] | None:
        """`first` and `stop`; None for `once`."""
        return None if self.first is None else [self.first, self.stop]

    @property
    def frame_count(self) -> int:
        """Number of frames; 0 for a node that does not run over frames."""
        return 0 if self.first is None else self.stop - self.first

    @property
    def work(self) -> float:
        """The amount of work, for estimates of the time."""
        return self.stage.amount * max(1, self.frame_count)

    @property
    def sources(self) -> tuple[str, ...]:
        """Keys of all nodes that it depends on directly."""
        keys = dict.fromkeys(key for keys in self.inputs.values() for key in keys)
        return tuple(keys) + ((self.previous,) if self.previous else ())


@dataclass(frozen=True)
class Graph:
    """Nodes by id, and the ids of each stage in the order of their frames.

    Each stage comes after its inputs.
    """

    nodes: dict[str, Node]
    stages: dict[str, tuple[str, ...]]

    def of_stage(self, name: str) -> list[Node]:
        """Nodes of a stage in the order of their frames."""
        return [self.nodes[node] for node in self.stages[name]]

    def expand(self, targets: Sequence[str]) -> list[str]:
        """Node ids of `targets`, which are ids or names of stages.

        KeyError if there is no such node or stage.
        """
        for target in targets:
            if target not in self.stages and target not in self.nodes:
                raise KeyError(f"no node or stage {target!r}")
        ids = (key for target in targets for key in self.stages.get(target, (target,)))
        return list(dict.fromkeys(ids))

    def ancestors(self, targets: Sequence[str]) -> set[str]:
        """Ids of the nodes of `targets`, as of `expand`, and of all that they depend on."""
        found, pending = set[str](), self.expand(targets)
        while pending:
            node = pending.pop()
            if node not in found:
                found.add(node)
                pending += self.nodes[node].sources
        return found

    def dependents(self, node: str, among: Iterable[str]) -> set[str]:
        """Ids of the nodes `among` that depend on `node`, directly or through others of them."""
        found = {node}
        for other in sorted(among, key=lambda one: self.nodes[one].depth):
            if not found.isdisjoint(self.nodes[other].sources):
                found.add(other)
        return found - {node}


def merge(graphs: Iterable[Graph]) -> Graph:
    """Merge graphs. Nodes that several graphs share appear once; all nodes keep their ids."""
    nodes: dict[str, Node] = {}
    stages: dict[str, dict[str, None]] = {}
    for graph in graphs:
        nodes.update(graph.nodes)
        for name, ids in graph.stages.items():
            stages.setdefault(name, {}).update(dict.fromkeys(ids))
    # In each graph the first node of a stage is deeper than those of its inputs.
    depths = {
        name: min((nodes[key].depth for key in ids), default=len(nodes))
        for name, ids in stages.items()
    }
    return Graph(nodes, {name: tuple(stages[name]) for name in sorted(stages, key=depths.get)})


class GraphBuilder:
    """Builds graphs. Identities and nodes that they share are computed once.

    Code and external files are read once: make a new builder to see later edits. The store at
    `store_folder`, if given, may know the digests of source files already.
    """

    def __init__(self, store_folder: Path | None = None):
        if store_folder is not None:
            load_digests(store_folder)
        self._index = CodeIndex()
        self._identities: dict[bytes, Identity] = {}
        self._nodes: dict[tuple, dict[str, Node]] = {}

    def build(self, stages: Sequence[Stage], frame_count: int, chunk_size: int) -> Graph:
        """The graph of `stages` over the frames 0 … `frame_count` - 1, in chunks of `chunk_size`.

        No stage is imported or computed. ValueError, in one line, if the stages are not valid; and
        the errors of `stage_identity`.
        """
        if frame_count < 1 or chunk_size < 1:
            raise ValueError(f"no frames: {frame_count} frames in chunks of {chunk_size}")
        one = _OneGraph(_in_order(stages), frame_count, chunk_size)
        for stage in one.stages.values():
            identity = self._identity(stage)
            sources = {name: one.ids[name] for name in stage.inputs.values()}
            wiring = tuple(sorted(stage.inputs.items())), tuple(sources.values())
            key = (identity.digest, *wiring, stage.frames, frame_count, chunk_size)
            if key not in self._nodes:
                self._nodes[key] = one.make(stage, identity)
            one.nodes.update(self._nodes[key])
            one.ids[stage.name] = tuple(self._nodes[key])
        return Graph(one.nodes, one.ids)

    def _identity(self, stage: Stage) -> Identity:
        # Pickles differ whenever keys do, also by types and by the last bit of floats.
        what = (stage.name, stage.function, stage.pattern, stage.modules, stage.seed)
        files = [str(path) for path in (*stage.files, None, *stage.folders)]
        try:
            known = pickle.dumps((what, files, dict(stage.settings)))
        except Exception:
            # `stage_identity` reports a setting that cannot be part of a key.
            return stage_identity(stage, self._index)
        if known not in self._identities:
            self._identities[known] = stage_identity(stage, self._index)
        return self._identities[known]


@dataclass
class _OneGraph:
    """A graph under construction: nodes of a stage are made after those of its inputs."""

    stages: dict[str, Stage]
    frame_count: int
    chunk_size: int
    nodes: dict[str, Node] = field(default_factory=dict)
    ids: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def make(self, stage: Stage, identity: Identity) -> dict[str, Node]:
        """The nodes of a stage, by their keys."""
        made: dict[str, Node] = {}
        for first, stop in self.frames_of(stage):
            inputs = {
                argument: self.providers(stage, self.stages[source], first)
                for argument, source in sorted(stage.inputs.items())
            }
            previous = next(reversed(made)) if stage.pattern == "fold" and made else None
            key = node_key(identity, first, stop, inputs, previous)
            depths = [self.nodes[key].depth for keys in inputs.values() for key in keys]
            depths += [made[previous].depth] if previous else []
            made[key] = Node(
                key=key,
                stage=stage,
                identity=identity,
                first=first,
                stop=stop,
                inputs=inputs,
                sequences=frozenset(
                    argument
                    for argument, source in stage.inputs.items()
                    if stage.pattern == "once" and self.stages[source].pattern != "once"
                ),
                previous=previous,
                depth=1 + max(depths, default=-1),
            )
        return made

    def frames_of(self, stage: Stage) -> list[tuple[int | None, int | None]]:
        if stage.pattern == "once":
            return [(None, None)]
        if stage.pattern == "pick":
            outside = [k for k in stage.frames if not 0 <= k < self.frame_count]
            if outside:
                raise ValueError(
                    f"stage {stage.name}: frame {outside[0]} is not in 0 … {self.frame_count - 1}"
                )
            return [(k, k + 1) for k in sorted(set(stage.frames))]
        return [
            (first, min(first + self.chunk_size, self.frame_count))
            for first in range(0, self.frame_count, self.chunk_size)
        ]

    def providers(self, stage: Stage, source: Stage, first: int | None) -> tuple[str, ...]:
        """Keys of the nodes of `source` that provide an input from frame `first` on."""
        ids = self.ids[source.name]
        if stage.pattern == "once" or source.pattern == "once":
            return ids
        if source.pattern in CHUNKED:
            return (ids[first // self.chunk_size],)
        for node in ids:
            if stage.pattern == "pick" and self.nodes[node].first == first:
                return (node,)
        raise ValueError(f"stage {stage.name} needs frame {first} of {source.name}, which lacks it")


def _in_order(stages: Sequence[Stage]) -> dict[str, Stage]:
    """Check the stages, and order each after its inputs; by name."""
    by_name: dict[str, Stage] = {}
    for stage in stages:
        stage.check()
        if stage.name in by_name:
            raise ValueError(f"two stages have the name {stage.name}")
        by_name[stage.name] = stage
    for stage in stages:
        for source in stage.inputs.values():
            if source not in by_name:
                raise ValueError(f"stage {stage.name} has the unknown input {source}")
    ordered: dict[str, Stage] = {}
    # Keep the given order where the inputs allow it.
    while left := [stage for stage in stages if stage.name not in ordered]:
        ready = next((one for one in left if ordered.keys() >= set(one.inputs.values())), None)
        if ready is None:
            names = ", ".join(stage.name for stage in left)
            raise ValueError(f"stages depend on each other: {names}")
        ordered[ready.name] = ready
    return ordered
