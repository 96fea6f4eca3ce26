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
