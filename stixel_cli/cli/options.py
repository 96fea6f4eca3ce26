"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli.completion import (
    complete_folder,
    complete_override,
    complete_study,
    complete_sweep,
)
from stixel_cli.errors import UserError

Overrides = Annotated[
    list[str] | None,
    typer.Argument(
        help="Changes to the default: GROUP=OPTION or KEY=VALUE, in Hydra's grammar.",
        metavar="OVERRIDES",
        autocompletion=complete_override,
        show_default=False,
    ),
]
SweepOverrides = Annotated[
    list[str] | None,
    typer.Argument(
        help="As in `stixel run`, plus several values: KEY=1,2 KEY=range(1,9,2) GROUP=glob(*).",
        metavar="OVERRIDES",
        autocompletion=complete_sweep,
        show_default=False,
    ),
]
StudyWords = Annotated[
    list[str] | None,
    typer.Argument(
        help="A study of pipelines/studies, or all; then overrides as in `stixel sweep`.",
        metavar="STUDY [OVERRIDES]",
        autocompletion=complete_study,
        show_default=False,
    ),
]
Folder = Annotated[
    Path,
    typer.Argument(
        help="Result folder of a run.",
        metavar="FOLDER",
        autocompletion=complete_folder,
        show_default=False,
    ),
]
RunOrSweep = Annotated[
    Path,
    typer.Argument(
        help="Result folder of a run or a sweep.",
        metavar="FOLDER",
        autocompletion=complete_folder,
        show_default=False,
    ),
]
Folders = Annotated[
    list[Path],
    typer.Argument(
        help="Result folders of two or more runs.",
        metavar="FOLDER",
        autocompletion=complete_folder,
        show_default=False,
    ),
]
ReportFolders = Annotated[
    list[Path],
    typer.Argument(
        help="Result folders of two or more runs, or the folder of one sweep.",
        metavar="FOLDER",
        autocompletion=complete_folder,
        show_default=False,
    ),
]
Name = Annotated[
    str | None,
    typer.Option(help="Name of the result folder (default: the changed settings, and the time)."),
]
StudyName = Annotated[
    str | None,
    typer.Option(
        help="Name of the result folder (default: the study's name, then the overrides).",
        metavar="<str>",
    ),
]
Output = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Output file (default: named after the runs)."),
]
Results = Annotated[
    Path, typer.Option(metavar="DIR", help="Folder in which to create the result folder.")
]
Workers = Annotated[
    int | None,
    typer.Option(min=1, max=4096, help="Number of workers; short for executor.workers=…"),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON only.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Print all scores, not only the main ones.")
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Print what would be computed; compute nothing.")
]
FromFile = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="FILE",
        help="YAML file of axes, seeds and excluded runs, or the name of one in pipelines/studies.",
    ),
]
Shuffle = Annotated[
    int | None,
    typer.Option(min=0, metavar="SEED", help="Shuffle the order of the runs with this seed."),
]
Pictures = Annotated[bool, typer.Option("--pictures", help="Draw the pictures of every run.")]


def _use_presets(folder: Path | None) -> Path | None:
    from stixel_cli.config.folders import use_presets

    use_presets(folder)
    return folder


ConfigDir = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Folder with presets of your own, laid out as conf/: DIR/GROUP/OPTION.yaml.",
        callback=_use_presets,
        is_eager=True,
    ),
]


def _trust_presets(trusted: bool) -> bool:
    from stixel_cli.config.folders import trust_presets

    trust_presets(trusted)
    return trusted


TrustCode = Annotated[
    bool,
    typer.Option(
        "--trust-code",
        help="Run user-defined code that a result folder, a file or presets refer to.",
        callback=_trust_presets,
    ),
]
Fresh = Annotated[
    bool, typer.Option("--fresh", help="Start over: delete the content of the study's folder.")
]


def check_output(output: Path | None) -> None:
    """Refuse an `--output` that exists.

    Raises:
        UserError: in one line.
    """
    if output is not None and output.exists():
        raise UserError(f"--output: {output} exists and is not overwritten; name another file")
