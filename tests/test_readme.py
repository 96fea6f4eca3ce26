"""The README's examples are commands that work."""

import re
import shlex
from pathlib import Path

import pytest

from stixel_cli.cli.app import main
from stixel_cli.config.folders import group_options

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
RUNS = [
    shlex.split(line, comments=True)[1:]
    for line in re.findall(r"^stixel (?:run|sweep) .*$", README, flags=re.MULTILINE)
]


def test_there_are_examples():
    assert len(RUNS) >= 4


@pytest.mark.parametrize("arguments", RUNS, ids=" ".join)
def test_the_examples_are_accepted(arguments, capsys):
    assert main([*arguments, "--dry-run"]) == 0, capsys.readouterr().err


def test_every_option_in_the_readme_exists_and_none_is_missing():
    table = re.findall(r"^\| `([\w/]+)` \| (`.*) \|$", README, flags=re.MULTILINE)
    named = {group: set(re.findall(r"`(\w+)`", options)) for group, options in table}
    known = group_options()
    assert named.keys() <= known.keys()
    for group, options in named.items():
        assert options == set(known[group]), group
