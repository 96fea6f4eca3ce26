"""The source texts of the modules that results were computed with, to show later what changed.

They are a convenience: no result depends on them, and what cannot be written or read is left out.
"""

import difflib
import os
import shutil
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from stixel_cli.engine.code import Code

FOLDER = "sources"
UNUSED = 90 * 86400.0
"""Seconds after the last use at which a text is removed."""


def keep_sources(store_folder: Path, codes: Iterable[Code]) -> None:
    """Write the text of each module under its digest, where it is missing."""
    folder = store_folder / FOLDER
    files = {code.modules[name]: path for code in codes for name, (path, _) in code.files.items()}
    for digest, path in files.items():
        kept = folder / f"{digest}.py"
        with suppress(OSError):
            if kept.exists():
                os.utime(kept)
            elif path.suffix == ".py":
                folder.mkdir(parents=True, exist_ok=True)
                partial = folder / f"{digest}-{os.getpid()}.part"
                shutil.copyfile(path, partial)
                partial.replace(kept)


def source_difference(store_folder: Path, before: str, now: Path) -> tuple[str, ...]:
    """Lines of the unified difference between a module's old text and its file as it is now.

    `before` is the digest of the old module. The result is empty where the old text is unknown.
    """
    try:
        old = (store_folder / FOLDER / f"{before}.py").read_text("utf-8").splitlines()
        new = now.read_text("utf-8").splitlines()
    except (OSError, ValueError):
        return ()
    return tuple(difflib.unified_diff(old, new, "before", "now", lineterm="", n=1))


def remove_sources(store_folder: Path, everything: bool) -> None:
    """Remove all texts, or those that were not used for a long time."""
    folder = store_folder / FOLDER
    if everything:
        shutil.rmtree(folder, ignore_errors=True)
        return
    with suppress(OSError):
        for path in folder.iterdir():
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > UNUSED:
                    path.unlink()
