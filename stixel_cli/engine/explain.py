"""Why a node would run: what differs from the nearest result of its stage that is in the cache."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from stixel_cli.engine.code import Code
from stixel_cli.engine.graph import Graph, Node
from stixel_cli.engine.plan import plan
from stixel_cli.engine.removal import evicted
from stixel_cli.engine.setting_differences import differences, plain
from stixel_cli.engine.sources import source_difference
from stixel_cli.engine.store import Store
from stixel_cli.engine.upkeep import stored_notes

Kind = Literal[
    "new", "evicted", "damaged", "needed", "setting", "seed", "file", "code", "version", "input"
]

WORDS = {"size": "for space", "age": "for age", "cleared": "by stixel cache clear"}


@dataclass(frozen=True)
class Change:
    """One reason for a node to run.

    Attributes:
        kind: `new` (nothing of the stage is stored), `evicted` or `damaged` (it was stored once),
            `needed` (nothing changed, but what it gives is to be loaded and is not there),
            or what differs: a `setting`, the `seed`, a `file`, the `code`, a `version` or an
            `input`.
        what: `tracker.sigma_f`; a module; a distribution; the input's stage.
        before, after: of the nearest stored result, and now; "" where there is none, as for a
            setting that is read now and was not, or the other way round.
        difference: of changed code, lines of the unified difference; () where the source of the
            nearest stored result is not known.
    """

    kind: Kind
    what: str
    before: str = ""
    after: str = ""
    difference: tuple[str, ...] = ()

    def __str__(self) -> str:
        match self.kind:
            case "new":
                return f"new: no result of {self.what} is stored"
            case "evicted":
                return f"removed from the cache {self.before}"
            case "damaged":
                return "its stored result was damaged and set aside"
            case "needed":
                return "its result is not stored"
            case "code" if self.before == "changed":
                return f"code: {self.what} changed"
            case "code":
                return f"code: {self.what} is {self.before}"
            case "input":
                return f"input changed: {self.what}"
            case "file":
                return f"the content of {self.what} changed"
            case "setting" if not self.before:
                return f"{self.what} is read now"
            case "setting" if not self.after:
                return f"{self.what} is no longer read"
            case _:
                return f"{self.what} changed from {self.before} to {self.after}"


@dataclass(frozen=True)
class Explanation:
    """Why one node would run.

    Attributes:
        key, stage, label: of the node.
        changes: the reasons; what is the input's own doing is told there, see `roots`.
        roots: what changed in the stages before it, where that stage itself would not run:
            its result with the other setting is stored already.
    """

    key: str
    stage: str
    label: str
    changes: tuple[Change, ...]
    roots: tuple[Change, ...] = ()

    def __str__(self) -> str:
        return f"{self.label}: " + "; ".join(map(str, (*self.changes, *self.roots)))


def explain(graph: Graph, store: Store, targets: Sequence[str] | None = None) -> list[Explanation]:
    """Why each node would run that `targets` (of all stages, where None) need, in their order.

    Raises:
        KeyError: no such target.
        CacheError: the store cannot be read.
    """
    wanted = list(graph.nodes) if targets is None else targets
    missing = plan(graph, wanted, store, verify=False).missing
    if not missing:
        return []
    nodes = [graph.nodes[key] for key in missing]
    memory = _Memory(store, {node.stage.name for node in graph.nodes.values()})
    return [_explain(graph, node, memory) for node in nodes]


def by_stage(explanations: Iterable[Explanation]) -> list[tuple[list[Explanation], str]]:
    """Explanations that say the same of a stage's nodes put together, with what they say."""
    groups: dict[tuple[str, str], list[Explanation]] = {}
    for one in explanations:
        text = "; ".join(map(str, (*one.changes, *one.roots)))
        groups.setdefault((one.stage, text), []).append(one)
    return [(group, text) for (_, text), group in groups.items()]


class _Memory:
    """The notes of what is stored, what was removed, and the sources of the code."""

    def __init__(self, store: Store, stages: set[str]):
        self.by_key: dict[str, dict[str, Any]] = {}
        self.by_stage: dict[str, list[dict[str, Any]]] = {}
        for notes in stored_notes(store, stages):
            self.by_key[notes["key"]] = notes
            self.by_stage.setdefault(notes["stage"], []).append(notes)
        self.evicted = evicted(store)
        self.folder = store.folder
        self.differences: dict[tuple[str, str], tuple[str, ...]] = {}

    def source_difference(self, before: str, now: Path) -> tuple[str, ...]:
        known = (before, str(now))
        if known not in self.differences:
            self.differences[known] = source_difference(self.folder, before, now)
        return self.differences[known]


