"""The command `stixel`. Nothing heavy is imported before a command's body runs."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from stixel_cli import __version__
from stixel_cli.cli.completion import complete_override
from stixel_cli.cli.errors import guarded, interruptible
from stixel_cli.config.folders import group_options
from stixel_cli.errors import UserError

# Without Rich the help is there in half the time, and its boxes would hide the one line.
app = typer.Typer(
    name="stixel",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=False,
    context_settings={"help_option_names": ["--help", "-h"], "max_content_width": 100},
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code; nothing but an exit code comes out."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    return guarded(lambda: _run(given or ["--help"]))


def _run(arguments: list[str]) -> int:
    command = typer.main.get_command(app)
    try:
        return int(command.main(args=arguments, prog_name="stixel", standalone_mode=False) or 0)
    except typer.Abort:
        raise KeyboardInterrupt from None
    except typer.Exit as done:
        return done.exit_code
    except Exception as error:
        # The base class of usage errors is in another module with every second version of Typer.
        if hasattr(error, "format_message") and getattr(error, "exit_code", None) == 2:
            raise UserError(_usage(error)) from None
        raise


def _usage(error: Any) -> str:
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


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"stixel {__version__}")
        raise typer.Exit


@app.callback()
def stixel(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Experiments in extended target tracking on stixels.

    From a stereo rig's images to scored tracks.
    """


def _run_help() -> str:
    """The help of `run`, with the groups as they are in `conf/`."""
    try:
        groups = group_options()
    except (OSError, UserError):
        groups = {}
    many = [f"  {name}={'|'.join(these)}" for name, these in groups.items() if len(these) > 1]
    alone = ", ".join(name for name, these in groups.items() if len(these) == 1)
    return "\n".join(
        [
            "Run one experiment: scene, stereo, stixels, scans, track, scores and pictures.",
            "",
            "What was computed before, and would come out the same, is taken from the cache.",
            "",
            "\b",
            "Groups, each with its options:",
            *many,
            f"  and one option each in {alone}",
            "",
            "\b",
            "Keys of the chosen options, such as:",
            "  rig.width rig.horizontal_fov rig.baseline path.speed path.duration",
            "  tracker.basis_points tracker.length_scale tracker.sigma_f seed",
            "  (stixel run --dry-run prints them all)",
            "",
            "\b",
            "Examples:",
            "  stixel run",
            "  stixel run road_user=pedestrian path=crossing",
            "  stixel run measurement=fabricated tracker.length_scale=0.6 seed=3",
            "  stixel run rig=kitti stereo=bm --name kitti-bm",
            "  stixel run path=waypoints 'path.points=[[0,12],[3,15],[0,20]]' --workers 2",
        ]
    )


@app.command(short_help="Run one experiment.", help=_run_help())
def run(
    overrides: Annotated[
        list[str] | None,
        typer.Argument(
            help="What differs from the default: GROUP=OPTION or KEY=VALUE, in Hydra's grammar.",
            metavar="OVERRIDES",
            autocompletion=complete_override,
            show_default=False,
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="Name of the result folder; if not given, from time and choices."),
    ] = None,
    results: Annotated[
        Path, typer.Option(metavar="DIR", help="Where the result folder is made.")
    ] = Path("results"),
    workers: Annotated[int, typer.Option(min=1, max=256, help="Processes that compute.")] = 2,
    json: Annotated[
        bool, typer.Option("--json", help="Print the result as JSON, and nothing else, on stdout.")
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Print the configuration and what would run; do nothing."),
    ] = False,
) -> None:
    """See `_run_help`."""
    with interruptible():
        from stixel_cli.cli.run import run_command

        code = run_command(overrides or [], name, results, workers, json, dry_run)
    raise typer.Exit(code)


@app.command(short_help="Put runs side by side on one page.")
def report(
    folders: Annotated[
        list[Path],
        typer.Argument(help="Result folders of two or more runs.", show_default=False),
    ],
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
