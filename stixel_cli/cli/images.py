"""Data in, code of your own: `stixel stixels`, `stixel assess` and `stixel new`."""

import shlex
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stixel_cli.cli import options
from stixel_cli.cli.terminal import print_json, print_table, say
from stixel_cli.config.texts import override_text
from stixel_cli.errors import UserError

if TYPE_CHECKING:
    from stixel_cli.geometry.rig_calibration import RigCalibration


def stixels(
    arguments: options.ImagesOrRecording = None,
    rig: options.RigFile = None,
    output: options.NewFolder = None,
    workers: options.Workers = None,
) -> int:
    """Write the stixels of two images, or of all frames of a recording, as a table and pictures.

    stixels.csv has one row per stixel; kNNNN.png shows the stixels over the image of frame NNNN, of
    four frames, or of those of pictures.frames.

    \b
    Examples:
      stixel stixels left.png right.png --rig rig.yaml
      stixel stixels drive.mcap ego=parked
      stixel stixels DIR source.sequence=0005 extraction.width=5
    """
    from stixel_cli.config.compose import compose
    from stixel_cli.engine.progress import Progress
    from stixel_cli.experiment.stages import compared_rows, computed_stages
    from stixel_cli.results.folder import csv_text, write_whole_folder
    from stixel_cli.results.tables import stixel_columns

    given = options.recording_overrides("stixels", arguments or [], {"rig": rig})
    if not given:
        raise UserError("stixels needs two images, LEFT and RIGHT, or the folder of a recording")
    composition = compose(options.with_workers(given, workers))
    source = composition.resolved["source"]
    named = Path(source.get("left") or source.get("folder") or "run").stem
    target = options.new_file(Path(f"stixels-{named}") if output is None else output)
    wanted, progress = ["stixels", "camera_pictures"], Progress(visible=True)
    compared_rows(composition, progress.note)
    with computed_stages(composition, wanted, progress) as (_, load):
        chunks, drawn = map(load, wanted)
    if not chunks:
        raise UserError(f"measurement: {composition.choices['measurement']} has no stixels")
    pictures = {path: data for one in drawn for path, data in one.files.items()}
    shown = [path for path in pictures if path.endswith("/stixels.png")]
    files = {path.replace("/stixels", ""): pictures[path] for path in shown}
    files["stixels.csv"] = csv_text(stixel_columns(chunks))
    write_whole_folder(target.absolute(), files)
    say(target)
    return 0


def assess(
    arguments: options.ImagesOrRecording = None,
    stixels: options.option(
        Path | None, "Stixels of another tool: .stx1, its CSV, or that of to_frame().", "FILE"
    ) = None,
    rig: options.RigFile = None,
    disparity: options.option(
        Path | None, "True disparities: PNG of 16 bits, 256 per px, 0 for unknown.", "FILE"
    ) = None,
    labels: options.option(Path | None, "KITTI's labels of the pair.", "FILE") = None,
    calibrate: options.flag("--calibrate", "Only estimate the disparity error of the rig.") = False,
    output: options.option(
        Path | None,
        "Output file (default: assess.html). With --calibrate: also write the rig to it, "
        "for source.calibration=FILE with other recordings of the same camera.",
        "FILE",
        callback=options.new_file,
    ) = None,
    workers: options.Workers = None,
    json: options.Json = False,
) -> int:
    """Assess the stixels of one pair of images, or those in a file, on one page.

    It shows the share of the columns that have stixels, their errors against true disparities, the
    rig's disparity error, missed obstacles and run times.

    With --calibrate it estimates the error of a recording's rig from the motion of its camera:
    static points, tracked from image to image. It prints the overrides that correct the error, and
    how well it is known.

    \b
    Examples:
      stixel assess left.png right.png --rig rig.yaml
      stixel assess left.png right.png --rig 000074.txt --disparity disp_occ/000074_10.png
      stixel assess DIR source.sequence=000074
      stixel assess left.png right.png --rig rig.yaml --disparity true.png --stixels other.stx1
      stixel assess --stixels other.stx1
      stixel assess --calibrate DIR source.sequence=0005 --output rig.yaml
    """
    from stixel_cli.border.origins import write_new
    from stixel_cli.config.compose import compose
    from stixel_cli.engine.progress import Progress
    from stixel_cli.experiment import assess as assessing
    from stixel_cli.report.assess import page_html, sentences, value_rows
    from stixel_cli.results.folder import unused_page
    from stixel_cli.validation.stixel_file import read_stixels

    arguments = arguments or []
    files = {"rig": rig, "disparity": disparity, "labels": labels}
    given = options.recording_overrides("assess", arguments, files)
    if not given and stixels is None:
        raise UserError("assess needs two images, LEFT and RIGHT, a recording, or --stixels FILE")
    if calibrate and stixels is not None:
        raise UserError("--calibrate needs images: leave out --stixels")
    composition, progress = None, Progress(visible=True)
    if given:
        given += [] if calibrate else ["pictures.frames=[0]"]
        composition = compose(options.with_workers(given, workers))
    if calibrate:
        _print_calibration(assessing.calibrate(composition, progress), output, json)
        return 0
    if stixels is None:
        assessment = assessing.assess(composition, progress)
    else:
        assessment = assessing.assess_stixels(read_stixels(stixels), composition)
    if json:
        names = ("values", "seconds", "rig")
        print_json({name: dict(getattr(assessment, name)) for name in names})
        return 0
    page = unused_page(Path("assess.html")) if output is None else output
    command = [word for word in ("stixel", "assess", *arguments) if word]
    for name, file in {**files, "stixels": stixels}.items():
        command += [] if file is None else [f"--{name}", str(file)]
    write_new(page, page_html(assessment, shlex.join(command)))
    print_table(("value", "", "unit"), value_rows(assessment), right=(1,))
    say("", *sentences(assessment), page)
    return 0


