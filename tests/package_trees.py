"""The syntax trees of all modules of the package, parsed once."""

import ast
from functools import cache
from pathlib import Path

import stixel_cli

PACKAGE = Path(stixel_cli.__file__).parent


@cache
def trees() -> dict[str, ast.Module]:
    """Each module's path within the package, and its tree."""
    return {
        path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted(PACKAGE.rglob("*.py"))
    }
