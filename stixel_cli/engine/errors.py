"""What can go wrong in the engine. Messages are one line, made to be shown to the user."""

import os.path
import re
import sysconfig


class CacheError(Exception):
    """The cache cannot be read or written."""

    one_line = True


class MissingEntry(CacheError):
    """An entry is not there, or was damaged and has been set aside."""

    def __init__(self, key: str, reason: str, set_aside: bool = False):
        super().__init__(key, reason, set_aside)
        self.key = key
        self.reason = reason
        self.set_aside = set_aside

    def __str__(self) -> str:
        return f"cache entry {self.key[:12]}: {self.reason}"


class CodeChanged(Exception):
    """The code of a stage was edited after the run had been planned."""

    one_line = True


class WorkerDied(Exception):
    """A node killed its worker twice, the second time with nothing else running."""

    one_line = True


class TimeLimitExceeded(Exception):
    """A node took longer than it may, and was killed."""

    one_line = True


class ExecutorError(Exception):
    """The workers cannot be had, or were lost for good."""

    one_line = True


class StageFailure(Exception):
    """A stage raised.

    Attributes:
        stage: name of the stage.
        label: its node, such as `render[0:10]`.
        cause: what it raised.
        traceback_text: the traceback of where it ran.
    """

    def __init__(self, stage: str, label: str, cause: BaseException, traceback_text: str):
        super().__init__(stage, label, cause, traceback_text)
        self.stage = stage
        self.label = label
        self.cause = cause
        self.traceback_text = traceback_text
        # Python prints notes below the message: the frames of a worker are in no other place.
        self.add_note(traceback_text)

    @property
    def place(self) -> str:
        """File, line and code where the stage raised: the innermost frame outside of libraries.

        "" where that is not known.
        """
        frames = _FRAME.findall(self.traceback_text)
        own = [frame for frame in frames if _is_own(frame[0])]
        if not frames:
            return ""
        file, line, code = (own or frames)[-1]
        return f"{_near(file)}, line {line}: `{code.strip()}`"

    def __str__(self) -> str:
        return f"{self.label}: {type(self.cause).__name__}: {self.cause}"


_FRAME = re.compile(r'^  File "([^"]+)", line (\d+), in .+\n    (.+)$', re.MULTILINE)
_PACKAGE = __name__.partition(".")[0]
_LIBRARIES = tuple(sysconfig.get_paths()[name] for name in ("stdlib", "purelib", "platlib"))


def _is_own(file: str) -> bool:
    """Whether a file is no library's: this package counts wherever it is installed."""
    return not file.startswith(_LIBRARIES) or f"{os.sep}{_PACKAGE}{os.sep}" in file


def _near(file: str) -> str:
    """The file's path from the working directory on, where it is below it."""
    try:
        path = os.path.relpath(file)
    except (OSError, ValueError):
        return file
    return file if path.startswith(os.pardir) else path
