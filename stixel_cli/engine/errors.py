"""Errors of the engine. Those with `one_line` have a message of one line for the user."""

import errno
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from stixel_cli.errors import UserError


class CacheError(UserError):
    """The cache cannot be read or written."""


@dataclass(eq=False)
class MissingEntry(CacheError):
    """An entry is missing, or was damaged and, perhaps, `removed`."""

    key: str
    reason: str
    removed: bool = False

    def __str__(self) -> str:
        return f"cache entry {self.key[:12]}: {self.reason}"


_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Context that writes or locks files of the cache at `folder`; CacheError if it cannot."""
    try:
        yield
    except OSError as error:
        reason = f"{error.strerror or error}:"
        if error.errno in _NO_LOCKS:
            reason = "its file system does not support locks (flock): mount it with locks, or"
        choose = "choose another (cache.folder or STIXEL_CACHE)"
        raise CacheError(f"cannot write in the cache {folder}: {reason} {choose}") from error


class InvalidCode(UserError, LookupError):
    """A module is not valid Python, or declares files that it cannot have."""


class CodeChanged(UserError):
    """The code of a stage was edited after the graph was built."""


class WorkerDied(Exception):
    """A node crashed its worker twice, the second time while it ran on its own."""

    one_line = True


class TimeLimitExceeded(Exception):
    """A node exceeded its time limit and was ended."""

    one_line = True


class ExecutorError(UserError):
    """No workers are available, or all were lost."""


@dataclass(eq=False)
class StageFailure(Exception):
    """A stage failed."""

    stage: str
    """Its name."""
    label: str
    """Of the node, such as `average[0:10]`."""
    cause: BaseException
    """The exception."""
    traceback_text: str
    """In the worker."""
    own_files: frozenset[str] = frozenset()
    """The user's own code that the stage runs."""
    key: str = ""
    """Of the node; "" before the scheduler has set it."""

    def __post_init__(self):
        if self.cause.__traceback__ is None and self.traceback_text:
            # The frames were in another process. Python prints notes below the message.
            self.add_note(self.traceback_text)

    @property
    def place(self) -> str:
        """File, line and code where the stage raised: the innermost frame outside of libraries.

        "" if unknown.
        """
        frames = _FRAME.findall(self.traceback_text)
        if not frames:
            return ""
        own = [frame for frame in frames if frame[0] in self.own_files]
        own = own or [frame for frame in frames if _is_own(frame[0])]
        file, line, code = (own or frames)[-1]
        return f"{_near(file)}, line {line}: `{code.strip()}`"

    @property
    def is_about_input(self) -> bool:
        """Whether the message is about the stage's input or the machine, and not about code."""
        if any(frame[0] in self.own_files for frame in _FRAME.findall(self.traceback_text)):
            return False
        return isinstance(self.cause, ValueError) or hasattr(self.cause, "one_line")

    def __str__(self) -> str:
        text = f"{self.label}: {type(self.cause).__name__}: {self.cause}"
        return text if self.is_about_input or not self.place else f"{text} ({self.place})"


_FRAME = re.compile(r'^  File "([^"]+)", line (\d+), in .+\n    (.+)$', re.MULTILINE)
_PACKAGE = __name__.partition(".")[0]


def _is_own(file: str) -> bool:
    """Whether a file belongs to no library. This package counts wherever it is installed."""
    import sysconfig

    libraries = tuple(sysconfig.get_paths()[name] for name in ("stdlib", "purelib", "platlib"))
    return not file.startswith(libraries) or f"{os.sep}{_PACKAGE}{os.sep}" in file


def _near(file: str) -> str:
    """The path relative to the working directory, if the file is below it."""
    with suppress(OSError, ValueError):
        return str(Path(file).absolute().relative_to(Path.cwd()))
    return file
