"""Arguments and options that several commands share, and the words that Tab completes to.

The words are those of the files of `conf/`: no schema is read.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from glob import escape, glob
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from stixel_cli.config import folders
from stixel_cli.config.texts import override_text, split_override
from stixel_cli.errors import UserError, printable_path


def complete_override(incomplete: str) -> list[str]:
    """Complete to groups with their options, or to keys with their values.

    After a comma, as in a sweep, complete to a further option of the group. Bash splits words at
    `=` and expects the part after it.
    """
    words, group = _words_in_bash(incomplete)
    before = f"{group}=" if group else ""
    try:
        matches = _candidates(before + incomplete, words)
    except (OSError, UserError):
        return []
    return [word.removeprefix(before) for word in matches if word != before]


def complete_setting(incomplete: str) -> list[str]:
    """Complete to groups, options and keys, without values."""
    words = complete_override(incomplete)
    return [w.removesuffix("=") for w in words if w.endswith("=") or "." not in w]


def complete_study(incomplete: str) -> list[str]:
    """Complete to names of studies, and to overrides as in a sweep."""
    studies = [name for name in (*folders.STUDIES, "all") if name.startswith(incomplete)]
    return studies + (complete_override(incomplete) if incomplete else [])


def complete_folder(incomplete: str) -> list[str]:
    """Complete to result folders, and to folders that may contain them."""
    folder, slash, name = incomplete.rpartition("/")
    paths: list[str] = []
    # `results/` is the default parent folder.
    for place in [f"{folder}{slash}"] if incomplete else ["", "results/"]:
        root = os.path.expanduser(place)
        for child in sorted(glob(f"{escape(name)}*/", root_dir=root or None)):
            is_run = os.path.isfile(os.path.join(root, child, "manifest.json"))
            paths.append(place + (child[:-1] if is_run else child))
    return paths


def complete_run_or_override(incomplete: str) -> list[str]:
    """Complete to result folders and overrides."""
    return [*complete_override(incomplete), *complete_folder(incomplete)]


def _words_in_bash(incomplete: str) -> tuple[list[str], str]:
    """The words of the line, and the word before the `=` that `incomplete` follows."""
    words = os.environ.get("COMP_WORDS", os.environ.get("_TYPER_COMPLETE_ARGS", "")).split()
    current = os.environ.get("COMP_CWORD", "")
    if not current.isdecimal():
        return words, ""
    head = words[: int(current) + (not incomplete)]
    return words, head[-2] if len(head) > 1 and head[-1] == "=" else ""


def _candidates(typed: str, words: list[str]) -> list[str]:
    options, (key, values) = folders.group_options(), split_override(typed)
    *given, last = values.split(",")
    if given:
        further = [o for o in options.get(key, ()) if o.startswith(last) and o not in given]
        return [f"{key}={','.join((*given, option))}" for option in further]
    groups = [group for group in options if group.startswith(key)]
    if "=" in typed or len(groups) == 1:
        # The shell appends a space to a single `group=`, so complete to its options.
        matches = [f"{group}={option}" for group in groups for option in options[group]]
        for group in {*folders.ENTRY_POINTS}.intersection(groups):
            matches += [f"{group}={name}" for name in folders.installed_functions(group)]
    else:
        matches = [f"{group}=" for group in groups]
    if key and "seed".startswith(key):
        matches.append("seed=")
    matches += _keys(key, words) if "." in key else []
    return [word for word in matches if word.startswith(typed)]


def _keys(typed: str, words: list[str]) -> list[str]:
    """The keys of the options that the line chooses; a single key also with its value."""
    from stixel_cli.config.choice import compose_options

    line = map(split_override, "".join(f" {word}" for word in words).replace(" = ", "=").split())
    options = folders.group_options()
    chosen = {group: option for group, option in line if option in options.get(group, ())}
    plain, _ = compose_options(tuple(sorted(chosen.items())), folders.conf_state())
    values = dict(folders.flat(plain))
    matches = [key for key in values if key.startswith(typed) and not key.endswith(".kind")]
    if len(matches) != 1:
        return [f"{key}=" for key in matches]
    value = values[matches[0]]
    of_another = isinstance(value, list) or "$" in str(value)
    return [f"{matches[0]}="] + ([] if of_another else [override_text(matches[0], value)])


def option(kind: Any, help: str, metavar: str | None = None, *names: str, **more: Any) -> Any:
    """The annotation of an option with a value of type `kind`; `names` as of its parameter."""
    return Annotated[kind, typer.Option(*names, help=help, metavar=metavar, **more)]


def choice(names: str, help: str, *options: str) -> Any:
    """The annotation of an option whose values are `names`, as help shows them: A|B|C."""
    return option(Literal[*names.split("|")], help, names, *options)


def flag(name: str, help: str, *names: str) -> Any:
    """The annotation of an option without a value."""
    return Annotated[bool, typer.Option(name, *names, help=help)]


def argument(
    kind: Any, help: str, metavar: str, complete: Callable[[str], Any] | None = None
) -> Any:
    """The annotation of an argument; `complete` gives the words that Tab completes to."""
    return Annotated[
        kind,
        typer.Argument(help=help, metavar=metavar, autocompletion=complete, show_default=False),
    ]


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
    # Named as in `results.result`, which imports NumPy.
    files = ("manifest.json", "sweep.yaml")
    return any(os.path.isfile(os.path.join(word, file)) for file in files)


def with_workers(overrides: Sequence[str], workers: int | None) -> list[str]:
    """`overrides`, with `--workers` as the override `executor.workers`."""
    return [*overrides, *([] if workers is None else [f"executor.workers={workers}"])]


_IMAGES = (".png", ".jpg", ".jpeg", ".pgm", ".ppm", ".bmp", ".tif", ".tiff")


def recording_overrides(
    command: str, words: Sequence[str], files: Mapping[str, Path | None]
) -> list[str]:
    """The overrides that the words of a command line stand for; [] without words.

    Words without = are two images or one recording. Added is what a recording without a target
    needs, on which no stixel depends. `files` has the keys of `source` that belong to two images,
    with their files; the calibration is required. UserError for another number of files than one or
    two, or options that do not belong.
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
    elif len(named) > 2 or any(word.lower().endswith(_IMAGES) for word in named):
        raise UserError(
            f"{command} needs two images, LEFT and RIGHT, or one recording, got {len(named)}: "
            f"{printable_path(named[0])}{' …' * (len(named) > 1)}"
        )
    else:
        settings = {"source.folder": named[0]} if named else {}
    typed = [word for word in words if "=" in word]
    needed = {"road_user": "car", "start": "scans", "start.bearing": [-45, 45]} if words else {}
    names = {split_override(text)[0] for text in typed}
    settings |= {key: value for key, value in needed.items() if key not in names}
    return [*typed, *(override_text(key, value) for key, value in settings.items())]


