"""`stixel cache …` as the command line has it; the bodies are in `cache`."""

from typing import Annotated

import typer

from stixel_cli.cli.errors import interruptible
from stixel_cli.cli.options import Json

app = typer.Typer(rich_markup_mode=None, no_args_is_help=False)


@app.callback()
def cache() -> None:
    """See and tidy up the cache of results.

    It is the folder that STIXEL_CACHE names, else the user's cache; `cache.folder` of the
    configuration comes before both.
    """


@app.command("ls", short_help="What is in it, by stage.")
def ls(json: Json = False) -> None:
    """List what is in the cache by stage: entries, size, last use."""
    with interruptible():
        from stixel_cli.cli.cache import list_command

        code = list_command(json)
    raise typer.Exit(code)


@app.command("gc", short_help="Remove what was not used for long, or is too much.")
def gc(
    max_size: Annotated[
        str | None,
        typer.Option(metavar="SIZE", help="Keep at most this, such as 10GB; else the limit set."),
    ] = None,
    older_than: Annotated[
        str | None, typer.Option(metavar="AGE", help="Remove what was not used for, such as 30d.")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be removed; remove nothing.")
    ] = False,
    json: Json = False,
) -> None:
    """Remove the least recently used results, and what killed processes left.

    What a running process uses stays.

    Example: stixel cache gc --max-size 10GB --older-than 30d
    """
    with interruptible():
        from stixel_cli.cli.cache import collect_command

        code = collect_command(max_size, older_than, dry_run, json)
    raise typer.Exit(code)


@app.command("verify", short_help="Read every result; set bad ones aside.")
def verify(json: Json = False) -> None:
    """Read every result and check its digest.

    Bad ones are named, set aside, and computed again when they are needed. The exit code is then 1.
    """
    with interruptible():
        from stixel_cli.cli.cache import check_command

        code = check_command(json)
    raise typer.Exit(code)


@app.command("clear", short_help="Remove all but what is in use.")
def clear(
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not ask, as is done on a terminal.")
    ] = False,
    json: Json = False,
) -> None:
    """Remove all results but those that a running process uses.

    It asks before; where there is no terminal to ask at, --yes is needed.
    """
    with interruptible():
        from stixel_cli.cli.cache import clear_command

        code = clear_command(yes, json)
    raise typer.Exit(code)
