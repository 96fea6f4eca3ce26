"""The code that a stage reaches, as one hash: what decides that a cached result is stale.

Read from the syntax trees alone, so nothing is imported. From the stage's function every name is
followed, through imports and re-exports, to the first-party function, class or constant it stands
for, and on from there. First-party is what shares the function's top-level package.

- A class counts whole, with its bases and all its methods reach: which methods are called on an
  object does not show in the text.
- Comments, layout and docstrings do not count.
- Statements of a module that do more than bind a name (calls, assignments to attributes, functions
  under a decorator of the package's own, which may register them) count for everything in that
  module and in those that import it.
- A module counts whole where a name cannot be resolved: the module handed on as an object
  (`getattr(module, name)`), a name it does not bind, `globals()`; the whole package where even the
  module cannot be told.
"""

import ast
import builtins
import gc
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from stixel_cli.engine.source import ImportedName, SourceModule, Sources
from stixel_cli.engine.spelling import is_function, spelling
from stixel_cli.engine.uses import Uses, find_uses

REFLECTION = {"globals", "eval", "exec"}
EFFECTS = "<module level>"


@dataclass(frozen=True)
class CodeHash:
    """The code of one stage.

    Attributes:
        digest: of all of it.
        parts: "module:name" (methods "module:Class.name") -> digest of that text alone.
        files: module -> the file it was read from and the SHA-256 of its bytes.
        outside: top-level modules of others that it imports from, the standard library's included.
    """

    digest: str
    parts: dict[str, str]
    files: dict[str, tuple[Path, str]]
    outside: frozenset[str] = frozenset()


def same_files(files: Mapping[str, tuple[Path, str]]) -> bool:
    """Whether all files still have the bytes of their digests."""
    try:
        return all(sha256(p.read_bytes()).hexdigest() == digest for p, digest in files.values())
    except OSError:
        return False


class CodeIndex:
    """Hashes of code as the files are now; make a new one to see them as they are later."""

    def __init__(self):
        self._sources: dict[str, Sources] = {}
        self._hashes: dict[tuple, CodeHash] = {}

    def hash(self, function: str, types: Iterable[tuple[str, str]] = ()) -> CodeHash:
        """Hash of all first-party code that `function`, "package.module:name", reaches.

        `types` are further roots as (module, qualified name): classes of the settings.

        Raises:
            LookupError: there is no such module, or it does not bind the name.
        """
        key = (function, tuple(sorted(types)))
        if key not in self._hashes:
            with _without_collection():
                self._hashes[key] = self._follow(*key)
        return self._hashes[key]

    def _follow(self, function: str, types: tuple[tuple[str, str], ...]) -> CodeHash:
        module_name, _, name = function.partition(":")
        package = module_name.partition(".")[0]
        if package not in self._sources:
            try:
                self._sources[package] = Sources(package)
            except ModuleNotFoundError as error:
                raise LookupError(f"{function}: {error}") from None
        module = self._sources[package].find(module_name)
        if module is None or not (name in module.bindings or name in module.imports):
            raise LookupError(f"there is no function {function}")
        reach = _Reach(self._sources[package])
        reach.follow_attribute(module, name, ())
        for type_module, type_name in types:
            reach.follow_import(ImportedName(type_module, type_name.partition(".")[0]), ())
        return reach.finish()


