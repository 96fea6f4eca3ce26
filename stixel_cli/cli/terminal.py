"""Text, tables, JSON and errors on the terminal, where no foreign text may move the cursor.

Every error of a command is one line on stderr, and an exit code.
"""

import errno
import io
import json
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stixel_cli.config.folders import group_options
from stixel_cli.config.texts import suggestion
from stixel_cli.errors import Interrupted, UserError, escaped, printable, printable_path

CRASHED = 1
LONGEST_USAGE = 300
"""Characters of a usage error: it repeats the words that were typed."""

MULTIRUN = ("-m", "--multirun")
"""Hydra's options for several runs."""

_OF_THE_USER = (errno.ENAMETOOLONG, errno.EACCES)
"""Errors that any access to a typed path may raise."""

_OF_STDOUT = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EPIPE)
"""Errors of printing, which have no file name."""


def guarded(command: Callable[[], int]) -> int:
    """Exit code of `command()`; errors are reported in one line.

    A `UserError` is printed verbatim. A crash writes its traceback to a log file and names it.
    """
    try:
        code = command()
        # Report a full disk here, not by Python at its exit.
        sys.stdout.flush()
        return code
    except UserError as error:
        tell(str(error))
        return error.exit_code
    except KeyboardInterrupt:
        tell(str(Interrupted()))
        return Interrupted.exit_code
    except Exception as error:
        if isinstance(error, OSError) and error.errno in _OF_THE_USER and error.filename:
            tell(f"{printable_path(error.filename)}: {error.strerror}")
            return UserError.exit_code
        if isinstance(error, FileNotFoundError) and _working_directory_is_gone():
            tell("the working directory no longer exists: change to another one")
            return UserError.exit_code
        if isinstance(error, OSError) and error.errno in _OF_STDOUT and error.filename is None:
            if error.errno != errno.EPIPE:  # Else the reader has ended.
                tell(f"standard output: cannot be written: {error.strerror}")
            # Otherwise Python tries again at its exit and complains.
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115
        else:
            _tell_crash(error)
        return CRASHED


def settle_streams() -> None:
    """Make the standard streams usable, however the shell has set them up.

    A closed stream (`>&-`) is replaced by the null device. A character that the encoding lacks is
    escaped, as on stderr.
    """
    # In the order of their numbers, so that no file of ours is opened under one of them.
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _working_directory_is_gone() -> bool:
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def tell(message: str) -> None:
    """Print `stixel: message` on stderr as one line, whatever characters are in it."""
    line = printable(re.sub(r"\s", " ", f"stixel: {message}"), sys.maxsize)
    encoding = sys.stderr.encoding or "utf-8"
    line = line.encode(encoding, errors="backslashreplace").decode(encoding)
    print(line, file=sys.stderr)  # noqa: T201


def _tell_crash(error: Exception) -> None:
    import traceback

    from stixel_cli.engine.errors import StageFailure

    if isinstance(error, StageFailure):
        # The cause is more often the user's own code.
        head, cause, place = f"stage {error.label} failed", error.cause, error.place
    else:
        head, cause, place = "internal error, please report it", error, ""
    text = "".join(traceback.format_exception(error))
    what = printable(" ".join(f"{type(cause).__name__}: {cause}".split()), 200)
    line = f"{head}: {what}" + (f" ({place})" if place else "")
    try:
        tell(f"{line}; traceback: {_write_log(text)}")
    except OSError as fault:
        tell(f"{line}; no log could be written: {fault}")
        sys.stderr.write(text)


def _write_log(text: str) -> Path:
    import platform
    import time

    import platformdirs

    from stixel_cli.version import __version__

    folder = platformdirs.user_log_path("stixel", appauthor=False, ensure_exists=True)
    log = folder / f"crash-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.log"
    head = (
        f"stixel {__version__}, Python {platform.python_version()}, {platform.platform()}\n"
        f"{' '.join(sys.argv)}\n\n"
    )
    log.write_text(head + text, encoding="utf-8", errors="backslashreplace")
    return log


REPLACED = {
    "plan": "run, sweep or study with --dry-run",
    "rerun": "run FOLDER",
    "show": "ls FOLDER",
    "compare": "ls FOLDER FOLDER",
    "table": "report --format md, tex or csv",
    "figure": "report --format svg, pdf or png",
    "play": "report --play",
    "calibrate": "assess --calibrate",
    "learn-shape": "new class",
    "schema": "describe --schema FOLDER",
}
"""Commands of the last release to what replaces them; the next release forgets them."""


