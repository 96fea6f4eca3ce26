"""`stixel new`: write a tracker of the user's own to begin with, or a class that meshes teach."""

import shlex
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path

import typer

from stixel_cli.cli import options
from stixel_cli.cli.terminal import say
from stixel_cli.config.texts import override_text
from stixel_cli.errors import UserError

app = typer.Typer(name="new", rich_markup_mode=None, no_args_is_help=False)


@app.callback()
def new() -> None:
    """Write a tracker of your own, or a class of your own meshes."""


@app.command()
def tracker(
    name: options.argument(str, "Name of its module.", "NAME"),
) -> int:
    """Write NAME.py, a tracker to begin with, and its test, test_NAME.py, into this folder.

    Example: stixel new tracker box
    """
    from stixel_cli.border import write_whole, written
    from stixel_cli.files import read_text

    if not name.isidentifier() or iskeyword(name) or find_spec(name):
        raise UserError(f"NAME: {name!r} must be the name of a new module, such as my_tracker")
    templates = Path(__file__).with_name("templates")
    files = {f"{name}.py": "tracker.txt", f"test_{name}.py": "test_tracker.txt"}
    for file in files:
        if Path(file).exists():
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
    up: options.option(str, "As road_user.mesh_up.", "z|y") = "z",
    forward: options.option(str, "As road_user.mesh_forward.", "x|-x|y|-y|z|-z") = "x",
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
    from stixel_cli.border import write_whole, written
    from stixel_cli.experiment.class_shapes import MEASUREMENTS, SEEDS, class_text, learned_class

    known = (*MEASUREMENTS, "outline")
    for name in sensor or ():
        if name not in known:
            raise UserError(f"--sensor: {name!r} is not known: must be one of {', '.join(known)}")
    if output.suffix != ".json":
        raise UserError(f"--output: {output} must have the suffix .json")
    options.new_file(output)
    axes = {"mesh_scale": scale, "mesh_up": up, "mesh_forward": forward}
    common = [override_text(f"road_user.{name}", value) for name, value in axes.items()]
    common.append(override_text("road_user", road_user))
    seen = {
        SEEDS.start + i: (*common, override_text("road_user.mesh", mesh))
        for i, mesh in enumerate(meshes)
    }
    size, shape = learned_class(seen.values(), seen, list(dict.fromkeys(sensor or known)))
    with written(output.parent):
        write_whole(output, class_text(shape))
    prior = {"road_user": str(output)}
    prior |= dict(zip(("length", "width"), size.mean.tolist(), strict=True))
    prior |= dict(zip(("length_std", "width_std"), size.stds.tolist(), strict=True))
    say(shlex.join(override_text(f"prior.{key}", value) for key, value in prior.items()))
    return 0
