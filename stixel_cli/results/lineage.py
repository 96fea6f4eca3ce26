"""The lineage of a run: keys, settings, versions, code and digests of every stage.

It explains later why a rerun differs, together with the provenance: revision, packages, machine.
And the differences of runs: of values, of keys with their causes, and of settings.
"""

import json
import math
import os
import platform
import re
import subprocess
from collections.abc import Container, Iterable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import StringConstraints, TypeAdapter

from stixel_cli.border.files import read_json
from stixel_cli.engine.errors import MissingEntry
from stixel_cli.engine.graph import Graph, Node
from stixel_cli.engine.keys import digest
from stixel_cli.engine.store import Store
from stixel_cli.engine.versions import installed_version
from stixel_cli.errors import UserError, printable
from stixel_cli.evaluation.metric_table import NO_VALUE
from stixel_cli.results.result import RunResult, flat_settings
from stixel_cli.version import __version__

FILE = "lineage.json"
PACKAGES = (
    *("numpy", "scipy", "numba", "opencv-python-headless", "open3d-cpu", "open3d", "shapely"),
    *("matplotlib", "joblib", "hydra-core"),
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
    """One stage of a run."""

    settings: str
    """Digest of its settings, seed, frames and the content of its files."""
    versions: Mapping[str, str | None]
    """Version of Python and of each package that it reaches."""
    keys: tuple[_Key, ...]
    """Of its nodes, in the order of their frames."""
    digests: tuple[str | None, ...]
    """Of the stored result of each key; None for an evicted one."""
    files: Mapping[str, str]
    """Path of each user file that it reads -> digest of its content."""


@dataclass(frozen=True)
class Lineage:
    """All stages of a run in the order of the data."""

    stages: Mapping[str, StageLineage]
    """By name."""
    code: Mapping[str, str] | None
    """Module -> digest, by name, of all code that the stages reach; None if unknown: for a run that
    was moved out of its sweep."""
    sources: Mapping[str, tuple[Path, str]] = field(default_factory=dict)
    """Of the user's modules, module -> file and SHA-256 of its bytes when the run was planned; of a
    new run only."""


def lineage_of(
    graph: Graph, keys: Container[str], store: Store, known: MutableMapping[str, str]
) -> Lineage:
    """The lineage of the nodes `keys` of an experiment's graph, whose results are in the `store`.

    `known` gets the digests of results by key, so that shared nodes are looked up once. CacheError
    if the store cannot be read.
    """
    stages, code, sources = {}, {}, {}
    for name in graph.stages:
        nodes = [node for node in graph.of_stage(name) if node.key in keys]
        if not nodes:
            continue
        for key in (node.key for node in nodes if node.key not in known):
            with suppress(MissingEntry, KeyError):
                known[key] = str(store.meta(key)["digest"])[:16]
        content, reached = nodes[0].identity.content, nodes[0].identity.code
        stages[name] = StageLineage(
            settings=settings_digest(content),
            versions={"python": content["python"], **content["versions"]},
            keys=tuple(node.key for node in nodes),
            digests=tuple(known.get(node.key) for node in nodes),
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
        return Lineage(stages, TypeAdapter(dict[str, str] | None).validate_python(code))
    except (KeyError, ValueError):
        raise UserError(f"{file}: not a valid lineage of a run") from None


def provenance() -> dict[str, Any]:
    """Entries of a manifest: revision, package versions and machine of this process."""
    machine = {
        "system": platform.system(),
        "release": platform.release(),
        "architecture": platform.machine(),
        "processors": os.cpu_count(),
    }
    return {"git": git_state(), "versions": package_versions(), "machine": machine}


def origin(command: str) -> dict[str, Any]:
    """The `command` line that makes a folder, this time, and the `provenance`."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {"command": command, "created": now, **provenance()}


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


def first_difference(old: Any, new: Any, name: str = "") -> str | None:
    """The first difference of two values in one line, with its size; None if they are equal.

    Floats are equal if their bits are; NaN equals NaN. `name` is the name of the value.
    """
    if type(old) is not type(new):
        text = f"a {type(old).__name__} became a {type(new).__name__}"
    elif is_dataclass(old):
        parts = ({f.name: getattr(value, f.name) for f in fields(value)} for value in (old, new))
        return first_difference(*parts, name)
    elif isinstance(old, list | tuple):
        return first_difference(dict(enumerate(old)), dict(enumerate(new)), name)
    elif isinstance(old, Mapping) and old.keys() == new.keys():
        names = {key: f"{name}.{key}" if name else str(key) for key in old}
        inner = (first_difference(old[key], new[key], names[key]) for key in old)
        return next((difference for difference in inner if difference is not None), None)
    elif isinstance(old, Mapping):
        odd = next(key for key in (*old, *new) if (key in old) != (key in new))
        text = f"{odd} is in only one of the two"
    elif isinstance(old, np.ndarray):
        text = _array_difference(old, new)
    elif old == new or (isinstance(old, float) and math.isnan(old) and math.isnan(new)):
        return None
    elif isinstance(old, bytes):
        text = "other bytes"
    else:
        text = f"{printable(repr(old))} became {printable(repr(new))}"
    return f"{name}: {text}" if name and text else text


def _array_difference(old: np.ndarray, new: np.ndarray) -> str | None:
    if old.shape != new.shape:
        return f"its shape {old.shape} became {new.shape}"
    if old.dtype != new.dtype:
        return f"its type {old.dtype} became {new.dtype}"
    if old.tobytes() == new.tobytes():
        return None
    if old.dtype.kind not in "biufc":
        return "other values"
    same = (old == new) | ((old != old) & (new != new))
    if same.all():
        return "zeros of other signs or other NaNs"
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(new[~same].astype(np.complex128) - old[~same].astype(np.complex128))
    finite = apart[np.isfinite(apart)]
    most = f", by up to {finite.max():.3g}" if finite.size else ", not finite"
    return f"{np.count_nonzero(~same)} of {same.size} values differ{most}"


MOST_CAUSES = 8
ALTERED = "its settings differ from those of the run: was config.yaml altered?"


@dataclass(frozen=True)
class StageDifference:
    """The name of a stage that changed, how its key or result differs, and known causes."""

    stage: str
    what: str
    causes: tuple[str, ...]


def first_changed_stage(old: Lineage, new: Lineage, graph: Graph) -> StageDifference | None:
    """The first stage of `new` whose keys differ from those of `old`; None if all are equal.

    `graph` is the graph of `new`.
    """
    for name, stage in new.stages.items():
        before = old.stages.get(name)
        if before is None:
            return StageDifference(name, "the folder's run did not have this stage", ())
        if before.keys != stage.keys:
            node = graph.of_stage(name)[0]
            causes = tuple(_causes(before, stage, old.code, node))
            return StageDifference(name, "its keys differ", causes)
    return None


def _causes(
    before: StageLineage, after: StageLineage, code: Mapping[str, str] | None, node: Node
) -> Iterator[str]:
    """Causes why a stage with the same inputs has another key."""
    for package, version in after.versions.items():
        then = before.versions.get(package)
        if then != version:
            yield f"{package} {then or 'missing'} → {version or 'missing'}"
    for path, content in after.files.items():
        if before.files.get(path, content) != content:
            yield f"the content of {path} changed"
    # The current settings with the old content of the files.
    old, paths = before.files, [str(path) for path in node.stage.files]
    contents = [old[path] for path in paths] if set(paths) == set(old) else None
    if before.settings != settings_digest(node.identity.content, contents):
        yield ALTERED
    if code is None:
        yield "unknown code changes: the folder does not record its code"
        return
    if before.versions.get("python") != after.versions.get("python"):
        # Another Python has another syntax tree, and so another digest, of the same code.
        return
    changed = [
        f"{module} {'was edited' if module in code else 'is new'}"
        for module, digest in sorted(node.identity.code.modules.items())
        if code.get(module) != digest
    ]
    yield from changed[:MOST_CAUSES]
    if len(changed) > MOST_CAUSES:
        yield f"and {len(changed) - MOST_CAUSES} more modules"


def differing_settings(runs: Sequence[RunResult]) -> dict[str, list[str]]:
    """The settings that differ: key to the value of each run, as text."""
    flat = [flat_settings(run.settings) for run in runs]
    # The chosen option of each group whose settings have no `kind`.
    tables = [
        {g: option for g, option in run.choices.items() if f"{g}.kind" not in settings} | settings
        for run, settings in zip(runs, flat, strict=True)
    ]
    keys = list(dict.fromkeys(key for table in tables for key in table))
    groups = list(dict.fromkeys(key.partition(".")[0] for key in keys))
    keys.sort(key=lambda key: groups.index(key.partition(".")[0]))
    values = {key: [table.get(key, NO_VALUE) for table in tables] for key in keys}
    return {key: of_runs for key, of_runs in values.items() if len(set(of_runs)) > 1}


_SCENE = ("road_user", "path", "ego", "world", "rig", "source")


def warnings(runs: Sequence[RunResult]) -> list[str]:
    """Reasons why a difference of the metrics may not be one of the method."""
    found = []
    ends = [float(run.scores.times[-1]) if len(run.scores.times) else 0.0 for run in runs]
    if len(set(ends)) > 1 or len({len(run.scores.times) for run in runs}) > 1:
        shown = ", ".join(f"{end:g} s" for end in ends)
        found.append(f"The durations differ ({shown}): the metrics are over other scans.")
    groups = [g for g in _SCENE if len({str(run.settings.get(g)) for run in runs}) > 1]
    if groups:
        views = "the metrics compare other motions or views"
        found.append(f"The scenes differ ({', '.join(groups)}): {views}.")
    if len({str(run.settings.get("seed")) for run in runs}) > 1:
        found.append("The seeds differ: a difference may be that of the noise.")
    return found
