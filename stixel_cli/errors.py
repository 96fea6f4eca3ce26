"""Errors that are the user's to mend: told in one line, with no traceback."""


class UserError(Exception):
    """Something the user can put right; its text is one line that says what and how.

    The command line prints the text alone and exits with `exit_code`.
    """

    exit_code = 2
    one_line = True


class ConfigurationError(UserError):
    """A configuration that cannot be run: the text names the key, the fault and what is right."""


class BelongsElsewhere(ConfigurationError):
    """A key or group that is there only with other options than those that are chosen."""


class FolderTaken(UserError):
    """Another process has made a folder that was to be made."""


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
