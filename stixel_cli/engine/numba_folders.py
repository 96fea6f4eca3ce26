"""Numba's cache of the user's functions: one folder for each state of the code that they reach.

Numba looks only at the file of a compiled function: it would run the old code, and the old
constants, of the other files that went into it.
"""

import os
import shutil
import time
from contextlib import suppress
from functools import cache, lru_cache
from hashlib import sha256
from pathlib import Path

from stixel_cli.engine.code import Code, CodeIndex
from stixel_cli.engine.source_files import UNUSED

PREFIX = "stixel-"
_digests: dict[str, str] = {}
"""Digest of the code that each of the user's files reaches."""


def keep_apart(code: Code) -> None:
    """Make Numba keep the functions of the user's modules by their code; before their import."""
    if code.of_user and "numba" in code.versions:
        _install()
        digest = _digest(tuple(code.of_user), code.folders, code.digest)
        _digests.update(dict.fromkeys(map(os.path.abspath, code.of_user.values()), digest))


@lru_cache(maxsize=100)
def _digest(modules: tuple[str, ...], folders: tuple[Path, ...], _: str) -> str:
    # Without the stage's own modules, which the main process does not reach before it is planned.
    reached = CodeIndex().code(modules, folders)
    versions = " ".join(f"{name} {version}" for name, version in reached.versions.items())
    return sha256(f"{reached.digest} {versions}".encode()).hexdigest()[:16]


class _OfUser:
    """A locator of Numba's for the user's files only, with a folder of their digest."""

    @classmethod
    def from_function(cls, py_func, py_file):
        known = os.path.abspath(py_file) in _digests
        return super().from_function(py_func, py_file) if known else None

    def get_cache_path(self):
        digest = _digests[os.path.abspath(self._py_file)]
        return os.path.join(super().get_cache_path(), f"{PREFIX}{digest}")

    def ensure_cache_path(self):
        super().ensure_cache_path()
        os.utime(self.get_cache_path())
        for other in Path(super().get_cache_path()).glob(f"{PREFIX}*"):
            # Another process may have removed it: an error here would mean another locator.
            with suppress(OSError):
                if time.time() - other.stat().st_mtime > UNUSED:
                    shutil.rmtree(other, ignore_errors=True)


@cache
def _install() -> None:
    from numba.core import caching

    # Earlier versions of Numba name it with an underscore.
    cache_class = getattr(caching, "CacheImpl", None) or caching._CacheImpl
    locators = cache_class._locator_classes
    locators[:0] = [type(one)(f"{one.__name__}OfUser", (_OfUser, one), {}) for one in locators]
