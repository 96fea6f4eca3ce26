"""Errors that the user can fix: one line, without a traceback."""


class UserError(Exception):
    """An error that the user can fix; its text is one line: what is wrong, where, what to do.

    The command line prints only the text and exits with `exit_code`.
    """

    exit_code = 2
    one_line = True


class ConfigurationError(UserError):
    """An invalid configuration: the text names the key, the fault and the valid values."""


class BelongsElsewhere(ConfigurationError):
    """A key or group that exists only with other options than the chosen ones."""


class FolderTaken(UserError):
    """Another process has already created the folder."""
