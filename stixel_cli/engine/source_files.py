"""What a source file means for a key: the digest of its syntax tree, and its imports.

Parsing all files of a graph takes longer than the rest of a cached run, so the digests are kept in
the store. They are found by the hash of a file's content: neither its name nor its time matters.
Copies of the sources are kept as well, to show later what has changed.
"""

import ast
import difflib
import json
import os
import shutil
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from stixel_cli.engine.store import read_file

SOURCES = "sources"
"""Folder in the store."""

UNUSED = 90 * 86400.0
"""Seconds after the last use when a file of this folder is removed."""

MOST_DIGESTS = 2000
"""Number of digests that are kept; those of unused contents are dropped first."""

LARGEST_FILE = 16_000_000
"""A larger file of digests, in bytes, is not read."""

DIGITS = 32
"""Number of hex digits of a module's digest."""


@dataclass(frozen=True)
class Source:
    """The meaning of a source file.

    Attributes:
        digest: of its syntax tree without comments, layout and docstrings.
        is_empty: whether it has no statement.
        imports: (level, module, name) of each import; the level of a relative import, 0 for an
            absolute one; the name is None for `import module`.
    """

    digest: str
    is_empty: bool
    imports: list[tuple[int, str, str | None]]


_digests: dict[str, list] = {}
"""Fields of `Source` by SHA-256 of the file's content; the most recently used are last."""

_unsaved: set[str] = set()
"""Keys of `_digests` that no file has."""


def parse(path: Path, content: bytes) -> Source:
    """Return the meaning of the source file `path` with this content.

    Raises:
        LookupError: it is not valid Python.
    """
    key = sha256(content).hexdigest()
    fields = _digests.pop(key, None)
    if fields is None:
        try:
            tree = ast.parse(content, filename=str(path))
        except (SyntaxError, ValueError) as error:
            line = f", line {error.lineno}" if isinstance(error, SyntaxError) else ""
            raise LookupError(f"{path}{line}: not valid Python: {error.args[0]}") from error
        text, imports = _normalised(tree)
        text = text.encode("utf-8", "surrogatepass")
        fields = [sha256(text).hexdigest()[:DIGITS], not tree.body, imports]
        _unsaved.add(key)
    _digests[key] = fields
    return Source(*fields)


def _imports(node: ast.Import | ast.ImportFrom) -> Iterator[tuple[int, str, str | None]]:
    for alias in node.names:
        if isinstance(node, ast.ImportFrom):
            yield node.level, node.module or "", alias.name
            continue
        yield 0, alias.name, None
        if alias.asname is None and "." in alias.name:
            # `import a.b` binds the package a.
            yield 0, alias.name.partition(".")[0], None


def _normalised(tree: ast.Module) -> tuple[str, list[tuple[int, str, str | None]]]:
    """The tree as text, without layout, comments and docstrings; its imports. Changes `tree`."""
    imports = {}
    pending: list[ast.AST] = [tree]
    # Statements hold the imports and the docstrings; no expression holds a statement.
    for node in pending:
        if isinstance(node, ast.Import | ast.ImportFrom):
            imports |= dict.fromkeys(_imports(node))
        for name in node._fields:
            value = getattr(node, name, None)
            if not isinstance(value, list):
                continue
            if name == "body":
                value[:] = [one for one in value if not _is_bare_string(one)]
            pending += [one for one in value if isinstance(one, _HOLDERS)]
    return ast.dump(tree, annotate_fields=False), list(imports)


_HOLDERS = (ast.stmt, ast.ExceptHandler, ast.match_case)


def _is_bare_string(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


@cache
def _digests_file() -> str:
    """Name of the file of digests. This module and Python determine what is in it."""
    made_by = sys.version.encode() + Path(__file__).read_bytes()
    return f"digests-{sha256(made_by).hexdigest()[:16]}.json"


def load_digests(store_folder: Path) -> None:
    """Read the digests that the store keeps. A file that is missing or damaged has no effect."""
    for key, fields in _stored_digests(store_folder).items():
        _digests.setdefault(key, fields)
        _unsaved.discard(key)


def _stored_digests(store_folder: Path) -> dict[str, list]:
    with suppress(OSError, ValueError):
        path = store_folder / SOURCES / _digests_file()
        if path.stat().st_size <= LARGEST_FILE:
            check, _, content = read_file(path).partition(b"\n")
            if check == sha256(content).hexdigest().encode():
                return json.loads(content)
    return {}


def save_digests(store_folder: Path) -> None:
    """Write the digests of this process to the store, if they are new and if this is possible."""
    with suppress(OSError):
        path = store_folder / SOURCES / _digests_file()
        if not _unsaved and path.exists():
            os.utime(path)
            return
        others = _stored_digests(store_folder)
        known = {key: others[key] for key in others if key not in _digests} | _digests
        newest = dict(list(known.items())[-MOST_DIGESTS:])
        content = json.dumps(newest, separators=(",", ":")).encode()
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f"digests-{os.getpid()}-{time.monotonic_ns():x}.part")
        partial.write_bytes(sha256(content).hexdigest().encode() + b"\n" + content)
        partial.replace(path)
        _unsaved.clear()


def keep_sources(store_folder: Path, files: Iterable[tuple[str, Path]]) -> None:
    """Copy source files to the store, each named by the digest of its tree, if possible."""
    folder = store_folder / SOURCES
    for digest, path in dict(files).items():
        kept = folder / f"{digest}.py"
        with suppress(OSError):
            if kept.exists():
                os.utime(kept)
            elif path.suffix == ".py":
                folder.mkdir(parents=True, exist_ok=True)
                partial = folder / f"{digest}-{os.getpid()}.part"
                shutil.copyfile(path, partial)
                partial.replace(kept)


def kept_source(store_folder: Path, digest: str) -> list[str] | None:
    """Lines of the source of a module with this digest; None if the store has no copy of it."""
    if len(digest) != DIGITS or not set(digest) <= set("0123456789abcdef"):
        # A digest of a result folder names a file of the store.
        return None
    try:
        return (store_folder / SOURCES / f"{digest}.py").read_text("utf-8").splitlines()
    except (OSError, ValueError):
        return None


def source_difference(store_folder: Path, before: str, now: Path) -> tuple[str, ...]:
    """Lines of the unified diff between the old source of a module and its file now.

    `before` is the digest of the old module. Without a copy of the old source there are no lines.
    """
    old = kept_source(store_folder, before)
    try:
        new = now.read_text("utf-8").splitlines()
    except (OSError, ValueError):
        return ()
    if old is None:
        return ()
    return tuple(difflib.unified_diff(old, new, "before", "now", lineterm="", n=1))


def remove_sources(store_folder: Path, everything: bool) -> None:
    """Remove all copies and digests, or those that were not used for `UNUSED` seconds."""
    folder = store_folder / SOURCES
    if everything:
        shutil.rmtree(folder, ignore_errors=True)
        return
    with suppress(OSError):
        for path in folder.iterdir():
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > UNUSED:
                    path.unlink()
