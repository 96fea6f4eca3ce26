"""The files that a mesh file refers to: materials, textures and buffers."""

import re
from pathlib import Path
from urllib.parse import unquote

from stixel_cli.errors import UserError
from stixel_cli.files import GREATEST_ARRAYS, read_bytes
from stixel_cli.remembered import remembered

ENDS = re.compile(rb"\.(?:mtl|bin|png|jpe?g|bmp|tga|webp|gif|tiff?)\b", re.IGNORECASE)
"""Ends of the names that are looked for."""

LONGEST = 255
"""Bytes of a line, up to the end of a name, in which the name is looked for."""


def referred_files(path: Path) -> tuple[Path, ...]:
    """Existing files that the mesh file `path` refers to, directly or through a material.

    They are in the folder of `path` or in one below it: others are left out.
    """
    referred: dict[Path, None] = {}
    pending = [path]
    while pending:
        file = pending.pop(0)
        try:
            names = _names(file)
        except UserError:
            # The reader of the mesh reports files that cannot be read.
            continue
        for name in names:
            other = file_beside(path, name)
            if other is not None and other not in referred and other != path:
                referred[other] = None
                pending += [other] if other.suffix.lower() == ".mtl" else []
    return tuple(referred)


def file_beside(path: Path, line: str) -> Path | None:
    """The regular file in the folder of `path`, or in one below, whose name ends `line`, if any.

    A line has a name that may have blanks, or several names, or options and a name.
    """
    words = unquote(line.replace("\\", "/")).split()
    for start in range(len(words)):
        file = path.parent / " ".join(words[start:])
        try:
            if file.is_file() and file.resolve().is_relative_to(path.parent.resolve()):
                return file
        except (OSError, ValueError):
            continue  # Too long for a name, or with a null byte.
    return None


@remembered
def _names(path: Path) -> tuple[str, ...]:
    """Lines that end with a name, read once for all runs of a sweep."""
    content = read_bytes(path, GREATEST_ARRAYS)
    lines = (
        content[max(0, found.end() - LONGEST) : found.end()] for found in ENDS.finditer(content)
    )
    ends = (re.split(rb"[\r\n\"]", line)[-1] for line in lines)
    return tuple(dict.fromkeys(end.decode("utf-8", "replace") for end in ends))
