"""Which names from outside a piece of code uses, found in its syntax tree."""

import ast
from dataclasses import dataclass, field

from stixel_cli.engine.source import ImportedName, SourceModule, imported_names

DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
IMPORTS = (ast.Import, ast.ImportFrom)


@dataclass
class Uses:
    """What a piece of code uses from outside.

    Attributes:
        names: global names with the attributes that follow, `a.b.c` as ("a", "b", "c").
        hints: the same, from annotations in quotes: not to be missed where there is no such name.
        imports: what imports inside the code bind, each with the attributes that follow.
        dynamic: it imports a module whose name only shows when it runs.
    """

    names: set[tuple[str, ...]] = field(default_factory=set)
    hints: set[tuple[str, ...]] = field(default_factory=set)
    imports: set[tuple[ImportedName, tuple[str, ...]]] = field(default_factory=set)
    dynamic: bool = False


@dataclass
class _Scope:
    names: set[str]
    imports: dict[str, list[ImportedName]]
    is_class: bool = False


def find_uses(statements: list[ast.stmt], module: SourceModule) -> Uses:
    """What `statements` at the top level of `module` use from outside themselves."""
    finder = _Finder(module)
    for statement in statements:
        finder.visit(statement)
    return finder.uses


class _Finder(ast.NodeVisitor):
    """Walks a tree with Python's scopes: a name is global unless a scope around it binds it."""

    def __init__(self, module: SourceModule):
        self.module = module
        self.uses = Uses()
        self.scopes: list[_Scope] = []

    def generic_visit(self, node):
        for child in _children(node):
            self.visit(child)

    def use(self, chain: tuple[str, ...]) -> None:
        for depth, scope in enumerate(reversed(self.scopes)):
            if scope.is_class and depth > 0:
                continue
            for target in scope.imports.get(chain[0], ()):
                self.uses.imports.add((target, chain[1:]))
            if chain[0] in scope.names:
                if scope.is_class:
                    # A class body falls back to the global name where its own is not bound yet.
                    self.uses.hints.add(chain)
                return
        self.uses.names.add(chain)

    def visit_Name(self, node):
        # Inside a function, a store to a `global` name uses that name too.
        if isinstance(node.ctx, ast.Load) or (self.scopes and not self.scopes[-1].is_class):
            self.use((node.id,))

    def visit_Attribute(self, node):
        chain: list[str] = []
        inner: ast.expr = node
        while isinstance(inner, ast.Attribute):
            chain.append(inner.attr)
            inner = inner.value
        if isinstance(inner, ast.Name):
            self.use((inner.id, *reversed(chain)))
        else:
            self.visit(inner)

    def visit_Call(self, node):
        name = getattr(node.func, "attr", getattr(node.func, "id", None))
        if name in ("import_module", "__import__"):
            argument = node.args[0] if node.args else None
            if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                dots = len(argument.value) - len(argument.value.lstrip("."))
                target = self.module.absolute(argument.value.lstrip(".") or None, dots)
                self.uses.imports.add((ImportedName(target), ()))
            else:
                self.uses.dynamic = True
        self.generic_visit(node)

    def visit_function(self, node):
        self.scopes.append(_type_parameters(node))
        arguments = node.args
        every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
        every += [extra for extra in (arguments.vararg, arguments.kwarg) if extra]
        for default in (*arguments.defaults, *arguments.kw_defaults):
            if default is not None:
                self.visit(default)
        for decorator in getattr(node, "decorator_list", ()):
            self.visit(decorator)
        for annotation in (*(a.annotation for a in every), getattr(node, "returns", None)):
            self.visit_annotation(annotation)
        body = [node.body] if isinstance(node, ast.Lambda) else node.body
        scope = self.scope_of(body)
        scope.names |= {argument.arg for argument in every}
        self.within(scope, body)
        self.scopes.pop()

    visit_FunctionDef = visit_AsyncFunctionDef = visit_Lambda = visit_function

    def visit_ClassDef(self, node):
        self.scopes.append(_type_parameters(node))
        for outer in (*node.decorator_list, *node.bases, *node.keywords):
            self.visit(outer)
        scope = self.scope_of(node.body)
        scope.is_class = True
        self.within(scope, node.body)
        self.scopes.pop()

    def visit_TypeAlias(self, node):
        self.within(_type_parameters(node), [node.value])

    def visit_comprehension_scope(self, node):
        # The first iterable is evaluated outside.
        self.visit(node.generators[0].iter)
        targets = [generator.target for generator in node.generators]
        names = {n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}
        rest = [g.iter for g in node.generators[1:]]
        rest += [condition for g in node.generators for condition in g.ifs]
        rest += [node.key, node.value] if isinstance(node, ast.DictComp) else [node.elt]
        self.within(_Scope(names, {}), [*targets, *rest])

    visit_ListComp = visit_SetComp = visit_DictComp = visit_comprehension_scope
    visit_GeneratorExp = visit_comprehension_scope

    def visit_AnnAssign(self, node):
        self.visit(node.target)
        self.visit_annotation(node.annotation)
        if node.value is not None:
            self.visit(node.value)

    def visit_annotation(self, annotation: ast.expr | None) -> None:
        if annotation is None:
            return
        self.visit(annotation)
        pending: list[ast.AST] = [annotation]
        while pending:
            node = pending.pop()
            if isinstance(node, ast.Subscript) and ast.unparse(node.value).endswith("Literal"):
                continue
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                self.uses.hints |= _names_in_text(node.value)
            pending.extend(_children(node))

    def within(self, scope: _Scope, nodes: list[ast.AST]) -> None:
        self.scopes.append(scope)
        for node in nodes:
            self.visit(node)
        self.scopes.pop()

    def scope_of(self, body: list[ast.AST]) -> _Scope:
        """The names that `body` binds in its own scope."""
        scope = _Scope(set(), {})
        outer: set[str] = set()
        pending = [(node, False) for node in body]
        while pending:
            node, in_comprehension = pending.pop()
            kind = type(node)
            if kind is ast.Name:
                if isinstance(node.ctx, ast.Store) and not in_comprehension:
                    scope.names.add(node.id)
                continue
            if kind in DEFINITIONS:
                scope.names.add(node.name)
                continue
            if kind is ast.Lambda:
                continue
            if kind in IMPORTS:
                for name, target in imported_names(node, self.module):
                    scope.names.add(name)
                    scope.imports.setdefault(name, []).append(target)
            elif kind is ast.NamedExpr:
                scope.names.add(node.target.id)
            elif kind in (ast.Global, ast.Nonlocal):
                outer |= set(node.names)
            elif kind in (ast.ExceptHandler, ast.MatchAs, ast.MatchStar):
                scope.names |= {node.name} - {None}
            elif kind is ast.MatchMapping:
                scope.names |= {node.rest} - {None}
            inside = in_comprehension or kind in COMPREHENSIONS
            pending += [(child, inside) for child in _children(node)]
        scope.names -= outer
        return scope


def _children(node: ast.AST) -> list[ast.AST]:
    """The nodes right below, but for marks such as `Load`. Twice as fast as the library's."""
    found: list[ast.AST] = []
    for name in node._fields:
        value = getattr(node, name, None)
        if isinstance(value, list):
            found += [item for item in value if isinstance(item, ast.AST)]
        elif name != "ctx" and isinstance(value, ast.AST):
            found.append(value)
    return found


def _type_parameters(node: ast.AST) -> _Scope:
    """The scope of `T` in `def f[T](x: T)`; empty before Python 3.12."""
    return _Scope({parameter.name for parameter in getattr(node, "type_params", ())}, {})


def _names_in_text(text: str) -> set[tuple[str, ...]]:
    """Names with attributes in an annotation that is written in quotes."""
    try:
        tree = ast.parse(text, mode="eval")
    except SyntaxError:
        return set()
    finder = _Finder(SourceModule("", None, "", False))
    finder.visit(tree)
    return finder.uses.names
