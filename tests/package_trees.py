"""The syntax trees of all modules of the package, parsed once."""

import ast
from functools import cache
from pathlib import Path

import stixel_cli

PACKAGE = Path(stixel_cli.__file__).parent


@cache
def trees() -> dict[str, ast.Module]:
    """Each module's path within the package, and its tree."""
    files = sorted(PACKAGE.rglob("*.py"))
    return {f.relative_to(PACKAGE).as_posix(): ast.parse(f.read_text("utf-8")) for f in files}
