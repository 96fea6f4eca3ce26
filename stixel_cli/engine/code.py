"""The code of a stage: every first-party module that its modules reach through import statements.

Import statements are followed wherever they occur in a file; nothing is imported. The digest of a
module is that of its syntax tree without comments, layout and docstrings: an edit of any statement,
imports included, makes the stage stale.

- First-party modules: the package of the stage, the engine's own package, and every module on the
  import path that belongs neither to a distribution nor to the standard library, or to a
  distribution that is installed in place (`pip install -e`).
- A package's `__init__` counts if code imports a name from it, and in other packages than the
  engine's own always: Python runs it. A package that is bound as an object
  (`import package`) counts with all its modules, since any of them can be an attribute.
- The files that a module declares (`FILES = ["weights.npz"]`, relative to its folder) count by
  their content, each as a module `module/weights.npz`.
- A stage declares code that no import statement names (`importlib.import_module`, `sys.modules`)
  and other files that it reads: see `Stage.modules` and `Stage.files`.
"""

import importlib
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.machinery import EXTENSION_SUFFIXES, PathFinder
from importlib.util import find_spec
from pathlib import Path

from stixel_cli.border.files import content_digest
from stixel_cli.engine import source_files
from stixel_cli.engine.errors import InvalidCode
from stixel_cli.engine.versions import is_editable, providers, versions_of
from stixel_cli.errors import UserError

OWN_PACKAGE = __name__.partition(".")[0]


@dataclass(frozen=True)
class Code:
    """The code of one stage."""

    roots: tuple[str, ...]
    """The modules that the walk starts from."""
    digest: str
    """Of all modules."""
    modules: dict[str, str]
    """Module -> digest of its syntax tree."""
    files: dict[str, tuple[Path, str]]
    """Module -> the file it was read from and the SHA-256 of its bytes; declared files too."""
    versions: dict[str, str | None]
    """Distribution that the modules import from -> its version; None for an imported name that is
    not installed."""
    folders: tuple[Path, ...] = ()
    """Searched for modules that the import path lacks."""

    @property
    def modules_of_user(self) -> dict[str, str]:
        """Those of `modules` that are not of the engine's own package."""
        return {n: digest for n, digest in self.modules.items() if n.split(".")[0] != OWN_PACKAGE}

    @property
    def of_user(self) -> dict[str, Path]:
        """The source files of `modules_of_user`, without declared files."""
        files = {name: self.files[name][0] for name in self.modules_of_user if "/" not in name}
        return {name: path for name, path in files.items() if path.suffix == ".py"}


@dataclass(frozen=True)
class _Module:
    """One file with its digests, its imports as (module, name or None), and declared files."""

    name: str
    path: Path
    is_package: bool
    file_digest: str
    code_digest: str
    is_empty: bool
    imports: tuple[tuple[str, str | None], ...] = ()
    files: tuple["_Module", ...] = ()


_added: list[str] = []
"""Folders of the user's modules at the end of the import path."""


def search_also(folders: Iterable[Path]) -> None:
    """Put folders of the user's modules, and no others, at the end of the import path.

    There a file hides no installed package.
    """
    wanted = [str(folder) for folder in folders]
    for folder in _added:
        if folder in sys.path and folder not in wanted:
            sys.path.remove(folder)
    _added[:] = [folder for folder in _added if folder in wanted]
    for folder in wanted:
        if folder not in sys.path:
            sys.path.append(folder)
            _added.append(folder)
            importlib.invalidate_caches()


def same_files(files: Mapping[str, tuple[Path, str]]) -> bool:
    """Whether all files still have the content of their digests."""
    with suppress(UserError):
        return all(content_digest(path) == digest for path, digest in files.values())
    return False


class CodeIndex:
    """Finds the code of stages. Each file is read once: make a new index to see later edits."""

    def __init__(self):
        self._walk = cache(_Walk)

    def code(self, roots: Iterable[str], folders: tuple[Path, ...] = ()) -> Code:
        """Find the code that the modules `roots` reach, including themselves.

        Modules that the import path lacks are looked for in `folders`. LookupError if a root is not
        a module, or a module is not valid Python.
        """
        return self._walk(folders).code(tuple(sorted(set(roots))))