def _print_calibration(found: "RigCalibration", output: Path | None, json: bool) -> None:
    """Print the disparity error of a recording's rig; write the rig with it to `output`."""
    from stixel_cli.border.origins import write_new
    from stixel_cli.recordings.rig_files import rig_text

    if output is not None:
        write_new(output, rig_text(found.rig, found.text))
    medians = {"before": found.median_before, "after": found.median_after}
    medians = {name: median for name, median in medians.items() if median >= 0.0}
    if json:
        residuals = {f"median_{name}": median for name, median in medians.items()}
        print_json({"text": found.text, **found.values, **residuals})
        return
    values = {name: found.values[name] for name in ("disparity_error", "disparity_error_std")}
    say(
        shlex.join(f"rig.{name}={str(value).replace(' ', '')}" for name, value in values.items()),
        found.text,
        *(f"median residual {name}: {median:.2f} px" for name, median in medians.items()),
    )


app = typer.Typer(name="new", rich_markup_mode=None, no_args_is_help=False)


@app.callback()
def new() -> None:
    """Write a tracker of your own, or a class of your own meshes."""


@app.command()
def tracker(name: options.argument(str, "Name of its module.", "NAME")) -> int:
    """Write NAME.py, a tracker to begin with, and its test, test_NAME.py, into this folder.

    Example: stixel new tracker box
    """
    from stixel_cli.border.files import read_text
    from stixel_cli.border.origins import write_whole, written

    if not name.isidentifier() or iskeyword(name) or find_spec(name):
        raise UserError(f"NAME: {name!r} must be the name of a new module, such as my_tracker")
    templates = Path(__file__).with_name("templates")
    files = {f"{name}.py": "tracker.txt", f"test_{name}.py": "test_tracker.txt"}
    for file in (file for file in files if Path(file).exists()):
        raise UserError(f"{file}: exists and is not overwritten; choose another name")
    with written(Path()):
        for file, template in files.items():
            write_whole(Path(file), read_text(templates / template).replace("NAME", name))
    say(*files, "", f"Run it: stixel run tracker={name}:track")
    say(f"Its test: pip install pytest; python -m pytest test_{name}.py")
    return 0


@app.command("class")
def learn_shape(
    meshes: options.argument(list[str], "Meshes of the class.", "MESH…"),
    output: options.option(Path, "New class file, .json.", "FILE", show_default=False),
    road_user: options.option(str, "The class that gives pace and paths.", "CLASS") = "car",
    scale: options.option(float, "As road_user.mesh_scale.") = 1.0,
    up: options.choice("z|y", "As road_user.mesh_up.") = "z",
    forward: options.choice("x|-x|y|-y|z|-z", "As road_user.mesh_forward.") = "x",
    sensor: options.option(
        list[str] | None,
        "stixels, lidar, or outline (of any other sensor); may be repeated. Default: all.",
        "SENSOR",
        show_default=False,
    ) = None,
) -> int:
    """Learn the visible shape of a class from meshes.

    Simulate the sensors on four paths for each mesh: minutes for stixels, seconds for an outline.
    Write the class file for tracker=contour and print the overrides that use it.

    \b
    Examples:
      stixel new class van.obj pickup.obj --output vans.json
      stixel new class bike.obj --road-user cyclist --sensor outline --output bike.json
    """
    from stixel_cli.border.origins import write_whole, written
    from stixel_cli.experiment.class_shapes import MEASUREMENTS, SEEDS, class_text, learned_class

    known = (*MEASUREMENTS, "outline")
    for name in (name for name in sensor or () if name not in known):
        raise UserError(f"--sensor: {name!r} is not known: must be one of {', '.join(known)}")
    if output.suffix != ".json":
        raise UserError(f"--output: {output} must have the suffix .json")
    options.new_file(output)
    axes = {"mesh_scale": scale, "mesh_up": up, "mesh_forward": forward}
    common = [override_text(f"road_user.{name}", value) for name, value in axes.items()]
    common.append(override_text("road_user", road_user))
    drawn = [(*common, override_text("road_user.mesh", mesh)) for mesh in meshes]
    seen, sensors = dict(enumerate(drawn, SEEDS.start)), list(dict.fromkeys(sensor or known))
    size, shape = learned_class(drawn, seen, sensors)
    with written(output.parent):
        write_whole(output, class_text(shape))
    prior = {"road_user": str(output)}
    prior |= dict(zip(("length", "width"), size.mean.tolist(), strict=True))
    prior |= dict(zip(("length_std", "width_std"), size.stds.tolist(), strict=True))
    say(shlex.join(override_text(f"prior.{key}", value) for key, value in prior.items()))
    return 0
