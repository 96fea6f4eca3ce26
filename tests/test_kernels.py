"""Numba keeps compiled kernels by the content of their own file alone.

So a kernel that took a function or a constant from another file would run the old code after an
edit there, under the key of the new code.
"""

import ast
from pathlib import Path

import pytest

import stixel_cli

FILES = sorted(Path(stixel_cli.__file__).parent.rglob("*.py"))
FILES = [path for path in FILES if "import njit" in path.read_text("utf-8")]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_kernel_takes_nothing_from_another_file_and_makes_no_arrays(path):
    tree = ast.parse(path.read_text("utf-8"))
    imports = [one for one in tree.body if isinstance(one, ast.ImportFrom)]
    names = [one.names for one in imports if one.module.startswith("stixel_cli")]
    imported = {alias.asname or alias.name for aliases in names for alias in aliases}
    functions = [statement for statement in tree.body if isinstance(statement, ast.FunctionDef)]
    kernels = [f for f in functions if any("njit" in ast.unparse(d) for d in f.decorator_list)]
    assert kernels
    allowed = {f"np.{scalar}" for scalar in SCALARS} | {"math.erf"}
    for kernel in kernels:
        inside = [*ast.walk(ast.Module(kernel.body, []))]
        used = {node.id for node in inside if isinstance(node, ast.Name)}
        assert not used & imported, kernel.name
        # Numba compiles an allocation or a sum of an array as slowly as a loop: 5 s of all kernels.
        calls = [node.func for node in inside if isinstance(node, ast.Call)]
        methods = {ast.unparse(call) for call in calls if isinstance(call, ast.Attribute)}
        assert methods <= allowed, kernel.name


SCALARS = {"float32", "float64", "int32", "int64", "uint64"}
SCALARS |= {"ceil", "floor", "isnan", "log2", "sqrt"}
