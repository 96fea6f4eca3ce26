"""From stages to nodes: the units that are computed, stored and looked up by their keys."""

import pickle
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from stixel_cli.engine.code import CodeIndex
from stixel_cli.engine.keys import Identity, node_key, stage_identity
from stixel_cli.engine.stage import CHUNKED, Stage


@dataclass(frozen=True)
class Node:
    """One result: a stage on its frames.

    Attributes:
        key: of its result in the store; it is the node's id as well, so that what two experiments
            share is one node.
        stage, identity: the stage, and what all its nodes share in their keys.
        label: `render[0:10]`, `camera_pictures[12]`, `scenario`.
        first, stop: its frames are first … stop - 1; None for `once`.
        inputs: argument name -> keys of the nodes that give it.
        sequences: the arguments that arrive as a lazy sequence.
        previous: key of the fold's node before, None if there is none.
        depth: the longest way to it from a node without inputs.
    """

    key: str
    stage: Stage
    identity: Identity
    label: str
    first: int | None
    stop: int | None
    inputs: Mapping[str, tuple[str, ...]]
    sequences: frozenset[str]
    previous: str | None
    depth: int

    @property
    def id(self) -> str:
        """The same as `key`."""
        return self.key

    @property
    def sources(self) -> tuple[str, ...]:
        """Keys of all nodes that it takes something from."""
        keys = dict.fromkeys(key for keys in self.inputs.values() for key in keys)
        return tuple(keys) + ((self.previous,) if self.previous else ())


@dataclass(frozen=True)
class Graph:
    """Nodes by id, and the ids of every stage in the order of their frames.

    Stages come after the stages that they take inputs from.
    """

    nodes: dict[str, Node]
    stages: dict[str, tuple[str, ...]]

    @property
    def stage_names(self) -> list[str]:
        """Names of the stages, each after those that it takes inputs from."""
        return list(self.stages)

    def of_stage(self, name: str) -> list[Node]:
        """The nodes of a stage in the order of their frames."""
        return [self.nodes[node] for node in self.stages[name]]

    def expand(self, targets: Sequence[str]) -> list[str]:
        """Node ids of `targets`, which are ids or names of stages.

        Raises:
            KeyError: there is no such node or stage.
        """
        ids: dict[str, None] = {}
        for target in targets:
            if target in self.stages:
                ids.update(dict.fromkeys(self.stages[target]))
            elif target in self.nodes:
                ids[target] = None
            else:
                raise KeyError(f"no node or stage called {target!r}")
        return list(ids)

    def ancestors(self, targets: Sequence[str]) -> set[str]:
        """Ids of the target nodes and of all that they depend on."""
        found: set[str] = set()
        pending = list(targets)
        while pending:
            node = pending.pop()
            if node not in found:
                found.add(node)
                pending.extend(self.nodes[node].sources)
        return found


def merge(graphs: Iterable[Graph]) -> Graph:
    """One graph of all nodes; those that several graphs share are there once.

    The nodes of each graph have the same ids in it, so what belongs to one experiment is looked
    up in the graph of that experiment.
    """
    nodes: dict[str, Node] = {}
    stages: dict[str, dict[str, None]] = {}
    before: dict[str, dict[str, None]] = {}
    for graph in graphs:
        nodes.update(graph.nodes)
        for name, ids in graph.stages.items():
            stages.setdefault(name, {}).update(dict.fromkeys(ids))
            sources = before.setdefault(name, {})
            for node in ids[:1]:
                sources.update(dict.fromkeys(graph.nodes[node].stage.inputs.values()))
    try:
        order = list(TopologicalSorter(before).static_order())
    except CycleError:
        # The same names wired the other way round: the order is for show, the ids are not.
        order = list(stages)
    return Graph(nodes, {name: tuple(stages[name]) for name in order})


def build_graph(
    stages: Sequence[Stage], frame_count: int, chunk_size: int, index: CodeIndex | None = None
) -> Graph:
    """The graph of `stages` over the frames 0 … `frame_count` - 1, cut in chunks of `chunk_size`.

    Nothing of the stages is imported or computed. `index` may be shared by graphs that are built
    at one time, so that each file is read once; for many graphs, see `GraphBuilder`.

    Raises:
        ValueError: stages that contradict themselves or each other, in one line.
        LookupError, TypeError, OSError: see `stage_identity`.
    """
    return GraphBuilder(index).build(stages, frame_count, chunk_size)


