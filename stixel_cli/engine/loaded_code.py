"""Whether the code that this process has imported is the code that was planned.

A key stands for the code as it was on the disk when the graph was built. A process that imported a
module before an edit, or imports it after one, would store the result of other code under that key.
"""

import socket
import sys
import threading
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from stixel_cli import FIRST_IMPORT
from stixel_cli.engine.bytecode import check_bytecode
from stixel_cli.engine.code import Code, CodeIndex, installed_version, same_files
from stixel_cli.engine.errors import CodeChanged
from stixel_cli.engine.keys import python_version

_started = FIRST_IMPORT
_lock = threading.Lock()
_imported: dict[str, str] = {}
"""Digest of each module's code when this process imported it."""


def may_run_here(code: Code) -> bool:
    """Whether this process can run the planned code, whatever it has imported already."""
    for module, (path, _) in code.files.items():
        if module in _imported:
            if _imported[module] != code.modules[module]:
                return False
        elif module in sys.modules and path.is_file() and path.stat().st_mtime > _started:
            return False
    return True


def planned_function(name: str, code: Code) -> Callable[..., Any]:
    """The function "package.module:function".

    Raises:
        LookupError: the module has no such function.
        CodeChanged: it is not the planned code, or that cannot be told: a module was edited, and
            this process had imported it some time before.
    """
    # Between the import and the note of it, another thread would take the module for an old one.
    with _lock:
        if not may_run_here(code):
            raise _changed(name)
        check_bytecode({module: path for module, (path, _) in code.files.items()})
        module, _, attribute = name.partition(":")
        function = getattr(import_module(module), attribute, None)
        if function is None:
            raise LookupError(f"module {module} has no function {attribute}")
        new = {module: file for module, file in code.files.items() if module not in _imported}
        # Equal bytes are enough; after an edit of a comment alone the digests decide.
        if not (same_files(new) or CodeIndex().code(code.roots).digest == code.digest):
            raise _changed(name)
        _imported.update(code.modules)
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
