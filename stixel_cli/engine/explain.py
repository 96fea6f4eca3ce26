"""Explain why a node would be computed: what differs from the most similar result in the store."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from stixel_cli.engine.entries import stored_notes
from stixel_cli.engine.graph import Graph, Node
from stixel_cli.engine.keys import differences, plain
from stixel_cli.engine.plan import plan
from stixel_cli.engine.store import Store

Kind = Literal["new", "evicted", "needed", "setting", "seed", "file", "code", "version", "input"]

MOST_NAMED = 4
"""Files of a stage that a cause names one by one."""


@dataclass(frozen=True)
class Change:
    """One reason to compute a node."""

    kind: Kind
    """`new` (no result of the stage is stored), `evicted` (the result before is no longer stored),
    `needed` (nothing changed, but the result is not stored), or what differs from the most similar
    stored result: a `setting`, the `seed`, a `file`, the `code`, a `version` or an `input`."""
    what: str
    """Key of the setting, module, distribution, or stage of the input."""
    before: str = ""
    after: str = ""
    """`before`, `after`: value in the most similar stored result, and now; "" for a setting that is
    read in only one of the two."""

    def __str__(self) -> str:
        what, read = self.what, "no longer read" if self.before else "read now"
        texts = {
            "new": f"new: no result of {what} is stored",
            "evicted": "removed from the cache",
            "needed": "its result is not stored",
            "code": f"code: {what} {'' if self.before == 'changed' else 'is '}{self.before}",
            "input": f"input changed: {what}",
            "file": f"the content of {what} changed",
        }
        if self.kind == "setting" and not (self.before and self.after):
            return f"{what} is {read}"
        return texts.get(self.kind, f"{what} changed from {self.before} to {self.after}")


@dataclass(frozen=True)
class Explanation:
    """Reasons to compute one node."""

    key: str
    stage: str
    label: str
    """`key`, `stage`, `label`: of the node."""
    changes: tuple[Change, ...]
    """The reasons: changes in the node itself, then changes in stages before it that need not be
    computed, since their results with the new settings are stored."""

    @property
    def text(self) -> str:
        """The reasons in one line."""
        return "; ".join(map(str, self.changes))


def explain(
    graph: Graph,
    store: Store,
    targets: Sequence[str] | None = None,
    before: tuple[Collection[str], Mapping[str, str]] = ((), {}),
) -> list[Explanation]:
    """Explain why each node that `targets` (None for all stages) need would be computed.

    A node is compared with one of the results `before`, given as their keys and the digests of all
    their modules; if the store has none of its stage, with the most similar one and these modules.
    KeyError if there is no such target, CacheError if the store cannot be read.
    """
    wanted = list(graph.nodes) if targets is None else targets
    nodes = [graph.nodes[key] for key in plan(graph, wanted, store, verify=False).missing]
    if not nodes:
        return []
    memory = _Memory(store, set(graph.stages), before)
    return [
        Explanation(n.key, n.stage.name, n.label, tuple(dict.fromkeys(_changes(graph, n, memory))))
        for n in nodes
    ]


def by_stage(explanations: Iterable[Explanation]) -> list[tuple[list[Explanation], str]]:
    """Group the explanations of a stage that have the same text, with that text."""
    groups: dict[tuple[str, str], list[Explanation]] = {}
    for one in explanations:
        groups.setdefault((one.stage, one.text), []).append(one)
    return [(group, text) for (_, text), group in groups.items()]


class _Memory:
    """Notes of stored entries; keys and modules of the results before."""

    def __init__(self, store: Store, stages: set[str], before: tuple[Any, Mapping[str, str]]):
        self.keys, self.modules = before
        self.by_key: dict[str, dict[str, Any]] = {}
        self.by_stage: dict[str, list[dict[str, Any]]] = {}
        for notes in stored_notes(store, stages, self.keys):
            self.by_key[notes["key"]] = notes
            self.by_stage.setdefault(notes["stage"], []).append(notes)


def _changes(graph: Graph, node: Node, memory: _Memory) -> list[Change]:
    name = node.stage.name
    known = memory.by_stage.get(name, [])
    if not known:
        return [Change("new", name)]
    if node.key in memory.keys:
        return [Change("evicted", name)]
    own = [notes for notes in known if notes["key"] in memory.keys]
    nearest = min(own or known, key=lambda notes: _distance(node, notes))
    if memory.modules and not own:
        reached = {*nearest.get("modules", {}), *node.identity.code.modules}
        modules = {one: memory.modules[one] for one in reached & memory.modules.keys()}
        nearest = nearest | {"code": "", "modules": modules}
    changes = _identity_changes(node, nearest)
    roots = _roots(graph, node, nearest, memory, set())
    if nearest.get("frames") == node.frames:
        changes += _input_changes(graph, node, nearest)
        changes = changes or [Change("needed", name)]
    elif not changes:
        # Other frames have other inputs: the frames are new.
        changes = _input_changes(graph, node, nearest) if roots else [Change("new", node.label)]
    return changes + roots


def _distance(node: Node, notes: Mapping[str, Any]) -> tuple:
    """Sort key of similarity: same function, same frames, few differences, stored recently."""
    content = node.identity.content
    differing = len(differences(notes.get("settings"), content["settings"]))
    differing += sum(notes.get(one) != content[one] for one in ("code", "python", "seed", "files"))
    differing += notes.get("versions") != content["versions"]
    stored = notes.get("inputs", {})
    differing += sum(stored.get(name) != list(keys) for name, keys in node.inputs.items())
    others = notes.get("function") != content["function"], notes.get("frames") != node.frames
    return (*others, differing, -float(notes.get("created", 0.0)))


def _identity_changes(node: Node, notes: Mapping[str, Any]) -> list[Change]:
    """Changes in the stage itself."""
    content, changes = node.identity.content, []
    for path, before, after in differences(notes.get("settings"), content["settings"]):
        # The path begins with the stage's argument, not with the configuration's key.
        argument, dot, rest = path.partition(".")
        key = f"{node.stage.keys.get(argument, argument)}{dot}{rest}"
        changes.append(Change("setting", key, before, after))
    if notes.get("function") != content["function"]:
        # What the other function reads or does not read follows from that.
        changes = [one for one in changes if one.before and one.after]
        before = str(notes.get("function"))
        changes.append(Change("setting", "its function", before, content["function"]))
    elif notes.get("code") != content["code"] and notes.get("python") == content["python"]:
        # Another Python has another syntax tree, and so another digest, of the same code.
        changes += _code_changes(notes.get("modules", {}), node.identity.code.modules)
    if notes.get("seed") != content["seed"]:
        changes.append(Change("seed", "seed", plain(notes.get("seed")), plain(content["seed"])))
    if notes.get("files") != content["files"]:
        changes.append(Change("file", _named(node.stage.files)))
    before, after = notes.get("versions", {}), content["versions"]
    # That only one of the two imports a distribution follows from their code.
    pairs = {
        "Python": (notes.get("python"), content["python"]),
        **{name: (before[name], after[name]) for name in sorted(before.keys() & after.keys())},
        "the cache's layout": (notes.get("layout"), content["layout"]),
    }
    return changes + [
        Change("version", name, str(old or "not installed"), str(new or "not installed"))
        for name, (old, new) in pairs.items()
        if old != new
    ]


def _named(files: tuple[Path, ...]) -> str:
    if len(files) > MOST_NAMED:
        return f"one of {len(files)} files, {files[0]} to {files[-1]}"
    return ", ".join(map(str, files)) or "a file"


def _code_changes(before: Mapping[str, str], after: Mapping[str, str]) -> list[Change]:
    changed = [name for name, digest in after.items() if before.get(name, digest) != digest]
    # Which modules are reached follows from the edits. It is a reason only without edits.
    return [Change("code", name, "changed") for name in changed] or [
        Change("code", name, "reached now" if name in after else "no longer reached")
        for name in sorted(before.keys() ^ after.keys())
    ]


def _input_changes(graph: Graph, node: Node, notes: Mapping[str, Any]) -> list[Change]:
    stored = notes.get("inputs", {})
    names = [
        graph.nodes[keys[0]].stage.name
        for name, keys in node.inputs.items()
        if keys and stored.get(name) != list(keys)
    ]
    if node.previous != notes.get("previous") and not names:
        names.append(f"{node.stage.name} of the previous frames")
    return [Change("input", name) for name in dict.fromkeys(names)]


def _roots(
    graph: Graph, node: Node, notes: Mapping[str, Any], memory: _Memory, seen: set[str]
) -> list[Change]:
    """Changes in inputs whose results are stored, then and now."""
    found: list[Change] = []
    stored = notes.get("inputs", {})
    for name, keys in node.inputs.items():
        for key, old in zip(keys[:1], stored.get(name, [])[:1], strict=False):
            if key == old or key in seen:
                continue
            seen.add(key)
            # A node that would be computed has its own explanation.
            if key in memory.by_key and old in memory.by_key:
                provider = graph.nodes[key]
                found += _identity_changes(provider, memory.by_key[old])
                found += _roots(graph, provider, memory.by_key[old], memory, seen)
    return found