def _explain(graph: Graph, node: Node, memory: _Memory) -> Explanation:
    name = node.stage.name
    known = memory.by_stage.get(name, [])
    if node.key in memory.evicted:
        reason, _ = memory.evicted[node.key]
        kind = "damaged" if reason == "damaged" else "evicted"
        change = Change(kind, name, WORDS.get(reason, reason))
        return Explanation(node.key, name, node.label, (change,))
    if not known:
        return Explanation(node.key, name, node.label, (Change("new", name),))
    nearest = min(known, key=lambda notes: _distance(node, notes))
    changes = _identity_changes(node, nearest, memory)
    roots = _roots(graph, node, nearest, memory, set())
    if nearest.get("frames") == _frames(node):
        changes += _input_changes(graph, node, nearest) or ([] if changes else [NEEDED])
    elif not changes:
        # Other frames have other inputs: what is new are the frames.
        changes = _input_changes(graph, node, nearest) if roots else [Change("new", node.label)]
    return Explanation(node.key, name, node.label, tuple(changes), tuple(dict.fromkeys(roots)))


NEEDED = Change("needed", "")


def _frames(node: Node) -> list[int | None] | None:
    return None if node.first is None else [node.first, node.stop]


def _distance(node: Node, notes: Mapping[str, Any]) -> tuple:
    """The less, the nearer: the same function, the same frames, few differences, lately stored."""
    content = node.identity.content
    differing = len(differences(notes.get("settings"), content["settings"]))
    differing += sum(notes.get(one) != content[one] for one in ("code", "python", "seed", "files"))
    differing += notes.get("versions") != content["versions"]
    inputs = {name: list(keys) for name, keys in node.inputs.items()}
    stored = notes.get("inputs", {})
    differing += sum(stored.get(name) != keys for name, keys in inputs.items())
    return (
        notes.get("function") != content["function"],
        notes.get("frames") != _frames(node),
        differing,
        -float(notes.get("created", 0.0)),
    )


def _identity_changes(node: Node, notes: Mapping[str, Any], memory: _Memory) -> list[Change]:
    """What differs in the stage itself."""
    content = node.identity.content
    changes = [
        Change("setting", _key(node, path), before, after)
        for path, before, after in differences(notes.get("settings"), content["settings"])
    ]
    if notes.get("function") != content["function"]:
        # What the other function reads or does not read follows from that.
        changes = [one for one in changes if one.before and one.after]
        changes.append(
            Change("setting", "its function", str(notes.get("function")), content["function"])
        )
    elif notes.get("code") != content["code"]:
        changes += _code_changes(notes.get("modules", {}), node.identity.code, memory)
    if notes.get("seed") != content["seed"]:
        changes.append(Change("seed", "seed", plain(notes.get("seed")), plain(content["seed"])))
    if notes.get("files") != content["files"]:
        named = ", ".join(str(path) for path in node.stage.files) or "a file"
        changes.append(Change("file", named))
    before, after = notes.get("versions", {}), content["versions"]
    # A distribution that only one of the two imports follows from their code.
    pairs = {name: (before[name], after[name]) for name in sorted(before.keys() & after.keys())}
    pairs = {"Python": (notes.get("python"), content["python"]), **pairs}
    changes += [
        Change("version", name, old or "not installed", new or "not installed")
        for name, (old, new) in pairs.items()
        if old != new
    ]
    if notes.get("layout") != content["layout"]:
        changes.append(
            Change(
                "version", "the cache's layout", str(notes.get("layout")), str(content["layout"])
            )
        )
    return changes


def _key(node: Node, path: str) -> str:
    """A setting as the user knows it, for its dotted path from the stage's argument on."""
    argument, dot, rest = path.partition(".")
    return f"{node.stage.keys.get(argument, argument)}{dot}{rest}"


def _code_changes(before: Mapping[str, str], code: Code, memory: _Memory) -> list[Change]:
    changed = [name for name in code.modules if name in before]
    changes = [
        Change(
            "code",
            name,
            "changed",
            difference=memory.source_difference(before[name], code.files[name][0]),
        )
        for name in changed
        if before[name] != code.modules[name]
    ]
    # Which modules are reached follows from what changed; it is a reason only where nothing did.
    return changes or [
        Change("code", name, "reached now" if name in code.modules else "no longer reached")
        for name in sorted(before.keys() ^ code.modules.keys())
    ]


def _input_changes(graph: Graph, node: Node, notes: Mapping[str, Any]) -> list[Change]:
    stored = notes.get("inputs", {})
    names = [
        graph.nodes[keys[0]].stage.name
        for name, keys in node.inputs.items()
        if keys and stored.get(name) != list(keys)
    ]
    if node.previous != notes.get("previous") and not names:
        names.append(f"{node.stage.name} of the frames before")
    return [Change("input", name) for name in dict.fromkeys(names)]


def _roots(
    graph: Graph, node: Node, notes: Mapping[str, Any], memory: _Memory, seen: set[str]
) -> list[Change]:
    """What differs between the inputs then and now, where the inputs are stored now."""
    found: list[Change] = []
    stored = notes.get("inputs", {})
    for name, keys in node.inputs.items():
        for key, old in zip(keys[:1], stored.get(name, [])[:1], strict=False):
            if key == old or key in seen:
                continue
            seen.add(key)
            # What would run has an explanation of its own.
            if key in memory.by_key and old in memory.by_key:
                giver = graph.nodes[key]
                found += _identity_changes(giver, memory.by_key[old], memory)
                found += _roots(graph, giver, memory.by_key[old], memory, seen)
    return found
