"""The README's examples are valid, and its tables are complete."""

import ast
import re
import shlex
from pathlib import Path

import pytest

from stixel_cli import compose
from stixel_cli.cli.app import main
from stixel_cli.config.folders import group_options
from stixel_cli.studies.file import shipped_studies

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
RUNS = [
    shlex.split(line, comments=True)[1:]
    for line in re.findall(r"^stixel (?:run|sweep) .*$", README, flags=re.MULTILINE)
]


def test_there_are_examples():
    assert len(RUNS) >= 4


@pytest.mark.parametrize("arguments", RUNS, ids=" ".join)
def test_examples_are_valid(arguments, capsys):
    assert main([*arguments, "--dry-run"]) == 0, capsys.readouterr().err


def test_every_command_exists(capsys):
    for verb in set(re.findall(r"^stixel (\w+)", README, flags=re.MULTILINE)):
        assert main([verb, "--help"]) == 0, verb


def test_every_study_is_in_the_readme():
    named = re.findall(r"^stixel study (\w+)", README, flags=re.MULTILINE)
    assert named == shipped_studies()


def test_python_example_is_valid():
    (code,) = re.findall(r"^```python\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)
    lists = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.List)]
    assert lists
    for overrides in lists:
        compose(ast.literal_eval(overrides))


def test_options_in_the_readme_are_complete():
    table = re.findall(r"^\| `([\w/]+)` \| (`.*) \|$", README, flags=re.MULTILINE)
    named = {group: set(re.findall(r"`(\w+)`", options)) for group, options in table}
    known = group_options()
    assert named.keys() <= known.keys()
    for group, options in named.items():
        assert options == set(known[group]), group
