"""The real command line, called in this process."""

import json
from pathlib import Path

from stixel_cli.cli.app import main

SMALL = ("rig.width=160", "rig.height=120", "pictures.frames=[1]")
"""Small images, one scan pictured."""

FEW = ("path.duration=0.3", *SMALL)
"""Three scans of small images."""


def run_json(capsys, results: Path, *arguments: str) -> dict:
    """What `stixel run --json` prints, after it has ended well."""
    capsys.readouterr()
    code = main(["run", "--json", "--results", str(results), *arguments])
    captured = capsys.readouterr()
    assert code == 0, captured.err
    return json.loads(captured.out)
