"""The code of a stage: every first-party module that its modules reach through import statements.

Import statements are followed wherever they occur in a file; nothing is imported. The digest of a
module is that of its syntax tree without comments, layout and docstrings: an edit of any statement,
imports included, makes the stage stale.

- First-party modules: the package of the stage, the engine's own package, and every module on the
  import path that belongs neither to a distribution nor to the standard library.
- A package's `__init__` counts if code imports a name from it. A package that is bound as an object
  (`import package`) counts with all its modules, since any of them can be an attribute.
- A stage declares code that no import statement names (`importlib.import_module`, `sys.modules`)
  and files that it reads: see `Stage.modules` and `Stage.files`.
"""

import ast
import difflib
import os
import shutil
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from importlib.util import find_spec
from pathlib import Path

OWN_PACKAGE = __name__.partition(".")[0]
_DIGITS = 32


@dataclass(frozen=True)
class Code:
    """The code of one stage.

    Attributes:
        roots: the modules that the walk starts from.
        digest: of all modules.
        modules: module -> digest of its syntax tree.
        files: module -> the file it was read from and the SHA-256 of its bytes.
        versions: distribution that the modules import from -> its version; None for an imported
            name that is not installed.
    """

    roots: tuple[str, ...]
    digest: str
    modules: dict[str, str]
    files: dict[str, tuple[Path, str]]
    versions: dict[str, str | None]


@dataclass(frozen=True)
class _Module:
    """One source file with its digests, and its imports as (module, name or None)."""

    name: str
    path: Path
    is_package: bool
    file_digest: str
    code_digest: str
    is_empty: bool
    imports: tuple[tuple[str, str | None], ...]


def same_files(files: Mapping[str, tuple[Path, str]]) -> bool:
    """Whether all files still have the content of their digests."""
    try:
        return all(sha256(p.read_bytes()).hexdigest() == digest for p, digest in files.values())
    except OSError:
        return False


class CodeIndex:
    """Finds the code of stages. Each file is read once: make a new index to see later edits."""

    def __init__(self):
        self._folders: dict[str, tuple[Path, ...]] = {}
        self._modules: dict[str, _Module | None] = {}
        self._codes: dict[tuple[str, ...], Code] = {}

    def code(self, roots: Iterable[str]) -> Code:
        """Find the code that the modules `roots` reach, including themselves.

        Raises:
            LookupError: a root is not a module, or a module is not valid Python.
        """
        key = tuple(sorted(set(roots)))
        if key not in self._codes:
            self._codes[key] = self._walk(key)
        return self._codes[key]

    def _walk(self, roots: tuple[str, ...]) -> Code:
        first_party = {OWN_PACKAGE, *(root.partition(".")[0] for root in roots)}
        for root in roots:
            if self._find(root) is None:
                raise LookupError(f"no module {root} found")
        found: dict[str, _Module] = {}
        outside: set[str] = set()
        pending = list(roots)
        while pending:
            name = pending.pop()
            module = self._find(name)
            if module is None or name in found:
                continue
            found[name] = module
            for target, attribute in module.imports:
                top = target.partition(".")[0]
                if top in first_party or _is_loose(top):
                    pending += self._reached(target, attribute)
                elif top not in sys.stdlib_module_names:
                    outside.add(top)
        modules = {name: found[name].code_digest for name in sorted(found)}
        text = "\n".join(f"{name} {digest}" for name, digest in modules.items())
        return Code(
            roots=roots,
            digest=sha256(text.encode()).hexdigest(),
            modules=modules,
            files={name: (found[name].path, found[name].file_digest) for name in sorted(found)},
            versions=_versions(outside),
        )

    def _reached(self, target: str, attribute: str | None) -> Iterator[str]:
        """Modules that an import of `attribute` from `target` binds; None for `import target`."""
        if attribute is None or attribute == "*":
            yield from self._below(target)
        else:
            module = self._find(target)
            submodule = f"{target}.{attribute}"
            if self._find(submodule) is not None:
                yield from self._below(submodule)
                if module is not None and not module.is_empty:
                    yield target
            else:
                yield target

    def _below(self, name: str) -> Iterator[str]:
        """The module, and all its submodules if it is a package."""
        yield name
        module = self._find(name)
        if module is not None and module.is_package:
            folder = module.path if module.path.is_dir() else module.path.parent
            for path in sorted(folder.rglob("*.py")):
                parts = path.relative_to(folder).with_suffix("").parts
                yield ".".join((name, *(parts[:-1] if parts[-1] == "__init__" else parts)))

    def _find(self, name: str) -> _Module | None:
        if name not in self._modules:
            self._modules[name] = self._read(name)
        return self._modules[name]

    def _read(self, name: str) -> _Module | None:
        top, *parts = name.split(".")
        if top not in self._folders:
            self._folders[top] = _search_folders(top)
        for folder in self._folders[top]:
            base = folder.joinpath(top, *parts)
            for path, is_package in (
                (base / "__init__.py", True),
                (base.with_name(f"{base.name}.py"), False),
                *((base.with_name(f"{base.name}{s}"), False) for s in EXTENSION_SUFFIXES),
            ):
                if path.is_file():
                    return _parse(name, path, is_package)
            if base.is_dir():
                # A namespace package: it has submodules and no code of its own.
                return _Module(name, base, True, "", "", True, ())
        return None


