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
    from stixel_cli.border import write_below, written
    from stixel_cli.config.json_schema import schema_files

    files = schema_files()
    with written(folder):
        write_below(folder, files)
    say(*(str(folder / name) for name in sorted(files)))
    return 0
