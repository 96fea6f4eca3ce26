"""The command `stixel`. Nothing heavy is imported before a command's body runs."""

import atexit
import gc
import os
import signal
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from stixel_cli import __version__
from stixel_cli.cli import cache_commands, folder_commands
from stixel_cli.cli.completion import complete_folder, complete_run_or_override
from stixel_cli.cli.errors import guarded, interruptible, settle_streams, usage_line
from stixel_cli.cli.options import (
    DryRun,
    Fresh,
    FromFile,
    Json,
    Name,
    Overrides,
    Pictures,
    Results,
    Shuffle,
    StudyName,
    StudyWords,
    SweepOverrides,
    Workers,
)
from stixel_cli.config.folders import group_options
from stixel_cli.engine.one_thread import ENVIRONMENT
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
    if arguments is None:
        # This is a process of its own, and NumPy, which reads these, is not imported yet.
        os.environ.update(ENVIRONMENT)
        settle_streams()
        # `kill` ends it as Ctrl-C does: workers first, and in one line.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        # A process that ends need not look through its objects for garbage: 0.25 s of a warm run.
        atexit.register(gc.freeze)
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
            raise UserError(usage_line(error)) from None
        raise


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
            *textwrap.wrap(
                f"and one option each in {alone}", 76, initial_indent="  ", subsequent_indent="    "
            ),
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
    overrides: Overrides = None,
    name: Name = None,
    results: Results = Path("results"),
    workers: Workers = None,
    json: Json = False,
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


@app.command(short_help="Run many experiments, what they share once.")
def sweep(
    overrides: SweepOverrides = None,
    file: FromFile = None,
    name: Name = None,
    results: Results = Path("results"),
    workers: Workers = None,
    shuffle: Shuffle = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Go on with a sweep: run what is missing or has failed; executor… and cache… can "
            "be others.",
            autocompletion=complete_folder,
        ),
    ] = None,
    pictures: Pictures = False,
    dry_run: DryRun = False,
    json: Json = False,
) -> None:
    """Run all combinations of several values; what they share is computed once.

    A combination, a seed with it, is called a point. One that fails fails alone. The folder holds a
    row a point, statistics over the seeds, and a figure for each axis.

    \b
    Examples:
      stixel sweep tracker.length_scale=0.2,0.4,0.8 seed='range(0,10)'
      stixel sweep road_user='glob(*)' path=turn,s_curve measurement=fabricated
      stixel sweep --resume results/sweep-20260101-120000
    """
    with interruptible():
        from stixel_cli.cli.sweep import sweep_command

        code = sweep_command(
            overrides or [], file, name, results, workers, json, dry_run, resume, shuffle, pictures
        )
    raise typer.Exit(code)


@app.command(short_help="Answer a research question: its sweeps, and a report.")
def study(
    words: StudyWords = None,
    name: StudyName = None,
    results: Results = Path("results"),
    workers: Workers = None,
    fresh: Fresh = False,
    dry_run: DryRun = False,
    json: Json = False,
) -> None:
    """Run a study of pipelines/studies and write its report, tables and figures.

    \b
    rq1  Are these stixels like those of The Stixel World?
    rq2  How does the tracker do on stixels, against lidar?
    rq3  What do fabricated measurements miss?
    all  The three, one after the other.

    One that was interrupted, or of which points failed, is gone on with by the same command. The
    statistics are refused until all of it is there.

    \b
    Examples:
      stixel study rq2
      stixel study rq2 road_user=car 'seed=range(0,3)' --name rq2-car
      stixel study all
    """
    with interruptible():
        from stixel_cli.cli.study import study_command

        code = study_command(words or [], name, results, workers, json, dry_run, fresh)
    raise typer.Exit(code)


@app.command(short_help="What a run or a sweep would compute.")
def plan(
    overrides: SweepOverrides = None,
    file: FromFile = None,
    workers: Workers = None,
    pictures: Pictures = False,
    json: Json = False,
) -> None:
    """Print points, nodes, nodes cached and nodes to run, by stage, with an estimate of the time.

    A point is one combination of values, a node one step of the computation (of a few frames,
    where it goes frame by frame), kept in the cache under its own key.

    Where no key has several values, it is what `stixel run` would compute, with its pictures; else
    what `stixel sweep` would, which draws none unless told to.

    \b
    Examples:
      stixel plan tracker.length_scale=0.5
      stixel plan tracker.length_scale=0.2,0.4,0.8 seed=0,1,2
    """
    with interruptible():
        from stixel_cli.cli.plan import plan_command

        code = plan_command(overrides or [], file, json, workers, pictures)
    raise typer.Exit(code)


@app.command(short_help="Why a run or a sweep would compute what it would.")
def explain(
    what: Annotated[
        list[str] | None,
        typer.Argument(
            help="A result folder, or overrides.",
            metavar="FOLDER|OVERRIDES",
            autocompletion=complete_run_or_override,
            show_default=False,
        ),
    ] = None,
    file: FromFile = None,
    json: Json = False,
) -> None:
    """Say of each node that would run why: new, a setting, a function, a version, evicted, input.

    Of several values, a file or the folder of a sweep, for all points together: each node once,
    with the points that need it. Pictures count where `stixel plan` counts them.

    \b
    Examples:
      stixel explain tracker.length_scale=0.5
      stixel explain tracker.length_scale=0.5,0.6 seed=0,1
      stixel explain results/wide-prior
    """
    with interruptible():
        from stixel_cli.cli.explain import explain_command

        code = explain_command(what or [], json, file)
    raise typer.Exit(code)


folder_commands.register(app)
app.add_typer(cache_commands.app, name="cache", short_help="See and tidy up the cache.")


@app.command(short_help="What this machine has of what is needed.")
def doctor(json: Json = False) -> None:
    """Look at versions, cores, threads, renderers, cache and disk.

    The exit code is 0 if the default experiment can run here, 1 if not.
    """
    with interruptible():
        from stixel_cli.cli.doctor import doctor_command

        code = doctor_command(json)
    raise typer.Exit(code)
