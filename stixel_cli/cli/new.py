"""`stixel new`: write a tracker of the user's own to begin with, and its test."""

from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from typing import Annotated, Literal

import typer

from stixel_cli.cli.terminal import say
from stixel_cli.errors import UserError


def new(
    kind: Annotated[Literal["tracker"], typer.Argument(help="tracker.", show_default=False)],
    name: Annotated[
        str, typer.Argument(help="Name of its module.", metavar="NAME", show_default=False)
    ],
) -> int:
    """Write NAME.py, a tracker to begin with, and its test, test_NAME.py, into this folder.

    Example: stixel new tracker box
    """
    from stixel_cli.border import write_whole, written
    from stixel_cli.files import read_text

    if not name.isidentifier() or iskeyword(name) or find_spec(name):
        raise UserError(f"NAME: {name!r} must be the name of a new module, such as my_tracker")
    templates = Path(__file__).with_name("templates")
    files = {f"{name}.py": f"{kind}.txt", f"test_{name}.py": f"test_{kind}.txt"}
    for file in files:
        if Path(file).exists():
            raise UserError(f"{file}: exists and is not overwritten; choose another name")
    with written(Path()):
        for file, template in files.items():
            write_whole(Path(file), read_text(templates / template).replace("NAME", name))
    say(*files, "", f"Run it: stixel run {kind}={name}:track")
    say(f"Its test: pip install pytest; python -m pytest test_{name}.py")
    return 0