def _search_folders(top: str) -> tuple[Path, ...]:
    """The folders that contain the top-level module or package."""
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):
        return ()
    if spec is None:
        return ()
    if spec.submodule_search_locations:
        return tuple(Path(folder).parent for folder in spec.submodule_search_locations)
    return (Path(spec.origin).parent,) if spec.origin and spec.has_location else ()


_parsed: dict[Path, _Module] = {}
"""Parsed modules of this process, valid while the file has the same content."""


def _parse(name: str, path: Path, is_package: bool) -> _Module:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise LookupError(f"{path}: cannot be read: {error.strerror}") from error
    file_digest = sha256(content).hexdigest()
    known = _parsed.get(path)
    if known is not None and (known.name, known.file_digest) == (name, file_digest):
        return known
    if path.suffix != ".py":
        return _Module(name, path, False, file_digest, file_digest[:_DIGITS], False, ())
    try:
        tree = ast.parse(content, filename=str(path))
    except (SyntaxError, ValueError) as error:
        line = f", line {error.lineno}" if isinstance(error, SyntaxError) else ""
        raise LookupError(f"{path}{line}: not valid Python: {error.args[0]}") from error
    package = name if is_package else name.rpartition(".")[0]
    imports = dict.fromkeys(one for node in ast.walk(tree) for one in _imports(node, package))
    text = _normalised(tree)
    module = _Module(
        name=name,
        path=path,
        is_package=is_package,
        file_digest=file_digest,
        code_digest=sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:_DIGITS],
        is_empty=not tree.body,
        imports=tuple(imports),
    )
    _parsed[path] = module
    return module


def _imports(node: ast.AST, package: str) -> Iterator[tuple[str, str | None]]:
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield alias.name, None
            if alias.asname is None and "." in alias.name:
                # `import a.b` binds the package a.
                yield alias.name.partition(".")[0], None
    elif isinstance(node, ast.ImportFrom):
        base = node.module or ""
        if node.level:
            parents = package.split(".")
            parents = parents[: len(parents) - node.level + 1]
            base = ".".join((*parents, base) if base else parents)
        for alias in node.names:
            yield base, alias.name


def _normalised(tree: ast.Module) -> str:
    """The tree as text, without layout, comments and docstrings. Changes `tree`."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [one for one in body if not _is_bare_string(one)]
    return ast.dump(tree, annotate_fields=False)


def _is_bare_string(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


@cache
def _distributions() -> Mapping[str, list[str]]:
    return packages_distributions()


@cache
def _is_loose(top: str) -> bool:
    """Whether a top-level module belongs to no distribution, such as a user's own file."""
    if top in sys.stdlib_module_names or top in _distributions():
        return False
    return bool(_search_folders(top))


def _versions(tops: Iterable[str]) -> dict[str, str | None]:
    names = {name for top in tops for name in _distributions().get(top, [top])}
    return {name: installed_version(name) for name in sorted(names)}


@cache
def installed_version(name: str) -> str | None:
    """Version of a distribution; None if it is not installed. Cached for the process."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


SOURCES = "sources"
"""Folder in the store with copies of source files, to show later what has changed."""

UNUSED = 90 * 86400.0
"""Seconds after the last use when a copy is removed."""


def keep_sources(store_folder: Path, codes: Iterable[Code]) -> None:
    """Copy the source of each module to the store, named by its digest, if possible."""
    folder = store_folder / SOURCES
    files = {code.modules[name]: path for code in codes for name, (path, _) in code.files.items()}
    for digest, path in files.items():
        kept = folder / f"{digest}.py"
        with suppress(OSError):
            if kept.exists():
                os.utime(kept)
            elif path.suffix == ".py":
                folder.mkdir(parents=True, exist_ok=True)
                partial = folder / f"{digest}-{os.getpid()}.part"
                shutil.copyfile(path, partial)
                partial.replace(kept)


def source_difference(store_folder: Path, before: str, now: Path) -> tuple[str, ...]:
    """Lines of the unified diff between the old source of a module and its file now.

    `before` is the digest of the old module. Without a copy of the old source there are no lines.
    """
    try:
        old = (store_folder / SOURCES / f"{before}.py").read_text("utf-8").splitlines()
        new = now.read_text("utf-8").splitlines()
    except (OSError, ValueError):
        return ()
    return tuple(difflib.unified_diff(old, new, "before", "now", lineterm="", n=1))


def remove_sources(store_folder: Path, everything: bool) -> None:
    """Remove all copies, or those that were not used for `UNUSED` seconds."""
    folder = store_folder / SOURCES
    if everything:
        shutil.rmtree(folder, ignore_errors=True)
        return
    with suppress(OSError):
        for path in folder.iterdir():
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > UNUSED:
                    path.unlink()
