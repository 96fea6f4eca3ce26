"""Bytecode that is not that of its source.

Python believes a `.pyc` file by the size and the modification time of the source. An edit that
keeps both (`cp -p`, `rsync -t`, images with fixed times) has it run the code from before the edit,
while the key of a result comes from the source.
"""

import importlib.util
import marshal
import py_compile
import struct
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import CodeType

from stixel_cli.engine.errors import CodeChanged

_BY_TIME, _BY_HASH = struct.pack("<I", 0), struct.pack("<I", 3)
"""Flags of a file of bytecode: how Python checks it against the source (PEP 552)."""

_checked: set[Path] = set()


def check_bytecode(modules: Mapping[str, Path]) -> None:
    """See that Python runs the source of `modules`: name to file, imported by now or soon.

    Bytecode is compared with the source once; then Python checks it by the source's hash, each
    time that it loads it. Bytecode that is wrong is replaced.

    Raises:
        CodeChanged: this process has imported wrong bytecode, or it cannot be replaced.
    """
    for name, source in modules.items():
        if source not in _checked:
            _check(name, source)
            _checked.add(source)


def _check(name: str, source: Path) -> None:
    bytecode = Path(importlib.util.cache_from_source(source))
    try:
        content, text, state = bytecode.read_bytes(), source.read_bytes(), source.stat()
    except OSError:
        # There is no bytecode. Others report a source that is missing.
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
        raise CodeChanged(
            f"{bytecode}: is the bytecode of another text than that of {source}: "
            + ("start again to use the new bytecode" if replaced else "delete it")
        )


def _code(content: bytes) -> CodeType | None:
    """The code in the content of a file of bytecode; None if it is damaged."""
    try:
        return marshal.loads(content[16:])
    except (EOFError, ValueError, TypeError):
        return None
