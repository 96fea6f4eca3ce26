"""First-party modules as syntax trees: which statement binds which name. Nothing is imported."""

import ast
import importlib.machinery
import importlib.util
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path


@dataclass(frozen=True)
class ImportedName:
    """What an import binds: `module` itself, or its `attribute` (which may be a submodule)."""

    module: str
    attribute: str | None = None


@dataclass
class SourceModule:
    """The top level of one module.

    Attributes:
        name, path, digest: dotted name, file, and SHA-256 of its bytes.
        bindings: name -> the statements that bind it (none if it is bound by one of `effects`).
        imports: name -> what the imports bind to it.
        stars: modules of `from … import *`.
        executed: modules that its import imports.
        effects: statements that do more than bind a name: calls, assignments to attributes,
            conditions. They belong to whatever else of the module is used.
    """

    name: str
    path: Path
    digest: str
    is_package: bool
    bindings: dict[str, list[ast.stmt]] = field(default_factory=dict)
    imports: dict[str, list[ImportedName]] = field(default_factory=dict)
    stars: list[str] = field(default_factory=list)
    executed: list[str] = field(default_factory=list)
    effects: list[ast.stmt] = field(default_factory=list)

    @property
    def package(self) -> str:
        """The package that relative imports start from."""
        return self.name if self.is_package else self.name.rpartition(".")[0]

    def absolute(self, module: str | None, level: int) -> str:
        """Absolute name of a module imported from here with `level` leading dots."""
        if level == 0:
            return module or ""
        parts = self.package.split(".")
        base = ".".join(parts[: len(parts) - level + 1])
        return f"{base}.{module}" if module else base


def imported_names(
    statement: ast.Import | ast.ImportFrom, module: SourceModule
) -> list[tuple[str, ImportedName]]:
    """(name, what it stands for) of an import; the name is `*` for a star."""
    if isinstance(statement, ast.Import):
        return [
            (alias.asname, ImportedName(alias.name))
            if alias.asname
            else (alias.name.partition(".")[0], ImportedName(alias.name.partition(".")[0]))
            for alias in statement.names
        ]
    source = module.absolute(statement.module, statement.level)
    return [(a.asname or a.name, ImportedName(source, a.name)) for a in statement.names]


_parsed: dict[Path, SourceModule] = {}


class Sources:
    """The modules of one top-level package, each file read once by each object.

    Trees are kept for the life of the process and used again while the file's bytes are the same.
    """

    def __init__(self, package: str):
        spec = importlib.util.find_spec(package)
        if spec is None:
            raise ModuleNotFoundError(f"No module named {package!r}", name=package)
        self.package = package
        self._folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
        self._file = Path(spec.origin) if spec.origin and not self._folders else None
        self._modules: dict[str, SourceModule | None] = {}

    def find(self, name: str) -> SourceModule | None:
        """The module called `name`, None if this package has no such source file."""
        if name not in self._modules:
            self._modules[name] = self._read(name)
        return self._modules[name]

    def all(self) -> list[SourceModule]:
        """Every module of the package."""
        names = {self.package}
        for folder in self._folders:
            for path in sorted(folder.rglob("*.py")):
                parts = path.relative_to(folder).with_suffix("").parts
                parts = parts[:-1] if parts[-1] == "__init__" else parts
                names.add(".".join((self.package, *parts)))
        return [module for name in sorted(names) if (module := self.find(name))]

    def _read(self, name: str) -> SourceModule | None:
        top, *parts = name.split(".")
        if top != self.package:
            return None
        if self._file is not None:
            return parse_module(name, self._file, False) if not parts else None
        for folder in self._folders:
            base = folder.joinpath(*parts)
            if (base / "__init__.py").is_file():
                return parse_module(name, base / "__init__.py", True)
            if base.with_suffix(".py").is_file():
                return parse_module(name, base.with_suffix(".py"), False)
            if base.is_dir():
                # A package without __init__.py: it has submodules and nothing of its own.
                return SourceModule(name, base, "", True)
        return None


