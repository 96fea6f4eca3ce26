"""Code as a text that leaves out what does not matter to what it does."""

import ast


def spelling(nodes: list[ast.AST], without_methods: bool = False) -> str:
    """A text that is the same for trees which differ in layout, comments and docstrings only."""
    parts: list[str] = []
    for node in nodes:
        _spell(node, parts, without_methods and isinstance(node, ast.ClassDef))
    return "\x1f".join(parts)


def _spell(node: ast.AST, parts: list[str], without_methods: bool) -> None:
    parts.append(type(node).__name__)
    for name in node._fields:
        if name in ("ctx", "type_comment", "kind"):
            continue
        value = getattr(node, name, None)
        if isinstance(value, ast.AST):
            _spell(value, parts, False)
        elif isinstance(value, list):
            parts.append("[")
            for item in value:
                if not isinstance(item, ast.AST):
                    parts.append(repr(item))
                elif not _is_bare_text(item) and not (without_methods and is_function(item)):
                    _spell(item, parts, False)
            parts.append("]")
        else:
            parts.append(repr(value))


def _is_bare_text(node: ast.AST) -> bool:
    """A docstring, or a string that stands alone as a comment does."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def is_function(node: ast.AST) -> bool:
    """Whether the node defines a function or a method."""
    return isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