Overrides = argument(
    list[str] | None,
    "Changes to the default: GROUP=OPTION or KEY=VALUE, in Hydra's grammar. Or the result "
    "folder of a run to repeat.",
    "OVERRIDES|FOLDER",
    complete_run_or_override,
)
SweepOverrides = argument(
    list[str] | None,
    "As in `stixel run`, plus several values: KEY=1,2 KEY=range(1,9,2) GROUP=glob(*).",
    "OVERRIDES",
    complete_override,
)
RigFile = option(
    Path | None,
    "Calibration of two images: of KITTI, Middlebury, ROS, OpenCV, or a rig.yaml.",
    "FILE",
    "--rig",
    "--calib",
)
ImagesOrRecording = argument(
    list[str] | None,
    "The left and the right image, or the folder or bag of a recording; then overrides as for run.",
    "LEFT RIGHT|RECORDING [OVERRIDE]",
    complete_override,
)
Folder = argument(Path, "Result folder of a run.", "FOLDER", complete_folder)
Folders = argument(list[Path], "A sweep, or result folders of runs.", "FOLDER", complete_folder)
Name = option(str | None, "Name of the result folder (default: the changed settings and the time).")
Output = option(Path | None, "Output file (default: named by the runs).", "FILE", callback=new_file)
Resume = option(
    Path | None,
    "Resume that folder: run what is missing or failed; accepts overrides of executor and "
    "cache only.",
    "FOLDER",
    autocompletion=complete_folder,
)
NewFolder = option(Path | None, "New folder (default: named by its input).", "FOLDER", "--output")
Results = option(Path, "Folder in which to create the result folder.", "DIR")
Workers = option(int | None, "Number of workers; short for executor.workers=…", min=1, max=4096)
Json = flag("--json", "Print the result as JSON only.")
Verbose = flag("--verbose", "Print all scores, and the names of computed stages.", "-v")
DryRun = flag(
    "--dry-run",
    "Print what would be computed, how long it takes, and a run's configuration; compute nothing.",
)
FromFile = option(
    str | None,
    "YAML file of axes, seeds and excluded runs, or the name of one in pipelines/studies.",
    "FILE",
    "--from",
)
Over = option(str | None, "Swept keys to average over, such as seed,path (default: seed).", "KEYS")
Pictures = flag("--pictures", "Draw the pictures of every run.")

ConfigDir = option(
    Path | None,
    "Folder with presets of your own, laid out as conf/: DIR/GROUP/OPTION.yaml.",
    "DIR",
    callback=folders.use_presets,
    is_eager=True,
)

TrustCode = option(
    bool,
    "Run user-defined code that a result folder, a file or presets refer to.",
    None,
    "--trust-code",
    callback=folders.trust_presets,
)