def parse_module(name: str, path: Path, is_package: bool) -> SourceModule:
    """Read and parse a file.

    Raises:
        SyntaxError: it is not Python.
    """
    content = path.read_bytes()
    digest = sha256(content).hexdigest()
    known = _parsed.get(path)
    if known is not None and (known.name, known.digest) == (name, digest):
        return known
    module = SourceModule(name, path, digest, is_package)
    for statement in ast.parse(content, filename=str(path)).body:
        _bind(module, statement)
    _parsed[path] = module
    return module


def _bind(module: SourceModule, statement: ast.stmt) -> None:
    match statement:
        case ast.Import() | ast.ImportFrom():
            _bind_import(module, statement, executes=True)
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            if any(_is_first_party(module, decorator) for decorator in statement.decorator_list):
                # It may register what it decorates, as `@area.register` does: then what calls it
                # does not name it.
                module.effects.append(statement)
            module.bindings.setdefault(statement.name, []).append(statement)
        case ast.Expr(value=ast.Constant()) | ast.Pass():
            pass
        case ast.Assign() | ast.AnnAssign() | ast.AugAssign():
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            if all(isinstance(target, ast.Name) for target in _flat(targets)):
                for target in _flat(targets):
                    module.bindings.setdefault(target.id, []).append(statement)
            else:
                _bind_effect(module, statement)
        case ast.If(test=ast.Compare(left=ast.Name(id="__name__"))):
            pass
        case _ if type(statement).__name__ == "TypeAlias":
            module.bindings.setdefault(statement.name.id, []).append(statement)
        case _:
            _bind_effect(module, statement)


def _is_first_party(module: SourceModule, decorator: ast.expr) -> bool:
    """Whether what stands after the @ begins with a name that the package itself has made."""
    root = decorator
    while isinstance(root, ast.Attribute | ast.Call | ast.Subscript):
        root = root.func if isinstance(root, ast.Call) else root.value
    if not isinstance(root, ast.Name):
        return True
    package = module.name.partition(".")[0]
    targets = module.imports.get(root.id, ())
    return root.id in module.bindings or any(
        target.module.partition(".")[0] == package for target in targets
    )


def _bind_effect(module: SourceModule, statement: ast.stmt) -> None:
    """A statement that may bind names among other things, such as `if` or `try`."""
    typing_only = isinstance(statement, ast.If) and (
        ast.unparse(statement.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")
    )
    imports_only = True
    pending: list[ast.AST] = [statement]
    while pending:
        node = pending.pop()
        if isinstance(node, ast.Import | ast.ImportFrom):
            _bind_import(module, node, executes=not typing_only)
            continue
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            module.bindings.setdefault(node.name, [])
            imports_only = False
            continue
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            module.bindings.setdefault(node.id, [])
        compound = ast.If | ast.Try | ast.ExceptHandler
        if isinstance(node, ast.stmt) and not isinstance(node, compound | ast.Pass):
            imports_only = False
        pending.extend(ast.iter_child_nodes(node))
    if not imports_only:
        module.effects.append(statement)


def _bind_import(
    module: SourceModule, statement: ast.Import | ast.ImportFrom, executes: bool
) -> None:
    if isinstance(statement, ast.ImportFrom) and statement.module == "__future__":
        return
    for name, target in imported_names(statement, module):
        if name == "*":
            module.stars.append(target.module)
        else:
            module.imports.setdefault(name, []).append(target)
        if executes and target.attribute is not None:
            module.executed += [target.module, f"{target.module}.{target.attribute}"]
    if executes and isinstance(statement, ast.Import):
        module.executed += [alias.name for alias in statement.names]


def _flat(targets: list[ast.expr]) -> list[ast.expr]:
    """The names in assignment targets, tuples and lists taken apart."""
    flat = []
    for target in targets:
        if isinstance(target, ast.Tuple | ast.List):
            flat += _flat(target.elts)
        elif isinstance(target, ast.Starred):
            flat += _flat([target.value])
        else:
            flat.append(target)
    return flat