def usage_line(error: Any, words: Sequence[str]) -> str:
    """A usage error of the command line `words`: the fault, the nearest option, what to read."""
    text = " ".join(error.format_message().split()).rstrip(".?")
    text = (text[:1].lower() + text[1:]).replace(": Input should be ", ": must be ")
    text = text.replace(": Value error, ", ": ")
    text = text.partition(", unable to parse")[0].partition(". Did you mean")[0]
    context = getattr(error, "ctx", None)
    wrong = getattr(error, "option_name", None)
    if wrong and "no such option" in text:
        text = f"no such option {wrong}{_near_option(wrong, context)}"
    elif text.startswith("no such command"):
        name = text.split("'")[1]
        new = f"; did you mean stixel new tracker {name}?" * (words[0] == "new")
        text += suggestion(name, context.command.commands) or new
    elif text == "missing command":
        text += f": {', '.join(context.command.commands)}"
    if words[0] in REPLACED:
        return f"{words[0]} is gone: use stixel {REPLACED[words[0]]}"
    if text.startswith("no such command") and "=" in words[0]:
        return f"{words[0]}: the command is missing: did you mean stixel run {words[0]}?"
    if len(text) > LONGEST_USAGE:
        text = f"{text[: LONGEST_USAGE - 1]}…"
    # Of an option without its argument, the parser does not name the command.
    where = context.command_path if context is not None else f"stixel {words[0]}"
    return f"{text} (see {where} --help)"


def _near_option(wrong: str, context: Any) -> str:
    key = wrong.lstrip("-")
    if wrong in MULTIRUN:
        return "; `stixel sweep KEY=1,2,3` runs all combinations of several values"
    if key == "seed" or key.partition(".")[0] in group_options():
        return f"; did you mean {key}=… without the dashes?"
    parameters = context.command.params if context else []
    options = [name for parameter in parameters for name in parameter.opts]
    return suggestion(wrong, [*options, "--help"])


NARROW = 14
"""Characters to which the text of a column is wrapped before a column is left out."""

GAP = 3
"""Characters between two columns."""


class _Escaping:
    """A stream that escapes what would control the terminal; Rich writes to the stream itself."""

    def __init__(self, stream: Any):
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        """Write the text, escaped."""
        return self.rich_proxied_file.write(escaped(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


@contextmanager
def escaping() -> Iterator[None]:
    """Standard streams that escape invisible characters."""
    before = {name: getattr(sys, name) for name in ("stdout", "stderr")}
    ours = {name: _Escaping(stream) for name, stream in before.items()}
    vars(sys).update(ours)
    try:
        yield
    finally:
        # A stream that failed has been replaced, and stays so.
        vars(sys).update({n: before[n] for n in before if getattr(sys, n) is ours[n]})


def say(*lines: object) -> None:
    """Print lines verbatim on stdout."""
    sys.stdout.write("".join(f"{line}\n" for line in lines))


def say_wrapped(text: str, style: str = "") -> None:
    """Print a text on stdout, wrapped at its spaces; a longer word, like a path, stays whole."""
    from rich.console import Console

    width, console = shutil.get_terminal_size().columns, Console(highlight=False, soft_wrap=True)
    for line in textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False):
        console.print(escaped(line), style=style, markup=False)


def print_json(value: Any) -> None:
    """Print a value in plain types as JSON, in ASCII: nothing in it controls the terminal."""
    sys.stdout.write(json.dumps(value, indent=2, allow_nan=False) + "\n")


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    right: Collection[int] = (),
    leave_out: Sequence[int] = (),
) -> None:
    """Print a table that is no wider than the screen, if its words allow that.

    Lines break at spaces only, so that a path or a number stays whole. Cells are printed verbatim:
    brackets are not markup. Of the columns, by their indices, those in `right` are right-aligned,
    and those in `leave_out` not wrapped: if the screen is too narrow, they are left out in this
    order, and a line names them.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    header, *cells = [[Text(escaped(cell)) for cell in row] for row in (columns, *rows)]
    widths, least = [], []
    for i, (name, *column) in enumerate(zip(header, *cells, strict=False)):
        words = (word for cell in (name, *column) for word in cell.split(" "))
        longest_word = max((word.cell_len for word in words), default=0)
        widths.append(max(cell.cell_len for cell in (name, *column)))
        widest = max((cell.cell_len for cell in column), default=0)
        least.append(max(longest_word, widest if i in leave_out else min(widest, NARROW)))
    shown, screen = list(range(len(columns))), shutil.get_terminal_size().columns
    for i in leave_out:
        if _line_width(least, shown) > screen:
            shown.remove(i)
    while _line_width(widths, shown) > screen and any(widths[i] > least[i] for i in shown):
        widths[max(shown, key=lambda i: widths[i] - least[i])] -= 1
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for i in shown:
        table.add_column(header[i], justify="right" if i in right else "left", width=widths[i])
    for row in cells:
        table.add_row(*(row[i] for i in shown))
    Console(width=_line_width(widths, shown)).print(table)
    missing = [name for i, name in enumerate(columns) if i not in shown]
    if missing:
        say_wrapped(f"Not shown on a screen of {screen} columns: {'; '.join(missing)}")


def _line_width(widths: Sequence[int], shown: Sequence[int]) -> int:
    return sum(widths[i] for i in shown) + GAP * (len(shown) - 1)
