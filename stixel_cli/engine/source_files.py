"""What a source file means for a key: the digest of its syntax tree, and its imports.

Parsing all files of a graph takes longer than the rest of a cached run, so the digests are kept in
the store. They are found by the hash of a file's content: neither its name nor its time matters.
"""

import ast
import os
import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from stixel_cli.border.files import content_digest
from stixel_cli.engine.cache_folder import store_json, stored_json
from stixel_cli.engine.errors import InvalidCode
from stixel_cli.errors import UserError, located

SOURCES = "sources"
"""Folder in the store."""

MOST_DIGESTS = 2000
"""Number of digests that are kept; those of unused contents are dropped first."""

DIGITS = 32
"""Number of hex digits of a module's digest."""


@dataclass(frozen=True)
class Source:
    """The meaning of a source file."""

    digest: str
    """Of its syntax tree without comments, layout and docstrings."""
    is_empty: bool
    """Whether it has no statement."""
    imports: list[tuple[int, str, str | None]]
    """(level, module, name) of each import; the level of a relative import, 0 for an absolute one;
    the name is None for `import module`."""
    files: list[str] | None
    """Names that the module declares as `FILES`, relative to its folder; None without."""


_digests: dict[str, list] = {}
"""Fields of `Source` by SHA-256 of the file's content; the most recently used are last."""

_unsaved: set[str] = set()
"""Keys of `_digests` that no file has."""


def parse(path: Path, content: bytes) -> Source:
    """Return the meaning of the source file `path` with this content.

    InvalidCode if it is not valid Python, or declares its files in another form.
    """
    key = sha256(content).hexdigest()
    fields = _digests.pop(key, None)
    if fields is None:
        try:
            tree = ast.parse(content, filename=str(path))
        except (SyntaxError, ValueError) as error:
            line = f", line {error.lineno}" if isinstance(error, SyntaxError) else ""
            raise InvalidCode(f"{path}{line}: not valid Python: {error.args[0]}") from error
        files = _declared_files(path, tree)
        text, imports = _normalised(tree)
        text = text.encode("utf-8", "surrogatepass")
        fields = [sha256(text).hexdigest()[:DIGITS], not tree.body, imports, files]
        _unsaved.add(key)
    _digests[key] = fields
    return Source(*fields)


def _declared_files(path: Path, tree: ast.Module) -> list[str] | None:
    """The file names in a module's statement `FILES = ["weights.npz"]`; None without one."""
    for node in tree.body:
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        if any(getattr(one, "id", "") == "FILES" for one in targets):
            items = getattr(getattr(node, "value", None), "elts", [None])
            names = [getattr(one, "value", None) for one in items]
            if all(isinstance(name, str) for name in names):
                return names
            reason = 'FILES must be a list such as ["weights.npz"]'
            raise InvalidCode(f"{path}, line {node.lineno}: {reason}")
    return None


def declared_files(path: Path, source: Source) -> Iterator[tuple[str, Path, str]]:
    """Name, path and digest of each file that the module at `path` declares.

    InvalidCode if one is missing, not a regular file next to the module, or too large.
    """
    for name in source.files or ():
        if Path(name).is_absolute():
            raise InvalidCode(f"{path}: FILES: {name}: must be relative to the module's folder")
        with located(f"{path}: FILES", InvalidCode, UserError):
            yield name, path.parent / name, content_digest(path.parent / name)


_READ = re.compile(r"(.*\.)?(open|read_text|import_module)|(np|numpy)\.load", re.DOTALL)


def undeclared_read(path: Path) -> str | None:
    """The first call in a source file that may read a file or import a module by its name.

    As `file, line 3: np.load(…)`. None without such a call, or if the module declares `FILES`.
    """
    content = path.read_bytes()
    if parse(path, content).files is not None:
        return None
    calls = [node for node in ast.walk(ast.parse(content)) if isinstance(node, ast.Call)]
    named = [(call.lineno, ast.unparse(call.func)) for call in calls]
    line, name = min((one for one in named if _READ.fullmatch(one[1])), default=(0, ""))
    return f"{path}, line {line}: {name[-40:]}(…)" if name else None


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
                docs = (isinstance(o, ast.Expr) and getattr(o.value, "value", None) for o in value)
                value[:] = [o for o, d in zip(value, docs, strict=True) if not isinstance(d, str)]
            pending += [one for one in value if isinstance(one, _HOLDERS)]
    return ast.dump(tree, annotate_fields=False), list(imports)


_HOLDERS = (ast.stmt, ast.ExceptHandler, ast.match_case)


@cache
def _digests_file() -> str:
    """Name of the file of digests. This module and Python determine what is in it."""
    made_by = sys.version.encode() + Path(__file__).read_bytes()
    return f"digests-{sha256(made_by).hexdigest()[:16]}.json"


def load_digests(store_folder: Path) -> None:
    """Read the digests that the store keeps. A file that is missing or damaged has no effect."""
    for key, fields in (stored_json(store_folder, SOURCES, _digests_file()) or {}).items():
        _digests.setdefault(key, fields)
        _unsaved.discard(key)


def save_digests(store_folder: Path) -> None:
    """Write the digests of this process to the store, if they are new and if this is possible."""
    with suppress(OSError):
        path = store_folder / SOURCES / _digests_file()
        if not _unsaved and path.exists():
            os.utime(path)
            return
        others = stored_json(store_folder, SOURCES, path.name) or {}
        known = {key: others[key] for key in others if key not in _digests} | _digests
        newest = dict(list(known.items())[-MOST_DIGESTS:])
        store_json(store_folder, SOURCES, path.name, newest)
        _unsaved.clear()