class _Walk:
    """Finds the code of stages with one list of further folders."""

    def __init__(self, own: tuple[Path, ...]):
        self._own = own
        self.code = cache(self._code)
        self._search = cache(self._folders)
        self._find = cache(self._read)

    def _code(self, roots: tuple[str, ...]) -> Code:
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
            found |= {one.name: one for one in module.files}
            pending += self._packages(name)
            for target, attribute in module.imports:
                top = target.partition(".")[0]
                if top in first_party or self._is_loose(top):
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
            versions=versions_of(outside),
            folders=self._own,
        )

    def _is_loose(self, top: str) -> bool:
        """Whether a top-level module is a user's own file, or of a distribution in place."""
        if top in sys.stdlib_module_names or (top in providers() and not is_editable(top)):
            return False
        return bool(self._search(top))

    def _packages(self, name: str) -> list[str]:
        """The packages around a module whose `__init__` has statements; not of the engine's own."""
        parts = name.split(".")
        above = [".".join(parts[:end]) for end in range(1, len(parts))]
        found = {one: self._find(one) for one in above if parts[0] != OWN_PACKAGE}
        return [one for one, module in found.items() if module is not None and not module.is_empty]

    def _folders(self, top: str) -> tuple[Path, ...]:
        """The folders that contain the top-level module; the import path comes first."""
        own = any((f / f"{top}.py").is_file() or (f / top).is_dir() for f in self._own)
        # Not as `find_spec`, which may answer with a module of the same name that is imported.
        path = [*(p for p in sys.path if p not in _added), *map(str, self._own)]
        spec = PathFinder.find_spec(top, path) if own else None
        if spec is None:
            with suppress(ImportError, ValueError):
                spec = find_spec(top)
        if spec is None:
            return ()
        if spec.submodule_search_locations:
            return tuple(Path(folder).parent for folder in spec.submodule_search_locations)
        return (Path(spec.origin).parent,) if spec.origin and spec.has_location else ()

    def _reached(self, target: str, attribute: str | None) -> Iterator[str]:
        """Modules that an import of `attribute` from `target` binds; None for `import target`."""
        if attribute is None or attribute == "*":
            yield from self._below(target)
        else:
            module = self._find(target)
            submodule = f"{target}.{attribute}"
            can_have = module is None or module.is_package
            if can_have and self._find(submodule) is not None:
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

    def _read(self, name: str) -> _Module | None:
        top, *parts = name.split(".")
        for folder in self._search(top):
            base = folder.joinpath(top, *parts)
            names = (f"{base.name}{suffix}" for suffix in (".py", *EXTENSION_SUFFIXES))
            files = ((base.with_name(file), False) for file in names)
            for path, is_package in ((base / "__init__.py", True), *files):
                if path.is_file():
                    return _module(name, path, is_package)
            if base.is_dir():
                # A namespace package: it has submodules and no code of its own.
                return _Module(name, base, True, "", "", True)
        return None


def _module(name: str, path: Path, is_package: bool) -> _Module:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InvalidCode(f"{path}: cannot be read: {error.strerror}") from error
    file_digest = sha256(content).hexdigest()
    if path.suffix != ".py":
        return _Module(name, path, False, file_digest, file_digest[: source_files.DIGITS], False)
    source = source_files.parse(path, content)
    package = (name if is_package else name.rpartition(".")[0]).split(".")
    imports = tuple((_absolute(level, of, package), what) for level, of, what in source.imports)
    files = tuple(
        _Module(f"{name}/{file}", at, False, digest, digest[: source_files.DIGITS], False)
        for file, at, digest in source_files.declared_files(path, source)
    )
    return _Module(
        name, path, is_package, file_digest, source.digest, source.is_empty, imports, files
    )


def _absolute(level: int, module: str, package: list[str]) -> str:
    """Full name of the module that an import statement in `package` names."""
    if not level:
        return module
    parents = package[: len(package) - level + 1]
    return ".".join((*parents, module) if module else parents)
