"""What provides a module: an installed distribution, with its version, or a folder of the user."""

import inspect
import json
import re
import socket
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.machinery import PathFinder
from importlib.metadata import Distribution, PackageNotFoundError, distributions
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from stixel_cli.border.own_code import check_name
from stixel_cli.engine.errors import CodeChanged
from stixel_cli.errors import ConfigurationError, located, printable


def python_version() -> str:
    """Python version in keys, such as `3.11`."""
    return f"{sys.version_info.major}.{sys.version_info.minor}"


@cache
def installed_version(name: str) -> str | None:
    """Version of a distribution; None if it is not installed. Cached for the process."""
    with suppress(PackageNotFoundError):
        return _field(Distribution.from_name(name), "Version")
    return None


def _field(distribution: Distribution, name: str) -> str:
    """A field of a distribution's metadata; a parser takes longer than a whole search here."""
    notes = distribution.read_text("METADATA") or ""
    # The description may follow after an empty line.
    found = re.search(rf"^{name}: *(\S+)", notes.partition("\n\n")[0], re.MULTILINE)
    return found[1] if found else distribution.metadata[name]


def versions_of(tops: Iterable[str]) -> dict[str, str | None]:
    """Versions of the distributions that provide these top-level modules, by distribution.

    A module that belongs to no distribution appears under its own name.
    """
    names = {name for top in tops for name in providers().get(top, [top])}
    return {name: installed_version(name) for name in sorted(names)}


@cache
def providers() -> dict[str, list[str]]:
    """Distributions by the top-level module that they provide. Cached for the process.

    The same as `importlib.metadata.packages_distributions()`, which looks for every file of every
    distribution on the disk and takes eight times as long.
    """
    found: dict[str, list[str]] = {}
    for distribution in distributions():
        name = _field(distribution, "Name")
        for top in _top_levels(distribution):
            found.setdefault(top, []).append(name)
    return found


@cache
def is_editable(top: str) -> bool:
    """Whether `pip install -e` has installed a top-level module: its version names no code."""
    for name in providers().get(top, ()):
        with suppress(PackageNotFoundError, ValueError, AttributeError):
            origin = json.loads(Distribution.from_name(name).read_text("direct_url.json") or "{}")
            if origin.get("dir_info", {}).get("editable") is True:
                return True
    return False


def _top_levels(distribution: Distribution) -> set[str]:
    declared = (distribution.read_text("top_level.txt") or "").split()
    if declared:
        return set(declared)
    # One line per file: path, digest, size. An egg has no such file.
    record = distribution.read_text("RECORD") or "\n".join(map(str, distribution.files or ()))
    # Of a file in a folder only the folder counts; most files share a few folders.
    heads = set(re.findall(r'^"?([^,"/\n]+/?)', record, re.MULTILINE))
    names = {head[:-1] if head[-1:] == "/" else inspect.getmodulename(head) for head in heads}
    return {name for name in names if name and "." not in name}


def folder_of(key: str, function: str, places: Sequence[str]) -> str | None:
    """The folder of a function's module, one of `places` first; None if a distribution provides it.

    Nothing is imported. ConfigurationError, which begins with the `key` that names the function, if
    the module is missing, or has the name of another one.
    """
    with located(key, ConfigurationError):
        check_name(function)
    module = function.partition(":")[0]
    top = module.partition(".")[0]
    if top == __name__.partition(".")[0]:
        return None  # Of this program, also in its own checkout.
    local = next((place for place in places if _exists(place, top)), None)
    # Not as `find_spec`, which may answer with a module of the same name that is imported.
    spec = PathFinder.find_spec(top, [p for p in sys.path if p not in places])
    if spec is None and top in providers():
        with suppress(ImportError, ValueError):  # an editable install has its own finder
            spec = find_spec(top)
    where = None
    if spec is not None:
        first = next(iter(spec.submodule_search_locations or ()), spec.origin or "")
        where = str(Path(first).parent)
    taken = top in sys.stdlib_module_names or (top in providers() and where not in (None, local))
    if local is not None and taken:
        name = f"{local} has a module {top}, but this is the name of an installed one"
        raise ConfigurationError(f"{key}: {name}: rename the file")
    if local is None and where is None:
        missing = f"no module {printable(top)} found in {places[-1]}"
        raise ConfigurationError(f"{key}: {missing}, and no installed package has it")
    if local is None and top not in providers():
        local = where
    if local is not None and not _exists(local, module):
        raise ConfigurationError(f"{key}: no module {printable(module)} found in {local}")
    return local


def _exists(folder: str, module: str) -> bool:
    path = Path(folder, *module.split("."))
    return path.is_dir() or path.with_name(f"{path.name}.py").is_file()


def check_versions(notes: Mapping[str, Any]) -> None:
    """Raise CodeChanged unless Python and the packages have the planned versions.

    Workers on another machine may have other versions.
    """
    for name, planned in {"python": notes["python"], **notes["versions"]}.items():
        here = python_version() if name == "python" else installed_version(name)
        if here != planned:
            raise CodeChanged(
                f"worker on {socket.gethostname()}: has {name} {here}, but this run was "
                f"planned with {planned}"
            )
