"""Arguments and options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli.completion import (
    complete_folder,
    complete_override,
    complete_study,
    complete_sweep,
)

Overrides = Annotated[
    list[str] | None,
    typer.Argument(
        help="What differs from the default: GROUP=OPTION or KEY=VALUE, in Hydra's grammar.",
        metavar="OVERRIDES",
        autocompletion=complete_override,
        show_default=False,
    ),
]
SweepOverrides = Annotated[
    list[str] | None,
    typer.Argument(
        help="As for `stixel run`, with several values: KEY=1,2 KEY=range(1,9,2) GROUP=glob(*).",
        metavar="OVERRIDES",
        autocompletion=complete_sweep,
        show_default=False,
    ),
]
StudyWords = Annotated[
    list[str] | None,
    typer.Argument(
        help="A study of pipelines/studies, or all; then what differs, as for `stixel sweep`.",
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
Folders = Annotated[
    list[Path],
    typer.Argument(
        help="Result folders of two or more runs.",
        metavar="FOLDER",
        autocompletion=complete_folder,
        show_default=False,
    ),
]
Name = Annotated[
    str | None, typer.Option(help="Name of the result folder; if not given, from time and choices.")
]
StudyName = Annotated[
    str | None,
    typer.Option(
        help="Name of the result folder (default: the study's name, then the overrides).",
        metavar="<str>",
    ),
]
Results = Annotated[Path, typer.Option(metavar="DIR", help="Where the result folder is made.")]
Workers = Annotated[
    int | None,
    typer.Option(min=1, max=4096, help="How many compute at a time: short for executor.workers=…"),
]
Json = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON, and nothing else, on stdout.")
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Print what would be done; do nothing.")]
FromFile = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="FILE",
        help="A YAML file, or one of pipelines/studies by name: axes, seeds, points left out.",
    ),
]
Shuffle = Annotated[
    int | None,
    typer.Option(min=0, metavar="SEED", help="Run the points in an order drawn with this seed."),
]
Pictures = Annotated[bool, typer.Option("--pictures", help="Draw the pictures of every point.")]
Fresh = Annotated[
    bool, typer.Option("--fresh", help="Begin anew, and take away what the study's folder holds.")
]
