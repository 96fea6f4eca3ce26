"""How a command ends: one line on stderr and an exit code, whatever went wrong."""

import errno
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stixel_cli.config.folders import group_options
from stixel_cli.errors import UserError

CRASHED = 1

_OF_THE_USER = (errno.ENAMETOOLONG, errno.EACCES)
"""What any look at a path that was typed may end with, be it only whether something is there."""


class Interrupted(UserError):
    """Ctrl-C."""

    exit_code = 130

    def __str__(self) -> str:
        return "interrupted; what was computed is kept"


@contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C as an `Interrupted`; Typer would swallow it, or end the line, as its version goes."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted from None


def guarded(command: Callable[[], int]) -> int:
    """Exit code of `command()`, with its errors told in one line.

    A `UserError` is told as it is. A crash leaves its traceback in a log file that is named.
    """
    try:
        return command()
    except UserError as error:
        tell(str(error))
        return error.exit_code
    except KeyboardInterrupt:
        tell(str(Interrupted()))
        return Interrupted.exit_code
    except Exception as error:
        if isinstance(error, OSError) and error.errno in _OF_THE_USER and error.filename:
            tell(f"{error.filename}: {error.strerror}")
            return UserError.exit_code
        _tell_crash(error)
        return CRASHED


def tell(message: str) -> None:
    """Print `stixel: message` on stderr as one line, whatever characters are in it."""
    line = "".join(_shown(character) for character in f"stixel: {message}")
    encoding = sys.stderr.encoding or "utf-8"
    line = line.encode(encoding, errors="backslashreplace").decode(encoding)
    print(line, file=sys.stderr)  # noqa: T201


def _shown(character: str) -> str:
    if character.isprintable() or 0xD800 <= ord(character) <= 0xDFFF:
        return character
    return " " if character.isspace() else character.encode("unicode_escape").decode()


def _tell_crash(error: Exception) -> None:
    import traceback

    what = " ".join(f"{type(error).__name__}: {error}".split())
    if len(what) > 200:
        what = what[:199] + "…"
    text = "".join(traceback.format_exception(error))
    try:
        log = _write_log(text)
    except OSError as fault:
        tell(f"this is a defect of stixel: {what} (no log could be written: {fault})")
        sys.stderr.write(text)
        return
    tell(f"this is a defect of stixel: {what} (traceback: {log})")


def _write_log(text: str) -> Path:
    import platform
    import time

    import platformdirs

    from stixel_cli import __version__

    folder = platformdirs.user_log_path("stixel", appauthor=False, ensure_exists=True)
    log = folder / f"crash-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.log"
    head = (
        f"stixel {__version__}, Python {platform.python_version()}, {platform.platform()}\n"
        f"{' '.join(sys.argv)}\n\n"
    )
    log.write_text(head + text, encoding="utf-8", errors="backslashreplace")
    return log


def usage_line(error: Any) -> str:
    """A usage error in one line: what is wrong, what is near, and where to read on."""
    text = " ".join(error.format_message().split()).rstrip(".?")
    text = (text[:1].lower() + text[1:]).replace(": Input should be ", ": must be ")
    text = text.partition(", unable to parse")[0].replace(". Did you mean", "; did you mean")
    context = getattr(error, "ctx", None)
    wrong = getattr(error, "option_name", None)
    if wrong and "no such option" in text:
        text = f"no such option {wrong}{_near_option(wrong, context)}"
    where = context.command_path if context is not None else "stixel"
    mark = "?" if "; did you mean" in text and not text.endswith("?") else ""
    return f"{text}{mark} (see {where} --help)"


def _near_option(wrong: str, context: Any) -> str:
    from difflib import get_close_matches

    key = wrong.lstrip("-")
    if key == "seed" or key.partition(".")[0] in group_options():
        return f"; did you mean {key}=… without the dashes?"
    options = [name for one in context.command.params for name in one.opts] if context else []
    near = get_close_matches(wrong, [*options, "--help"], 1)
    return f"; did you mean {near[0]}?" if near else ""
