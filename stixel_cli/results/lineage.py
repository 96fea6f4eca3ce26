"""The lineage of a run: keys, settings, versions, code and digests of every stage.

It explains later why a rerun differs, together with the provenance: revision, packages, machine.
"""

import json
import os
import platform
import re
import subprocess
from collections.abc import Container, Iterable, Mapping, MutableMapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

from pydantic import StringConstraints, TypeAdapter

from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.graph import Graph
from stixel_cli.engine.keys import digest
from stixel_cli.engine.store import Store
from stixel_cli.engine.versions import installed_version
from stixel_cli.errors import UserError
from stixel_cli.files import read_json
from stixel_cli.version import __version__

FILE = "lineage.json"
PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "opencv-python-headless",
    "open3d-cpu",
    "open3d",
    "shapely",
    "matplotlib",
    "joblib",
    "hydra-core",
)

LARGEST_DIFFERENCE = 1_000_000
"""A larger difference of a repository of the user, in characters, is left out."""

CODE_FOLDER = "code"
"""Folder with copies of the user's modules. In that of a sweep: the code part of its runs'
lineages, one file for equal parts, each with a folder of the copies."""

# They name files, so their form is checked.
_Key = Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")]
_CodeName = Annotated[str, StringConstraints(pattern="^[0-9a-f]{16}$")]


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
    keys: tuple[_Key, ...]
    digests: tuple[str | None, ...]
    files: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Lineage:
    """All stages of a run in the order of the data.

    Attributes:
        stages: by name.
        code: module -> digest, by name, of all code that the stages reach; None if unknown: in a
            folder of an older version, or for a run that was moved out of its sweep.
        sources: of the user's modules, module -> file and SHA-256 of its bytes when the run was
            planned; of a new run only.
    """

    stages: Mapping[str, StageLineage]
    code: Mapping[str, str] | None
    sources: Mapping[str, tuple[Path, str]] = field(default_factory=dict)


def lineage_of(
    graph: Graph,
    keys: Container[str],
    store: Store | None,
    known: MutableMapping[str, str] | None = None,
) -> Lineage:
    """The lineage of the nodes `keys` of an experiment's graph, which are all computed.

    Args:
        graph: of the experiment.
        keys: of its nodes.
        store: that has their results; None to leave out the digests of these.
        known: digests by key, so that shared nodes are looked up once.

    Raises:
        CacheError: the store cannot be read.
    """
    known = {} if known is None else known
    stages, code, sources = {}, {}, {}
    for name in graph.stages:
        nodes = [node for node in graph.of_stage(name) if node.key in keys]
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


def compact_json(tree: Any) -> str:
    """JSON on one line."""
    return json.dumps(tree, separators=(",", ":"), ensure_ascii=False) + "\n"


def read_lineage(folder: Path) -> Lineage | None:
    """The lineage of a result folder; None if it is missing, as in older folders.

    The code part of a sweep's run is in the sweep's folder. UserError if a file is not valid.
    """
    file = folder / FILE
    if not file.exists():
        return None
    tree = read_json(file)
    try:
        stages = TypeAdapter(dict[str, StageLineage]).validate_python(tree["stages"])
        if any(len(stage.keys) != len(stage.digests) for stage in stages.values()):
            raise ValueError("as many digests as keys are needed")
        code = tree["code"]
        if isinstance(code, str):
            name = TypeAdapter(_CodeName).validate_python(code)
            file = folder.resolve().parent.parent / CODE_FOLDER / f"{name}.json"
            code = read_json(file) if file.exists() else None
        # An older version has digests of functions.
        known = code is not None and all(isinstance(digest, str) for digest in code.values())
    except (KeyError, AttributeError, ValueError):
        raise UserError(f"{file}: not a valid lineage of a run") from None
    return Lineage(stages, dict(code) if known else None)


def provenance() -> dict[str, Any]:
    """Entries of a manifest: revision, package versions and machine of this process."""
    machine = {
        "system": platform.system(),
        "release": platform.release(),
        "architecture": platform.machine(),
        "processors": os.cpu_count(),
    }
    return {"git": git_state(), "versions": package_versions(), "machine": machine}


def package_versions() -> dict[str, str]:
    """Versions of stixel, Python and the installed packages that results depend on."""
    # An editable install keeps the version that the package had when it was installed.
    versions = {"stixel": __version__, "python": platform.python_version()}
    installed = {package: installed_version(package) for package in PACKAGES}
    return versions | {name: version for name, version in installed.items() if version is not None}


def git_state() -> dict[str, Any]:
    """Revision of this package's checkout, and whether it has uncommitted changes.

    Both are None if the package is not in a checkout or git is not installed.
    """
    folder, state = Path(__file__).resolve().parents[2], None
    if (folder / ".git").exists():
        state = git(folder, "status", "--porcelain=v2", "--branch", "--untracked-files=no")
    if state is None:
        return {"revision": None, "dirty": None}
    found = re.search(r"^# branch\.oid ([0-9a-f]+)$", state, re.MULTILINE)
    changes = any(not line.startswith("#") for line in state.splitlines())
    return {"revision": found[1] if found else None, "dirty": changes}


def shown_revision(git: Mapping[str, Any]) -> str | None:
    """The state of a checkout as pages show it; None without a revision."""
    changes = " with uncommitted changes" if git.get("dirty") else ""
    return f"{str(git['revision'])[:12]}{changes}" if git.get("revision") else None


def git(folder: Path, *arguments: str) -> str | None:
    """What git prints about a folder; None if it fails or is not installed."""
    try:
        answer = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True,
            encoding="utf-8",
            errors="surrogateescape",
            timeout=5,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.rstrip("\n")


def stored_sources(sources: Mapping[str, tuple[Path, str]]) -> dict[str, bytes]:
    """Contents for a result folder's folder of code, by path; `sources` as in `Lineage`."""
    found = {}
    for module, (path, planned) in sources.items():
        content = path.read_bytes() if path.is_file() else b""
        if sha256(content).hexdigest() == planned:
            name = module.replace(".", "/") + ("/__init__" if path.stem == "__init__" else "")
            found[f"{name}.py"] = content
    folders = {path.parent for path, _ in sources.values()}
    tops = sorted({git(one, "rev-parse", "--show-toplevel") for one in folders} - {None})
    return found | {f"{Path(top).name}.diff": _difference(Path(top)) for top in tops}


def _difference(repository: Path) -> bytes:
    """The revision of a repository, and the changes of tracked files, as `git apply` reads them."""
    revision = git(repository, "rev-parse", "HEAD")
    options = ("--no-ext-diff", "--no-textconv", "--no-color", "--binary")
    changes = git(repository, "diff", *options, "HEAD") or ""
    if len(changes) > LARGEST_DIFFERENCE:
        changes = f"the changes have {len(changes)} characters and are left out"
    return f"revision {revision}\n\n{changes}\n".encode(errors="surrogateescape")
