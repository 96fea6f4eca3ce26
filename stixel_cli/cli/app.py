"""The command `stixel`. Its commands are in the other files; heavy imports wait in their bodies."""

import gc
import os
import signal
import sys
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import typer
from typer.core import TyperGroup

from stixel_cli.cli import options
from stixel_cli.cli.bench import app as bench
from stixel_cli.cli.describe import describe
from stixel_cli.cli.images import app as new
from stixel_cli.cli.images import assess, stixels
from stixel_cli.cli.machine import app as cache
from stixel_cli.cli.machine import doctor
from stixel_cli.cli.report import ls, report
from stixel_cli.cli.run import export, run, verify
from stixel_cli.cli.study import study
from stixel_cli.cli.sweep import explain, sweep, tune
from stixel_cli.cli.terminal import escaping, guarded, say, settle_streams, usage_line
from stixel_cli.engine.limits import ENVIRONMENT
from stixel_cli.errors import Interrupted, UserError
from stixel_cli.version import __version__

_GROUPS: dict[str, tuple[Callable[..., int] | typer.Typer, ...]] = {
    "Run experiments": (run, sweep, study, tune, bench),
    "Look at results and settings": (report, ls, describe, explain),
    "Check results and this machine": (verify, doctor, cache),
    "Data in and out, code of your own": (stixels, assess, export, new),
}
"""Heading of the help to its commands, in the order in which they are printed."""


def _name(command: Callable[..., int] | typer.Typer) -> str:
    return command.info.name if isinstance(command, typer.Typer) else command.__name__


class _Commands(TyperGroup):
    def format_commands(self, context: Any, formatter: Any) -> None:
        """Print the commands under their headings, all texts in one column."""
        width = max(map(len, self.commands))
        for heading, commands in _GROUPS.items():
            with formatter.section(heading):
                shown = ((name, self.commands[name]) for name in map(_name, commands))
                texts = [(n.ljust(width), c.get_short_help_str(90 - width)) for n, c in shown]
                formatter.write_dl(texts)

    def invoke(self, context: Any) -> Any:
        """Raise Ctrl-C as `Interrupted`: some versions of Typer print an empty line for it."""
        try:
            return super().invoke(context)
        except KeyboardInterrupt:
            raise Interrupted from None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code. Raises nothing."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if arguments is None:
        # This is a process of its own, and NumPy, which reads these, is not imported yet.
        os.environ.update(ENVIRONMENT)
        # Pydantic would look for plugins in all installed packages.
        os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
        settle_streams()
        # `kill` ends the process as Ctrl-C does: first the workers, then one line.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        # Imports make objects that stay: to search them for garbage after every 700 new ones, as is
        # the default, takes a twentieth of a warm run.
        gc.set_threshold(500_000)
    with escaping():
        return guarded(lambda: _run(given or ["--help"]))


def _run(arguments: list[str]) -> int:
    command = typer.main.get_command(application(arguments[0]))
    try:
        return int(command.main(args=arguments, prog_name="stixel", standalone_mode=False) or 0)
    except typer.Abort:
        raise KeyboardInterrupt from None
    except typer.Exit as done:
        return done.exit_code
    except Exception as error:
        # The base class of usage errors is in another module with every second version of Typer.
        if hasattr(error, "format_message") and getattr(error, "exit_code", None) == 2:
            raise UserError(usage_line(error, arguments)) from None
        raise


def _show_version(wanted: bool) -> None:
    if wanted:
        say(f"stixel {__version__}")
        raise typer.Exit


def stixel(
    version: options.option(
        bool,
        "Print the version and exit.",
        None,
        "--version",
        callback=_show_version,
        is_eager=True,
    ) = False,
) -> None:
    """Run experiments in extended target tracking on stixels.

    From a stereo rig's images to scored tracks.

    \b
    Begin with:
      stixel run measurement=fabricated   a run of a few seconds
      stixel describe                     what can be chosen
    """


def application(word: str) -> typer.Typer:
    """`stixel` with the command `word`; with all if it is not a command: these take 0.03 s."""
    # Without Rich the help takes half the time, and no boxes surround the one line of an error.
    app = typer.Typer(
        name="stixel",
        cls=_Commands,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["--help", "-h"], "max_content_width": 100},
    )
    app.callback()(stixel)
    commands = [*chain.from_iterable(_GROUPS.values())]
    for command in [one for one in commands if _name(one) == word] or commands:
        if isinstance(command, typer.Typer):
            app.add_typer(command)
        else:
            app.command()(command)
    return app
