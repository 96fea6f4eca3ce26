"""Numba keeps compiled kernels by the content of their own file alone.

So a kernel that took a function or a constant from another file would run the old code after an
edit there, under the key of the new code.
"""

import ast
from pathlib import Path

import pytest

import stixel_cli

FILES = [
    path
    for path in sorted(Path(stixel_cli.__file__).parent.rglob("*.py"))
    if "import njit" in path.read_text("utf-8")
]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_kernel_takes_nothing_from_another_file(path):
    tree = ast.parse(path.read_text("utf-8"))
    imported = {
        alias.asname or alias.name
        for statement in tree.body
        if isinstance(statement, ast.ImportFrom) and statement.module.startswith("stixel_cli")
        for alias in statement.names
    }
    kernels = [
        statement
        for statement in tree.body
        if isinstance(statement, ast.FunctionDef)
        and any("njit" in ast.unparse(decorator) for decorator in statement.decorator_list)
    ]
    assert kernels
    for kernel in kernels:
        used = {node.id for node in ast.walk(kernel) if isinstance(node, ast.Name)}
        assert not used & imported, kernel.name
