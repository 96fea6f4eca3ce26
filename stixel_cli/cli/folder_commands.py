"""The commands about result folders, as the command line has them; their bodies are elsewhere."""

from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli.completion import complete_folder
from stixel_cli.cli.errors import interruptible
from stixel_cli.cli.options import Folder, Folders, Json, Name, Results, Workers


def rerun(
    folder: Folder,
    name: Name = None,
    results: Results = Path("results"),
    workers: Workers = None,
    json: Json = False,
) -> None:
    """Run the configuration of a result folder again, into a new folder.

    Executor and cache are this machine's, the rest is the folder's.

    Example: stixel rerun results/wide-prior
    """
    with interruptible():
        from stixel_cli.cli.rerun import rerun_command

        code = rerun_command(folder, name, results, workers, json)
    raise typer.Exit(code)


def verify(
    folder: Folder,
    cached: Annotated[
        bool, typer.Option("--cached", help="Take from the cache what has not changed.")
    ] = False,
    workers: Workers = None,
    json: Json = False,
) -> None:
    """Run a result folder again and compare: is it identical?

    Everything is computed anew, away from the cache. If something differs: which stage first, by
    how much, and which version or function changed. The exit code is 0 if all results are
    identical, 1 if not.

    Example: stixel verify results/wide-prior
    """
    with interruptible():
        from stixel_cli.cli.verify import verify_command

        code = verify_command(folder, cached, workers, json)
    raise typer.Exit(code)


def ls(
    folder: Annotated[
        Path,
        typer.Argument(
            help="Where to look.", metavar="DIR", autocompletion=complete_folder, show_default=True
        ),
    ] = Path("results"),
    json: Json = False,
) -> None:
    """List the result folders below a folder, oldest first."""
    with interruptible():
        from stixel_cli.cli.ls import ls_command

        code = ls_command(folder, json)
    raise typer.Exit(code)


def show(folder: Folder, json: Json = False) -> None:
    """Show what a result folder tells: where it comes from, its scores, its stages.

    Example: stixel show results/wide-prior
    """
    with interruptible():
        from stixel_cli.cli.show import show_command

        code = show_command(folder, json)
    raise typer.Exit(code)


def compare(folders: Folders, json: Json = False) -> None:
    """Show settings that differ beside metrics that differ, of two or more runs.

    Example: stixel compare results/simulated results/fabricated
    """
    with interruptible():
        from stixel_cli.cli.compare import compare_command

        code = compare_command(folders, json)
    raise typer.Exit(code)


def report(
    folders: Folders,
    output: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The page to write; if not given, named by the runs."),
    ] = None,
) -> None:
    """Put two or more runs side by side on one page.

    The page shows the settings that differ, the metrics, and the errors over time.

    Example: stixel report results/simulated results/fabricated
    """
    with interruptible():
        from stixel_cli.cli.report import report_command

        code = report_command(folders, output)
    raise typer.Exit(code)


def play(
    folders: Annotated[
        list[Path],
        typer.Argument(
            help="Result folders of runs, or points of a sweep; several must be of one scene.",
            metavar="FOLDER",
            autocompletion=complete_folder,
            show_default=False,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The page to write; if not given, named by the runs."),
    ] = None,
    workers: Workers = None,
) -> None:
    """Write a page that plays a run back, or several runs of one scene over each other.

    What the cache lacks is computed. The page of one run is in its folder already, as index.html.

    \b
    Examples:
      stixel play results/gp results/point
      stixel play results/sweep/runs/0003
    """
    with interruptible():
        from stixel_cli.cli.play import play_command

        code = play_command(folders, output, workers)
    raise typer.Exit(code)


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    for command, help_line in (
        (rerun, "Run a result folder's configuration again."),
        (verify, "Run again and compare: identical, or what differs."),
        (ls, "List result folders."),
        (show, "Show one result folder."),
        (compare, "Settings and metrics of runs that differ."),
        (report, "Put runs side by side on one page."),
        (play, "A page that plays runs back."),
    ):
        app.command(short_help=help_line)(command)
