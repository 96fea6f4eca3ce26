"""What every stage of a run was made of and what it gave: what tells later why a rerun differs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stixel_cli.engine.canonical import digest
from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.graph import Graph, Node
from stixel_cli.engine.store import Store
from stixel_cli.errors import UserError
from stixel_cli.report.folder_reader import read_json

FILE = "lineage.json"
_KEY_DIGITS = 64


@dataclass(frozen=True)
class StageLineage:
    """One stage of a run.

    Attributes:
        settings: digest of what it was given: settings, seed, frames, content of files.
        versions: version of each package that matters to it, and of Python.
        keys: of its nodes, in the order of their frames.
        digests: of what is stored under each key; None where it had been evicted.
    """

    settings: str
    versions: Mapping[str, str | None]
    keys: tuple[str, ...]
    digests: tuple[str | None, ...]


@dataclass(frozen=True)
class Lineage:
    """All stages of a run in the order of the data.

    Attributes:
        stages: by name.
        code: "module:name" of all code that the stages reach -> digest of its text.
    """

    stages: Mapping[str, StageLineage]
    code: Mapping[str, str]


def lineage_of(graph: Graph, keys: Iterable[str], store: Store) -> Lineage:
    """The lineage of the nodes `keys` of a graph, all of them computed or had from `store`.

    Raises:
        CacheError: the store cannot be read.
    """
    wanted = set(keys)
    stages, code = {}, {}
    for name in graph.stage_names:
        nodes = [node for node in graph.of_stage(name) if node.key in wanted]
        if nodes:
            stages[name] = _stage_lineage(nodes, store)
            code |= nodes[0].identity.code.parts
    return Lineage(stages, code)


def _stage_lineage(nodes: list[Node], store: Store) -> StageLineage:
    content = nodes[0].identity.content
    return StageLineage(
        settings=settings_digest(content),
        versions={"python": content["python"], **content["versions"]},
        keys=tuple(node.key for node in nodes),
        digests=tuple(_stored_digest(node.key, store) for node in nodes),
    )


def settings_digest(content: Mapping[str, Any]) -> str:
    """Digest of what a stage was given, from the content of its identity."""
    names = ("function", "pattern", "settings", "seed", "files")
    return digest({name: content[name] for name in names})[:16]


def _stored_digest(key: str, store: Store) -> str | None:
    try:
        return str(store.meta(key)["digest"])[:16] if store.has(key) else None
    except (MissingEntry, KeyError):
        return None


def lineage_tree(lineage: Lineage) -> dict[str, Any]:
    """The lineage as JSON, for the file of a result folder; code by module."""
    stages = {
        name: {
            "settings": stage.settings,
            "versions": dict(stage.versions),
            "keys": list(stage.keys),
            "digests": list(stage.digests),
        }
        for name, stage in lineage.stages.items()
    }
    code: dict[str, dict[str, str]] = {}
    for part, value in sorted(lineage.code.items()):
        module, _, name = part.partition(":")
        code.setdefault(module, {})[name] = value
    return {"stages": stages, "code": code}


def read_lineage(folder: Path) -> Lineage | None:
    """The lineage that a result folder holds; None where there is none, as in older folders.

    Raises:
        UserError: if the file is not what it must be.
    """
    file = folder / FILE
    if not file.is_file():
        return None
    tree = read_json(file)
    try:
        stages = {name: _read_stage(stage) for name, stage in tree["stages"].items()}
        code = {
            f"{module}:{name}": str(value)
            for module, parts in tree["code"].items()
            for name, value in parts.items()
        }
    except (KeyError, TypeError, AttributeError, ValueError):
        raise UserError(f"{file}: not the lineage of a run") from None
    return Lineage(stages, code)


def _read_stage(stage: Mapping[str, Any]) -> StageLineage:
    keys = tuple(stage["keys"])
    # A key names a file of the cache: nothing else may pass for one.
    if not all(len(key) == _KEY_DIGITS and set(key) <= set("0123456789abcdef") for key in keys):
        raise ValueError("no keys")
    digests = tuple(stage["digests"])
    if len(digests) != len(keys):
        raise ValueError("as many digests as keys are needed")
    return StageLineage(
        settings=str(stage["settings"]),
        versions=dict(stage["versions"].items()),
        keys=keys,
        digests=digests,
    )
