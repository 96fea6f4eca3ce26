"""Arguments and options that several commands share."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from stixel_cli.cli.completion import complete_folder, complete_override, complete_run_or_override
from stixel_cli.config.folders import trust_presets, use_presets
from stixel_cli.config.texts import override_text, split_override
from stixel_cli.errors import UserError, printable_path


def argument(help: str, metavar: str, complete: Callable[[str], Any]) -> Any:
    """An argument of a command; `complete` gives the words that Tab completes to."""
    return typer.Argument(help=help, metavar=metavar, autocompletion=complete, show_default=False)


def new_file(output: Path | None) -> Path | None:
    """`output`, a file or folder; UserError if it exists."""
    if output is not None and output.exists():
        raise UserError(f"--output: {output} exists and is not overwritten; name another")
    return output


def result_folder(words: Sequence[str]) -> Path | None:
    """The result folder that a command line has in place of overrides; None if it has overrides.

    UserError for a folder with further words. The folder may be missing.
    """
    folder = next((word for word in words if _names_folder(word)), None)
    if folder is not None and len(words) > 1:
        raise UserError(f"{printable_path(folder)}: name either one result folder or overrides")
    return None if folder is None else Path(folder)


def _names_folder(word: str) -> bool:
    """Whether a word is a path. The default name of a result folder has `=`, as an override has."""
    if "=" not in word:
        return os.sep in word or os.path.isdir(word)
    # Named as in `results.reader`, which imports NumPy.
    files = ("manifest.json", "sweep.yaml")
    return any(os.path.isfile(os.path.join(word, file)) for file in files)


def with_workers(overrides: Sequence[str], workers: int | None) -> list[str]:
    """`overrides`, with `--workers` as the override `executor.workers`."""
    return [*overrides, *([] if workers is None else [f"executor.workers={workers}"])]


def recording_overrides(
    command: str, words: Sequence[str], files: Mapping[str, Path | None]
) -> list[str]:
    """The overrides that the words of a command line stand for; [] without words.

    Words without = are two images or one recording. Added is what a recording without a target
    needs, on which no stixel depends. `files` has the keys of
    `source` that belong to two images, with their files; the calibration is required.

    Raises:
        UserError: for another number of files than one or two, or options that do not belong.
    """
    named = [word for word in words if "=" not in word]
    given = {key: file for key, file in files.items() if file is not None}
    if len(named) == 2:
        if "calibration" not in given:
            raise UserError("--rig: is required with two images: KITTI's file or a rig.yaml")
        settings = {"source": "pair", "source.left": named[0], "source.right": named[1]}
        settings |= {f"source.{key}": str(file) for key, file in given.items()}
    elif given:
        option = next(iter(given)).replace("calibration", "rig")
        raise UserError(f"--{option}: belongs to two images: give LEFT and RIGHT")
    elif len(named) > 2:
        raise UserError(
            f"{command} needs two images, LEFT and RIGHT, or one recording, got {len(named)}: "
            f"{printable_path(named[0])} …"
        )
    else:
        settings = {"source.folder": named[0]} if named else {}
    typed = [word for word in words if "=" in word]
    needed = {"road_user": "car", "start": "scans", "start.bearing": [-45, 45]} if words else {}
    names = {split_override(text)[0] for text in typed}
    settings |= {key: value for key, value in needed.items() if key not in names}
    return [*typed, *(override_text(key, value) for key, value in settings.items())]


Overrides = Annotated[
    list[str] | None,
    argument(
        "Changes to the default: GROUP=OPTION or KEY=VALUE, in Hydra's grammar. Or the result "
        "folder of a run to repeat.",
        "OVERRIDES|FOLDER",
        complete_run_or_override,
    ),
]
SweepOverrides = Annotated[
    list[str] | None,
    argument(
        "As in `stixel run`, plus several values: KEY=1,2 KEY=range(1,9,2) GROUP=glob(*).",
        "OVERRIDES",
        complete_override,
    ),
]
RigFile = Annotated[
    Path | None,
    typer.Option(
        "--rig",
        "--calib",
        help="Calibration of two images: of KITTI, Middlebury, ROS, OpenCV, or a rig.yaml.",
        metavar="FILE",
    ),
]
ImagesOrRecording = Annotated[
    list[str] | None,
    argument(
        "The left and the right image, or the folder or bag of a recording; then overrides as for "
        "run.",
        "LEFT RIGHT|RECORDING [OVERRIDE]",
        complete_override,
    ),
]
Folder = Annotated[Path, argument("Result folder of a run.", "FOLDER", complete_folder)]
Folders = Annotated[list[Path], argument("Result folders of runs.", "FOLDER", complete_folder)]
Name = Annotated[
    str | None,
    typer.Option(help="Name of the result folder (default: the changed settings, and the time)."),
]
Output = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Output file (default: named after the runs).", callback=new_file
    ),
]
Resume = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Resume that folder: run what is missing or failed; accepts overrides of executor and "
        "cache only.",
        autocompletion=complete_folder,
    ),
]
NewFolder = Annotated[
    Path | None,
    typer.Option("--output", metavar="FOLDER", help="New folder (default: named after its input)."),
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
    bool,
    typer.Option("--verbose", "-v", help="Print all scores, and the names of computed stages."),
]
DryRun = Annotated[
    bool,
    typer.Option(
        "--dry-run",
        help="Print what would be computed, and how long it takes; of one run also the "
        "configuration. Compute nothing.",
    ),
]
FromFile = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="FILE",
        help="YAML file of axes, seeds and excluded runs, or the name of one in pipelines/studies.",
    ),
]
Over = Annotated[
    str | None,
    typer.Option(
        metavar="KEYS",
        help="Swept keys that means and intervals are over, such as seed,path (default: seed).",
    ),
]
Pictures = Annotated[bool, typer.Option("--pictures", help="Draw the pictures of every run.")]

ConfigDir = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Folder with presets of your own, laid out as conf/: DIR/GROUP/OPTION.yaml.",
        callback=use_presets,
        is_eager=True,
    ),
]

TrustCode = Annotated[
    bool,
    typer.Option(
        "--trust-code",
        help="Run user-defined code that a result folder, a file or presets refer to.",
        callback=trust_presets,
    ),
]
