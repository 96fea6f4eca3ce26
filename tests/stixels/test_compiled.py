"""What Numba keeps of compiled code on the disk is as good as the text of one file."""

import ast
from pathlib import Path

import pytest

import stixel_cli

FOLDER = Path(stixel_cli.__file__).parent
KERNELS = [path for path in sorted(FOLDER.rglob("*.py")) if "@njit" in path.read_text("utf-8")]


@pytest.mark.parametrize("path", KERNELS, ids=lambda path: path.stem)
def test_compiled_functions_use_no_other_module(path):
    """Numba would not see an edit there: it looks at the file of the function that is called."""
    tree = ast.parse(path.read_text("utf-8"))
    imported = {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("stixel_cli")
        for alias in node.names
    }
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and any(
            "njit" in ast.unparse(decorator) for decorator in node.decorator_list
        ):
            body = [name for part in node.body for name in ast.walk(part)]
            used = {name.id for name in body if isinstance(name, ast.Name)}
            assert not used & imported, (node.name, used & imported)
