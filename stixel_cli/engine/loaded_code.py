"""Whether the code that this process has imported is the code that was planned.

A key stands for the code as it was on the disk when the graph was built. A process that imported a
module before an edit, or imports it after one, would store the result of other code under that key.
"""

import socket
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from typing import Any

from stixel_cli import FIRST_IMPORT
from stixel_cli.engine.code_hash import CodeHash, CodeIndex, same_files
from stixel_cli.engine.errors import CodeChanged
from stixel_cli.engine.keys import installed_version, python_version

_started = FIRST_IMPORT
_lock = threading.Lock()
_parts: dict[str, str] = {}
_modules: dict[str, str] = {}
"""Digests of the code parts and of the modules' files when this process imported them."""


def may_run_here(code: CodeHash) -> bool:
    """Whether this process can run the planned code, whatever it has imported already."""
    if _is_stale(code):
        return False
    return not any(
        module in sys.modules and module not in _modules and path.stat().st_mtime > _started
        for module, (path, _) in code.files.items()
        if path.is_file()
    )


def planned_function(
    name: str, types: Iterable[tuple[str, str]], code: CodeHash
) -> Callable[..., Any]:
    """The function "package.module:function".

    Raises:
        CodeChanged: it is not the planned code, or that cannot be told: a module was edited, and
            this process had imported it some time before.
    """
    # Between the import and the note of it, another thread would take the module for an old one.
    with _lock:
        if not may_run_here(code):
            raise _changed(name)
        module, _, attribute = name.partition(":")
        function = getattr(import_module(module), attribute)
        new = {module: file for module, file in code.files.items() if module not in _modules}
        # The bytes of the files tell most often; a changed comment takes the longer way.
        if not (same_files(new) or CodeIndex().hash(name, types).digest == code.digest):
            raise _changed(name)
        _parts.update(code.parts)
        _modules.update({module: digest for module, (_, digest) in new.items()})
    return function


def _changed(function: str) -> CodeChanged:
    return CodeChanged(
        f"the code of {function} was edited after this run was planned or after this process "
        "had imported it: start again to use it"
    )


def check_versions(notes: Mapping[str, Any]) -> None:
    """Raise CodeChanged unless Python and the packages are here what they were in the plan.

    Where they differ is another machine's worker.
    """
    here = {"python": python_version()} | {
        name: installed_version(name) for name in notes["versions"]
    }
    planned = {"python": notes["python"], **notes["versions"]}
    for name, version in planned.items():
        if here[name] != version:
            raise CodeChanged(
                f"worker on {socket.gethostname()}: it has {name} {here[name]}, this run was "
                f"planned with {version}"
            )


def _is_stale(code: CodeHash) -> bool:
    """Whether a part is known to differ from what is imported, or cannot be known to agree."""
    for part, digest in code.parts.items():
        module = part.partition(":")[0]
        if part in _parts:
            if _parts[part] != digest:
                return True
        elif module in _modules and _modules[module] != code.files[module][1]:
            return True
    return False
