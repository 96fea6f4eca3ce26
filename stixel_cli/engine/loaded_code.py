"""Check that this process runs the code that the keys were made from.

A key contains the code as it was on disk when the graph was built. A process that imported a module
before an edit, or imports it after one, would store the result of other code under that key. So
would a process that loads stale bytecode: Python trusts a `.pyc` file if the size and the
modification time of the source match, and some edits keep both (`cp -p`, `rsync -t`).

Numba looks only at the file of a compiled function: it would run the old code, and the old
constants, of the other files that went into it. So its cache of the user's functions has one folder
for each state of the code that they reach.

A worker cannot import a notebook: a function of one becomes a module in the cache, `function_name`.
"""

import importlib.util
import inspect
import marshal
import os
import py_compile
import shutil
import struct
import symtable
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from hashlib import sha256
from pathlib import Path
from textwrap import dedent
from types import CodeType, ModuleType
from typing import Any

from stixel_cli.border.origins import TYPED, imported, write_whole
from stixel_cli.engine.cache_folder import CELLS, make_folder
from stixel_cli.engine.code import Code, CodeIndex, same_files, search_also
from stixel_cli.engine.errors import CodeChanged
from stixel_cli.engine.parameters import default_cache_folder
from stixel_cli.errors import ConfigurationError
from stixel_cli.version import FIRST_IMPORT

_started = FIRST_IMPORT
_lock = threading.Lock()
_imported: dict[str, str] = {}
"""Digest of each module's code when it was imported."""


def may_run_here(code: Code) -> bool:
    """Whether the modules that this process has imported are the planned code."""
    for module, (path, _) in code.files.items():
        if module in _imported:
            if _imported[module] != code.modules[module]:
                return False
        elif module in sys.modules and path.is_file() and path.stat().st_mtime > _started:
            return False
    return True


def planned_function(name: str, code: Code) -> Callable[..., Any]:
    """Import the function "package.module:function".

    LookupError if the module has no such function; CodeChanged if it is not, or may not be, the
    planned code: a module was edited that this process had imported before.
    """
    # Without the lock, another thread could see the module imported but not yet in `_imported`.
    with _lock:
        if code.folders:
            search_also(code.folders)
        if not may_run_here(code):
            raise _changed(name)
        check_bytecode({module: path for module, (path, _) in code.files.items()})
        keep_apart(code)
        module, _, attribute = name.partition(":")
        loaded = imported(module, TYPED)
        function = getattr(loaded, attribute, None)
        if function is None:
            raise LookupError(f"{loaded.__file__ or module} has no function {attribute}")
        new = {module: file for module, file in code.files.items() if module not in _imported}
        # Equal files are enough; if only a comment was edited, the digests of the code are equal.
        same = same_files(new) or CodeIndex().code(code.roots, code.folders).digest == code.digest
        if not same:
            raise _changed(name)
        _imported.update(code.modules)
    return function


def import_function(name: str, code: Code) -> None:
    """The same as `planned_function`, without a result that another process could not load."""
    planned_function(name, code)


def current_function(name: str, folders: tuple[Path, ...]) -> Callable[..., Any]:
    """Import the user's function "module:function" as it is on disk, for a check before a run.

    If this process has imported an older version, as a notebook may have, its modules are imported
    again. Modules that it finds only in `folders` are looked for there. LookupError if there is no
    such module or function; and whatever the user's module raises.
    """
    module = name.partition(":")[0]
    code = CodeIndex().code([module], folders)
    # With the data files that the modules declare: a changed one is read when they are imported.
    files = {one: code.files[one][0] for one in code.modules_of_user if one in code.files}
    elsewhere = any(
        one in sys.modules and getattr(sys.modules[one], "__file__", None) != str(path)
        for one, path in files.items()
    )
    if elsewhere or not may_run_here(code):
        with _lock:
            for one, path in files.items():
                sys.modules.pop(one, None)
                _imported.pop(one, None)
                _checked.discard(path)
    importlib.invalidate_caches()
    return planned_function(name, code)


def _changed(function: str) -> CodeChanged:
    return CodeChanged(
        f"the code of {function} was edited after this run was planned or after this process "
        "had imported it: run the command again to use the new code"
    )


_BY_TIME, _BY_HASH = struct.pack("<I", 0), struct.pack("<I", 3)
"""Flags of a `.pyc` file: how Python checks it against the source (PEP 552)."""

