"""The border: all that a name from a file could do outside of this process goes through here.

No other module imports by name, unpickles, connects to an address, or opens a file for writing,
except where `tests/test_border.py` lists it with the reason. A name of code, a cache
and an address come with their `Origin`, which decides; a path of output must lie below the folder
that the command writes: docs/security.md has the rules.
"""

import os
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from io import BytesIO
from pathlib import Path, PurePosixPath
from types import ModuleType
from typing import TYPE_CHECKING, Any

from stixel_cli.errors import ConfigurationError, UserError, printable, printable_path

if TYPE_CHECKING:
    from distributed import Client

MOST_SHOWN = 2000
"""Characters of the names of code in one line: somebody reads them before he trusts them."""


@dataclass(frozen=True)
class Origin:
    """Where a name was written.

    Attributes:
        source: the file or folder that has it; "" if it was typed here or is shipped.
        trusted: whether the user trusts the code that the source names, by `--trust-code`.
    """

    source: str = ""
    trusted: bool = False


TYPED = Origin()
"""Typed by the user, or shipped. Names in a planned node are: they were admitted before."""

_told: set[tuple[str, Origin]] = set()


def admit(named: Iterable[tuple[str, Origin]]) -> None:
    """Let the names of code, caches and schedulers pass that were typed, or are trusted.

    What a trusted source names is told on stderr, once. ConfigurationError in one line, for names
    from a source that is not trusted.
    """
    by_origin: dict[Origin, dict[str, None]] = {}
    for name, origin in named:
        if origin.source and (name, origin) not in _told:
            by_origin.setdefault(origin, {})[name] = None
    for origin, names in sorted(by_origin.items(), key=lambda item: item[0].trusted):
        source, shown = printable_path(origin.source), printable(", ".join(names), MOST_SHOWN)
        if not origin.trusted:
            raise ConfigurationError(
                f"{source}: uses user-defined code ({shown}): review it, then add --trust-code"
            )
        _told.update((name, origin) for name in names)
        print(f"stixel: {source}: may run {shown} (--trust-code)", file=sys.stderr)  # noqa: T201


def forget_told() -> None:
    """Tell again what trusted sources name: another command begins."""
    _told.clear()


def _refuse(name: object, origin: Origin) -> None:
    """Raise ConfigurationError for a name that `admit` would refuse; what is trusted was told."""
    if origin.source and not origin.trusted:
        admit([(str(name), origin)])


def imported(module: str, origin: Origin) -> ModuleType:
    """The module of a dotted name; its own errors, or ConfigurationError as of `admit`."""
    _refuse(module, origin)
    return import_module(module)


def imported_file(file: Path, name: str, origin: Origin) -> ModuleType:
    """The module in a file, under a `name`; ImportError or its own errors as of `imported`."""
    _refuse(file, origin)
    spec = spec_from_file_location(name, file)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def unpickled(content: bytes) -> Any:
    """The object in bytes that this process, its scheduler or its worker has pickled."""
    import pickle

    return pickle.loads(content)


def cached(content: bytes) -> Any:
    """The object in the bytes of an entry of the cache, which was admitted."""
    # Its import takes as long as a few hundred loads; most commands load nothing.
    return import_module("joblib").load(BytesIO(content))


def connected(address: str, patience: float) -> "Client":
    """A client of the Dask scheduler at an address, admitted before; `patience` is in s.

    OSError or TimeoutError if it is silent.
    """
    client = import_module("distributed").Client
    return client(address, timeout=patience, set_as_default=False)


def write_whole(file: Path, content: str | bytes) -> None:
    """Write a file atomically; text in UTF-8. A link at its place is replaced, not followed.

    Missing parent folders are created, and removed again if the file cannot be written. OSError if
    it cannot be written; an older file is kept.
    """
    # Threads of a process may write the same file at once.
    partial = file.with_name(f".{file.name}.partial-{threading.get_native_id()}")
    missing = [folder for folder in file.parents if not folder.exists()]
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            partial.write_bytes(content.encode() if isinstance(content, str) else content)
            partial.replace(file)
        finally:
            partial.unlink(missing_ok=True)
    except OSError:
        for folder in missing:
            # Another process may have put something into it.
            with suppress(OSError):
                folder.rmdir()
        raise


def check_below(folder: Path, names: Iterable[str]) -> None:
    """Raise UserError for the first path that leads out of the folder, also by a link."""
    base = folder.resolve()
    for name in names:
        path = PurePosixPath(name)
        inside = (folder / name).parent.resolve().is_relative_to(base)
        if path.is_absolute() or ".." in path.parts or not path.name or not inside:
            raise UserError(f"{folder}: {printable(name)!r} is not a path below the folder")


def write_below(folder: Path, files: Mapping[str, str | bytes]) -> None:
    """Write files, by path below `folder`, each as `write_whole` does, which has the errors.

    Nothing is written if `check_below` refuses a path.
    """
    check_below(folder, files)
    for name, content in files.items():
        write_whole(folder / name, content)


def write_new(file: Path, content: str | bytes) -> None:
    """Write a new file; UserError if it exists, also as a link, or cannot be written."""
    try:
        with file.open("xb") as stream:
            stream.write(content.encode() if isinstance(content, str) else content)
            stream.flush()
            os.fsync(stream.fileno())
    except FileExistsError:
        raise UserError(f"{file}: already exists; choose another file") from None
    except OSError as error:
        raise UserError(f"{file}: cannot be written: {error.strerror}") from error


@contextmanager
def written(folder: Path) -> Iterator[None]:
    """Context in which `folder` is written to.

    UserError for an OSError in the context; it names the folder.
    """
    try:
        yield
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror or error}") from error
