"""The lineage of a run: keys, settings, versions, code and digests of every stage.

It explains later why a rerun differs.
"""

import json
from collections.abc import Iterable, Mapping, MutableMapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.graph import Graph
from stixel_cli.engine.keys import digest
from stixel_cli.engine.store import Store
from stixel_cli.errors import UserError
from stixel_cli.files import read_json

FILE = "lineage.json"
CODE_FOLDER = "code"
"""Folder with copies of the user's modules. In that of a sweep: the code part of its runs'
lineages, one file for equal parts, each with a folder of the copies."""

_KEY_DIGITS = 64
_CODE_DIGITS = 16


@dataclass(frozen=True)
class StageLineage:
    """One stage of a run.

    Attributes:
        settings: digest of its settings, seed, frames and the content of its files.
        versions: version of Python and of each package that it reaches.
        keys: of its nodes, in the order of their frames.
        digests: of the stored result of each key; None for an evicted one.
        files: path of each user file that it reads -> digest of its content; None in a folder of
            an older version.
    """

    settings: str
    versions: Mapping[str, str | None]
    keys: tuple[str, ...]
    digests: tuple[str | None, ...]
    files: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Lineage:
    """All stages of a run in the order of the data.

    Attributes:
        stages: by name.
        code: module -> digest, by name, of all code that the stages reach; None if unknown: in a
            folder of an older version, or for a run that was moved out of its sweep.
        sources: module -> file and digest of its bytes, of the user's modules; of a new run only.
    """

    stages: Mapping[str, StageLineage]
    code: Mapping[str, str] | None
    sources: Mapping[str, tuple[Path, str]] = field(default_factory=dict)


def lineage_of(
    graph: Graph,
    keys: Iterable[str],
    store: Store | None,
    known: MutableMapping[str, str] | None = None,
) -> Lineage:
    """The lineage of the nodes `keys` of a graph; all of them are computed or in `store`.

    Args:
        graph: of one experiment.
        keys: of its nodes.
        store: None to leave out the digests of stored results.
        known: digests by key, so that shared nodes are looked up once.

    Raises:
        CacheError: the store cannot be read.
    """
    wanted = set(keys)
    known = {} if known is None else known
    stages, code, sources = {}, {}, {}
    for name in graph.stages:
        nodes = [node for node in graph.of_stage(name) if node.key in wanted]
        if not nodes:
            continue
        content, reached = nodes[0].identity.content, nodes[0].identity.code
        stages[name] = StageLineage(
            settings=settings_digest(content),
            versions={"python": content["python"], **content["versions"]},
            keys=tuple(node.key for node in nodes),
            digests=tuple(_stored_digest(node.key, store, known) for node in nodes),
            files=dict(zip(map(str, nodes[0].stage.files), content["files"], strict=True)),
        )
        code |= reached.modules
        sources |= {name: reached.files[name] for name in reached.of_user}
    return Lineage(stages, dict(sorted(code.items())), sources)


def settings_digest(content: Mapping[str, Any], files: Iterable[str] | None = None) -> str:
    """Digest of a stage's settings, from the content of its identity.

    `files` are the digests of its files; None for their current ones.
    """
    names = ("function", "pattern", "settings", "seed", "files")
    given = {name: content[name] for name in names}
    return digest(given if files is None else given | {"files": list(files)})[:16]


def _stored_digest(key: str, store: Store | None, known: MutableMapping[str, str]) -> str | None:
    if key in known or store is None:
        return known.get(key)
    try:
        if store.has(key):
            known[key] = str(store.meta(key)["digest"])[:16]
    except (MissingEntry, KeyError):
        return None
    return known.get(key)


def lineage_tree(lineage: Lineage, code: str | None = None) -> dict[str, Any]:
    """The lineage as JSON, for the file of a result folder.

    That of a sweep's run has the name of its `code` file instead of the digests.
    """
    stages = {name: vars(stage) for name, stage in lineage.stages.items()}
    return {"stages": stages, "code": (lineage.code or {}) if code is None else code}


def shared_code(lineage: Lineage) -> tuple[str, str]:
    """The name and the text of the sweep's file with the code part of a lineage."""
    text = compact_json(lineage.code or {})
    return digest(text)[:_CODE_DIGITS], text


def compact_json(tree: Any) -> str:
    """JSON on one line."""
    return json.dumps(tree, separators=(",", ":"), ensure_ascii=False) + "\n"


def read_lineage(folder: Path) -> Lineage | None:
    """Read the lineage of a result folder; None if it is missing, as in older folders.

    The code part of a sweep's run is in the sweep's folder.

    Raises:
        UserError: if the file is not valid.
    """
    file = folder / FILE
    if not file.exists():
        return None
    tree = read_json(file)
    try:
        stages = {name: _read_stage(stage) for name, stage in tree["stages"].items()}
        code = tree["code"]
        if isinstance(code, str):
            file = _code_file(folder, code)
            code = read_json(file) if file.exists() else None
        # An older version has digests of functions.
        known = code is not None and all(isinstance(digest, str) for digest in code.values())
    except (KeyError, TypeError, AttributeError, ValueError):
        raise UserError(f"{file}: not a valid lineage of a run") from None
    return Lineage(stages, dict(code) if known else None)


def read_code_name(folder: Path) -> str | None:
    """The name of the code file that the lineage of a sweep's run refers to; None if missing."""
    try:
        name = read_json(folder / FILE).get("code")
    except UserError:
        return None
    return name if isinstance(name, str) else None


def _code_file(folder: Path, code: str) -> Path:
    if len(code) != _CODE_DIGITS or not set(code) <= set("0123456789abcdef"):
        raise ValueError("no name of a file of code")
    return folder.resolve().parent.parent / CODE_FOLDER / f"{code}.json"


def _read_stage(stage: Mapping[str, Any]) -> StageLineage:
    keys = tuple(stage["keys"])
    # A key names a file of the cache, so its form is checked.
    if not all(len(key) == _KEY_DIGITS and set(key) <= set("0123456789abcdef") for key in keys):
        raise ValueError("no keys")
    digests = tuple(stage["digests"])
    if len(digests) != len(keys):
        raise ValueError("as many digests as keys are needed")
    files = stage.get("files")
    return StageLineage(
        settings=str(stage["settings"]),
        versions=_texts(stage["versions"]),
        keys=keys,
        digests=tuple(None if one is None else str(one) for one in digests),
        files=None if files is None else _texts(files),
    )


def _texts(content: Mapping[str, Any]) -> dict[str, Any]:
    return {name: None if value is None else str(value) for name, value in content.items()}
