"""`stixel learn-shape`: learn the visible shape of a class from meshes."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli.options import new_file
from stixel_cli.cli.terminal import say
from stixel_cli.config.texts import override_text
from stixel_cli.errors import UserError


def learn_shape(
    meshes: Annotated[
        list[str],
        typer.Argument(
            help="Meshes of the class.",
            metavar="MESH…",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option(help="New class file, .json.", metavar="FILE", show_default=False)
    ],
    road_user: Annotated[
        str, typer.Option(help="The class that gives pace and paths.", metavar="CLASS")
    ] = "car",
    scale: Annotated[float, typer.Option(help="As road_user.mesh_scale.")] = 1.0,
    up: Annotated[str, typer.Option(help="As road_user.mesh_up.", metavar="z|y")] = "z",
    forward: Annotated[
        str, typer.Option(help="As road_user.mesh_forward.", metavar="x|-x|y|-y|z|-z")
    ] = "x",
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            help="stixels, lidar, or outline (of any other sensor); may be repeated. Default: all.",
            metavar="SENSOR",
            show_default=False,
        ),
    ] = None,
) -> int:
    """Learn the visible shape of a class from meshes.

    Simulate the sensors on four paths for each mesh: minutes for stixels, seconds for an outline.
    Write the class file for tracker=contour and print the overrides that use it.

    \b
    Examples:
      stixel learn-shape van.obj pickup.obj --output vans.json
      stixel learn-shape bike.obj --road-user cyclist --sensor outline --output bike.json
    """
    from stixel_cli.border import write_whole, written
    from stixel_cli.experiment.class_shapes import MEASUREMENTS, SEEDS, class_text, learned_class

    known = (*MEASUREMENTS, "outline")
    for name in sensor or ():
        if name not in known:
            raise UserError(f"--sensor: {name!r} is not known: must be one of {', '.join(known)}")
    if output.suffix != ".json":
        raise UserError(f"--output: {output} must have the suffix .json")
    new_file(output)
    values = {"scale": scale, "up": up, "forward": forward}
    values = {f"road_user.mesh_{name}": value for name, value in values.items()}
    seen = {
        SEEDS.start + i: tuple(
            override_text(key, value)
            for key, value in {"road_user": road_user, "road_user.mesh": mesh, **values}.items()
        )
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