_checked: set[Path] = set()


def check_bytecode(modules: Mapping[str, Path]) -> None:
    """Ensure that Python runs the current source of `modules` (name -> file).

    Bytecode is compared with its source once per process, and replaced by bytecode that Python
    itself checks by the hash of the source. CodeChanged if this process has imported stale
    bytecode, or it cannot be replaced.
    """
    for name, source in modules.items():
        if source not in _checked and source.suffix == ".py":
            _check(name, source)
            _checked.add(source)


def _check(name: str, source: Path) -> None:
    bytecode = Path(importlib.util.cache_from_source(source))
    try:
        content, text, state = bytecode.read_bytes(), source.read_bytes(), source.stat()
    except OSError:
        # There is no bytecode. A missing source is reported elsewhere.
        return
    flags = content[4:8]
    by_time = struct.pack("<II", int(state.st_mtime) & 0xFFFFFFFF, len(text) & 0xFFFFFFFF)
    ignored = content[:4] != importlib.util.MAGIC_NUMBER or (
        flags == _BY_TIME and content[8:16] != by_time
    )
    if ignored or flags == _BY_HASH:
        return
    same = _code(content) == compile(text, source, "exec", dont_inherit=True)
    if same and sys.dont_write_bytecode:
        return
    replaced = False
    with suppress(OSError):
        mode = py_compile.PycInvalidationMode.CHECKED_HASH
        py_compile.compile(str(source), str(bytecode), doraise=True, invalidation_mode=mode)
        replaced = True
    if not same and (name in sys.modules or not replaced):
        advice = "replaced; run the command again" if replaced else "delete it"
        raise CodeChanged(f"{bytecode}: stale bytecode of {source}: {advice}")


def _code(content: bytes) -> CodeType | None:
    """The code in a `.pyc` file; None if it is damaged."""
    with suppress(EOFError, ValueError, TypeError):
        return marshal.loads(content[16:])
    return None


PREFIX = "stixel-"

UNUSED = 90 * 86400.0
"""Seconds after the last use when a folder of Numba's cache is removed."""

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


def function_name(function: Callable[..., Any]) -> str:
    """The "module:function" of a function, for settings such as `tracker`.

    A worker cannot import a notebook or a script, so such a function is written to a module in the
    cache folder, with what it uses of the notebook: functions, imports and plain values.
    ConfigurationError for a function that no module can have.
    """
    module, name = function.__module__, getattr(function, "__qualname__", "")
    if not name.isidentifier():
        shown = name or type(function).__name__
        raise ConfigurationError(f"{shown}: must be a function with a name, not inside of another")
    if module == "__main__":
        sources: dict[str, str] = {}
        _add(name, function, inspect.unwrap(function).__globals__, sources)
        text = "\n\n".join(["# From a notebook or a script.", *sources.values()])
        module = f"{name}_{sha256(text.encode()).hexdigest()[:8]}"
        write_whole(make_folder(default_cache_folder(), CELLS) / f"{module}.py", text)
    return f"{module}:{name}"


def _add(name: str, value: Any, names: dict[str, Any], sources: dict[str, str]) -> None:
    """Add the source of `value`, after those of all that it uses of `names`."""
    if name in sources:
        return
    sources[name] = ""
    if isinstance(value, ModuleType):
        source = f"import {value.__name__} as {name}"
    elif value is None or isinstance(value, bool | int | float | str):
        source = f"{name} = {value!r}"
    elif not hasattr(value, "__qualname__"):
        kind = type(value).__name__
        raise ConfigurationError(f"{name}: is a {kind} of the notebook: make it in the function")
    elif value.__module__ != "__main__":
        source = f"from {value.__module__} import {value.__qualname__} as {name}"
    else:
        try:
            source = dedent(inspect.getsource(value))
        except (OSError, TypeError):
            raise ConfigurationError(f"{name}: has no source: import it from a file") from None
        for used in sorted(_global_names(symtable.symtable(source, name, "exec"))):
            if used in names:
                _add(used, names[used], names, sources)
    sources[name] = sources.pop(name) or source


def _global_names(table: symtable.SymbolTable) -> set[str]:
    """The names that a module's source takes from outside of its functions."""
    whole = table.get_type() == "module"
    own = {symbol.get_name() for symbol in table.get_symbols() if whole or symbol.is_global()}
    return own.union(*map(_global_names, table.get_children()))
