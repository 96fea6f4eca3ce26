"""Which kernels are still to be compiled."""

import ast
import os
import re

from stixel_cli.machine import kernels


def test_the_modules_with_kernels_are_named():
    found = {
        ".".join(file.relative_to(kernels.PACKAGE).with_suffix("").parts)
        for file in kernels.PACKAGE.rglob("*.py")
        if re.search(r"^from numba import .*\bnjit\b", file.read_text(encoding="utf-8"), re.M)
    }
    assert found == set(kernels.KERNELS)


SCALARS = {"float32", "float64", "int32", "int64", "uint64"}
SCALARS |= {"ceil", "floor", "isnan", "log2", "sqrt"}


def test_kernels_make_no_arrays():
    """Numba compiles an allocation or a sum of an array as slowly as a loop: 5 s of all kernels."""
    dear = []
    for name in kernels.KERNELS:
        file = kernels.PACKAGE.joinpath(*name.split(".")).with_suffix(".py")
        for function in ast.parse(file.read_text(encoding="utf-8")).body:
            if any("njit" in ast.unparse(d) for d in getattr(function, "decorator_list", ())):
                calls = [node.func for node in ast.walk(function) if isinstance(node, ast.Call)]
                methods = {ast.unparse(call) for call in calls if isinstance(call, ast.Attribute)}
                allowed = {f"np.{scalar}" for scalar in SCALARS} | {"math.erf"}
                # The decorator is a call of a name.
                dear += [f"{name}.{function.name}: {call}" for call in methods - allowed]
    assert not dear, dear


def test_a_module_is_compiled_if_its_index_is_not_older(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(kernels, "PACKAGE", tmp_path)
    monkeypatch.setattr(kernels, "KERNELS", ("a.one", "a.two", "a.three"))
    (tmp_path / "a" / "__pycache__").mkdir(parents=True)
    for name, ages in (("one", (5, 9)), ("two", (9, 5)), ("three", (5,))):
        source = tmp_path / "a" / f"{name}.py"
        index = tmp_path / "a" / "__pycache__" / f"{name}.kernel-1.py312.nbi"
        for file, age in zip((source, index), ages, strict=False):
            file.write_text("")
            os.utime(file, (age, age))
    assert kernels.uncompiled() == {"stixel_cli.a.two", "stixel_cli.a.three"}
    monkeypatch.setenv("NUMBA_CACHE_DIR", "elsewhere")
    assert kernels.uncompiled() == frozenset()