@contextmanager
def _without_collection() -> Iterator[None]:
    """Syntax trees are many objects that stay: the garbage collector would walk them in vain."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


class _Reach:
    """Follows names from definition to definition."""

    def __init__(self, sources: Sources):
        self.sources = sources
        self.parts: dict[str, str] = {}
        self.files: dict[str, tuple[Path, str]] = {}
        self.outside: set[str] = set()
        self.seen: set[tuple] = set()
        self.pending: list[tuple[SourceModule, str]] = []

    def finish(self) -> CodeHash:
        while self.pending:
            module, name = self.pending.pop()
            parts, uses = _definition(module, name)
            self.parts.update(parts)
            self.files[module.name] = (module.path, module.digest)
            self.follow_uses(module, uses)
        parts = dict(sorted(self.parts.items()))
        text = "\n".join(f"{name} {digest}" for name, digest in parts.items())
        files = dict(sorted(self.files.items()))
        digest = sha256(text.encode()).hexdigest()
        return CodeHash(digest, parts, files, frozenset(self.outside))

    def follow_uses(self, module: SourceModule, uses: Uses) -> None:
        for chain in sorted(uses.names):
            self.follow_name(module, chain, certain=True)
        for chain in sorted(uses.hints):
            self.follow_name(module, chain, certain=False)
        for target, tail in uses.imports:
            self.follow_import(target, tail)
        if uses.dynamic:
            for other in self.sources.all():
                self.add_whole(other)

    def follow_name(self, module: SourceModule, chain: tuple[str, ...], certain: bool) -> None:
        """A global name used in `module`, with the attributes that follow it."""
        name, tail = chain[0], chain[1:]
        if self.follow_bound(module, name, tail):
            return
        if hasattr(builtins, name):
            if name in REFLECTION:
                self.add_whole(module)
        elif certain and not _is_dunder(name):
            self.add_whole(module)

    def follow_attribute(self, module: SourceModule, name: str, tail: tuple[str, ...]) -> None:
        """`module.name`, seen from outside."""
        if self.follow_bound(module, name, tail):
            return
        submodule = self.sources.find(f"{module.name}.{name}")
        if submodule is not None:
            self.follow_module(submodule, tail)
        elif not _is_dunder(name):
            self.add_whole(module)

    def follow_bound(self, module: SourceModule, name: str, tail: tuple[str, ...]) -> bool:
        """Follow what `module` binds to `name`; False if it binds no such name."""
        if self.first_time("bound", module.name, name, tail):
            self.add_effects(module)
            if name in module.bindings:
                self.add(module, name)
            for target in module.imports.get(name, ()):
                self.follow_import(target, tail)
        if name in module.bindings or name in module.imports:
            return True
        stars = [star for path in module.stars if (star := self.sources.find(path))]
        return any([star is not module and self.star_binds(star, name, tail) for star in stars])

    def star_binds(self, star: SourceModule, name: str, tail: tuple[str, ...]) -> bool:
        if name in star.bindings or name in star.imports:
            return self.follow_bound(star, name, tail)
        if star.stars and self.first_time("star", star.name, name):
            return self.follow_bound(star, name, tail)
        return False

    def follow_import(self, target: ImportedName, tail: tuple[str, ...]) -> None:
        module = self.sources.find(target.module)
        if module is None:
            self.outside.add(target.module.partition(".")[0])
            return
        if target.attribute is None:
            self.follow_module(module, tail)
        elif target.attribute == "*":
            self.add_whole(module)
        else:
            self.follow_attribute(module, target.attribute, tail)

    def follow_module(self, module: SourceModule, tail: tuple[str, ...]) -> None:
        self.add_effects(module)
        if tail:
            self.follow_attribute(module, tail[0], tail[1:])
        else:
            self.add_whole(module)

    def add_whole(self, module: SourceModule) -> None:
        if self.first_time("whole", module.name):
            self.add_effects(module)
            for name in module.bindings:
                self.add(module, name)
            for targets in module.imports.values():
                for target in targets:
                    # What it imports is reached too, unless that is a module handed on.
                    if target.attribute is not None:
                        self.follow_import(target, ())
            for star in module.stars:
                self.follow_import(ImportedName(star, "*"), ())

    def add_effects(self, module: SourceModule) -> None:
        """What importing `module` does, in it and in the modules it imports."""
        if not self.first_time("effects", module.name):
            return
        self.add(module, EFFECTS)
        parents = module.name.split(".")[:-1]
        names = [".".join(parents[: i + 1]) for i in range(len(parents))]
        for name in (*names, *module.executed):
            other = self.sources.find(name)
            if other is not None:
                self.add_effects(other)

    def add(self, module: SourceModule, name: str) -> None:
        if (module.effects if name == EFFECTS else module.bindings[name]) and self.first_time(
            "definition", module.name, name
        ):
            self.pending.append((module, name))

    def first_time(self, *what) -> bool:
        if what in self.seen:
            return False
        self.seen.add(what)
        return True


_definitions: dict[tuple[str, str, str], tuple[dict[str, str], Uses]] = {}


def _definition(module: SourceModule, name: str) -> tuple[dict[str, str], Uses]:
    """Digests of the text that binds `name`, and what it uses. Kept for the life of the process."""
    key = (module.name, module.digest, name)
    if key not in _definitions:
        statements = module.effects if name == EFFECTS else module.bindings[name]
        _definitions[key] = (_digests(module, name, statements), find_uses(statements, module))
    return _definitions[key]


def _digests(module: SourceModule, name: str, statements: list[ast.stmt]) -> dict[str, str]:
    pieces: dict[str, list[ast.AST]] = {name: []}
    for statement in statements:
        pieces[name].append(statement)
        if isinstance(statement, ast.ClassDef):
            for method in filter(is_function, statement.body):
                pieces.setdefault(f"{name}.{method.name}", []).append(method)
    return {
        f"{module.name}:{piece}": sha256(spelling(nodes, piece == name).encode()).hexdigest()[:20]
        for piece, nodes in pieces.items()
    }


def _is_dunder(name: str) -> bool:
    return name.startswith("__") and name.endswith("__")
