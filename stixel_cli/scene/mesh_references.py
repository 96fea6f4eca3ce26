"""The files that a mesh file refers to: materials, textures, buffers.

Read from the text of Wavefront's .obj and .mtl, of .gltf, and of the head of .ply. The other
formats contain what they need, or refer to it in ways that are not read here.
"""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote

from stixel_cli.errors import UserError
from stixel_cli.files import opened, read_json

MAPS = (b"map_", b"bump", b"disp", b"decal", b"refl", b"norm")
"""How the lines of an .mtl begin that name an image, as their last word."""


def referred_files(path: Path) -> tuple[Path, ...]:
    """Existing files that the mesh file `path` refers to, directly or through a material."""
    found: dict[Path, None] = {}
    pending = [path]
    while pending:
        one = pending.pop(0)
        try:
            stat = one.stat()
            names = _names(one, stat.st_mtime_ns, stat.st_size)
        except (OSError, UserError):
            # The reader of the mesh reports files that cannot be read.
            continue
        for other in (one.parent / name for name in names):
            if other not in found and other != path and other.is_file():
                found[other] = None
                pending.append(other)
    return tuple(found)


@lru_cache(maxsize=64)
def _names(path: Path, *state: int) -> tuple[str, ...]:
    """The names in a file, read once for all runs of a sweep while its `state` is the same."""
    reader = {".obj": _of_obj, ".mtl": _of_mtl, ".gltf": _of_gltf, ".ply": _of_ply}.get(
        path.suffix.lower()
    )
    return () if reader is None else tuple(name for name in reader(path) if "\0" not in name)


def _of_obj(path: Path) -> Iterator[str]:
    with opened(path) as file:
        for line in file:
            if line.lstrip().startswith(b"mtllib"):
                # Several names, or one with blanks in it.
                rest = _text(line.split(maxsplit=1)[1:])
                yield from dict.fromkeys((rest, *rest.split()))


def _of_mtl(path: Path) -> Iterator[str]:
    with opened(path) as file:
        for line in file:
            if line.lstrip().lower().startswith(MAPS):
                rest = _text(line.split(maxsplit=1)[1:])
                yield from dict.fromkeys((rest, *rest.split()[-1:]))


def _of_gltf(path: Path) -> Iterator[str]:
    try:
        tree = read_json(path)
        entries = [*tree.get("buffers", ()), *tree.get("images", ())]
        names = [entry["uri"] for entry in entries if "uri" in entry]
        yield from (unquote(name) for name in names if not name.startswith("data:"))
    except (TypeError, AttributeError):
        return


def _of_ply(path: Path) -> Iterator[str]:
    with opened(path) as file:
        for line in file:
            if line.startswith(b"end_header"):
                return
            if line.startswith(b"comment TextureFile"):
                yield _text(line.split(maxsplit=2)[2:])


def _text(words: list[bytes]) -> str:
    return b" ".join(words).decode("utf-8", "replace").strip().replace("\\", "/")
