"""`stixel schema`: write the JSON Schemas of settings, sweeps and studies."""

from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli.terminal import say


def schema(
    folder: Annotated[Path, typer.Argument(help="Folder of the files, new or not.")] = Path(
        "schema"
    ),
) -> int:
    """Write JSON Schemas of presets of each group, of experiments, sweeps and studies.

    An editor that knows them completes and checks a YAML file that begins, for example, with
    `# yaml-language-server: $schema=schema/sweep.json`, a path from that file.

    Example: stixel schema
    """
    from stixel_cli.border import write_whole, written
    from stixel_cli.config.folders import shipped_folder
    from stixel_cli.files import read_text

    files = sorted((shipped_folder("conf") / "schema").glob("*.json"))
    with written(folder):
        for file in files:
            write_whole(folder / file.name, read_text(file))
    say(*(str(folder / file.name) for file in files))
    return 0
