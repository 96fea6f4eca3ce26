"""Errors that the user can fix: one line, without a traceback."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unicodedata import category


class UserError(Exception):
    """An error that the user can fix; its text is one line: what is wrong, where, what to do.

    The command line prints only the text and exits with `exit_code`.
    """

    exit_code = 2
    one_line = True


class ConfigurationError(UserError):
    """An invalid configuration: the text names the key, the fault and the valid values."""


class ArgumentError(UserError, ValueError):
    """A wrong argument of a function of the Python interface: the text begins with its name."""


class BelongsElsewhere(ConfigurationError):
    """A key or group, `key`, that exists only with other options than the chosen ones."""

    def __init__(self, text: str, key: str = ""):
        super().__init__(text)
        self.key = key


class MissingData(UserError):
    """Data that only some machines have are missing."""


class Interrupted(UserError):
    """Ctrl-C; the text says what is kept."""

    exit_code = 130

    def __init__(
        self, text: str = "interrupted; what was computed is kept: repeat the command to resume"
    ):
        super().__init__(text)


class FolderTaken(UserError):
    """Another process has already created the folder."""


@contextmanager
def located(
    place: object, kind: type[Exception] = UserError, caught: Any = ValueError
) -> Iterator[None]:
    """Context whose errors `caught`, a class or several, become those of `kind`, after a `place`.

    Without a place, "", their text stays.
    """
    try:
        yield
    except caught as fault:
        raise kind(f"{place}: {fault}" if place else str(fault)) from None


def escaped(text: str) -> str:
    """The text with invisible characters escaped, but for line ends, tabs and spaces."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in "\n\t" or category(c) == "Zs" else printable(c) for c in text
    )


def printable(text: str, longest: int = 60) -> str:
    """The text on one line, cut to `longest` characters; invisible characters are escaped."""
    if len(text) > longest:
        text = text[: longest - 1] + "…"
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in text
    )


def printable_path(path: object) -> str:
    """A path or file name for a message, on one line and not too long."""
    return printable(str(path), 200)


def counted(count: int, noun: str) -> str:
    """A number with its noun, whose plural must be regular: `1 run`, `2 runs`."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