class GraphBuilder:
    """Builds many graphs at one time: what they have in common is looked at once.

    Code and outside files are taken as they are at first sight; make a new one to see them later.
    """

    def __init__(self, index: CodeIndex | None = None):
        self._index = CodeIndex() if index is None else index
        self._identities: dict[bytes, Identity] = {}
        self._nodes: dict[tuple, dict[str, Node]] = {}

    def build(self, stages: Sequence[Stage], frame_count: int, chunk_size: int) -> Graph:
        """As `build_graph`."""
        if frame_count < 1 or chunk_size < 1:
            raise ValueError(f"no frames to run over: {frame_count} frames, chunks of {chunk_size}")
        one = _OneGraph(frame_count, chunk_size)
        for stage in _in_order(stages):
            identity = self._identity(stage)
            sources = {name: one.ids[name] for name in stage.inputs.values()}
            key = (
                identity.digest,
                tuple(sorted(stage.inputs.items())),
                tuple(sources.values()),
                stage.frames,
                frame_count,
                chunk_size,
            )
            if key not in self._nodes:
                self._nodes[key] = one.make(stage, identity)
            one.add(stage, self._nodes[key])
        return Graph(one.nodes, one.ids)

    def _identity(self, stage: Stage) -> Identity:
        # A pickle tells apart all that a key does, types and the last bit of floats among it.
        what = (stage.name, stage.function, stage.pattern, stage.modules, stage.seed)
        files = [str(path) for path in stage.files]
        try:
            known = pickle.dumps((what, files, dict(stage.settings)))
        except Exception:
            # It cannot be part of a key either, which is said better there.
            return stage_identity(stage, self._index)
        if known not in self._identities:
            self._identities[known] = stage_identity(stage, self._index)
        return self._identities[known]


class _OneGraph:
    """Adds one stage after the other, each after those that it takes inputs from."""

    def __init__(self, frame_count: int, chunk_size: int):
        self.nodes: dict[str, Node] = {}
        self.ids: dict[str, tuple[str, ...]] = {}
        self.added: dict[str, Stage] = {}
        self.frame_count = frame_count
        self.chunk_size = chunk_size

    def add(self, stage: Stage, nodes: dict[str, Node]) -> None:
        self.nodes.update(nodes)
        self.ids[stage.name] = tuple(nodes)
        self.added[stage.name] = stage

    def make(self, stage: Stage, identity: Identity) -> dict[str, Node]:
        """The nodes of a stage, by their keys."""
        made: dict[str, Node] = {}
        for first, stop in self.frames_of(stage):
            inputs = {
                argument: self.givers(stage, self.added[source], first)
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
                label=_label(stage, first, stop),
                first=first,
                stop=stop,
                inputs=inputs,
                sequences=frozenset(
                    argument
                    for argument, source in stage.inputs.items()
                    if stage.pattern == "once" and self.added[source].pattern != "once"
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

    def givers(self, stage: Stage, source: Stage, first: int | None) -> tuple[str, ...]:
        """Keys of the nodes of `source` that a node of `stage` from frame `first` on takes."""
        ids = self.ids[source.name]
        if stage.pattern == "once" or source.pattern == "once":
            return ids
        if source.pattern in CHUNKED:
            return (ids[first // self.chunk_size],)
        for node in ids:
            if stage.pattern == "pick" and self.nodes[node].first == first:
                return (node,)
        raise ValueError(
            f"stage {stage.name} needs frame {first} of {source.name}, which picks other frames"
        )


def _in_order(stages: Sequence[Stage]) -> list[Stage]:
    """The stages, checked, each after those that it takes inputs from."""
    by_name: dict[str, Stage] = {}
    for stage in stages:
        stage.check()
        if stage.name in by_name:
            raise ValueError(f"two stages are called {stage.name}")
        by_name[stage.name] = stage
    for stage in stages:
        for source in stage.inputs.values():
            if source not in by_name:
                raise ValueError(f"stage {stage.name} takes an input from {source}: no such stage")
    ordered: dict[str, Stage] = {}
    while len(ordered) < len(by_name):
        # As given, but for those that must wait.
        left = [stage for stage in stages if stage.name not in ordered]
        ready = [stage for stage in left if ordered.keys() >= set(stage.inputs.values())]
        if not ready:
            raise ValueError(f"stages feed each other: {', '.join(stage.name for stage in left)}")
        ordered[ready[0].name] = ready[0]
    return list(ordered.values())


def _label(stage: Stage, first: int | None, stop: int | None) -> str:
    if stage.pattern == "once":
        return stage.name
    return f"{stage.name}[{first}]" if stage.pattern == "pick" else f"{stage.name}[{first}:{stop}]"
