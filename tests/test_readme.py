"""The README's examples are valid, its tables complete, and its method is that of the stages."""

import ast
import inspect
import re
import shlex
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from stixel_cli import compose, method, run
from stixel_cli.border.origins import TYPED
from stixel_cli.cli.app import main
from stixel_cli.config.folders import STUDIES
from stixel_cli.config.overrides import check_overrides, read_overrides

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted((ROOT / "docs").glob("*.md"))
LINES = re.findall(r"^stixel (?:run|sweep) .*$", README, flags=re.MULTILINE)
RUNS = [shlex.split(line, comments=True)[1:] for line in LINES]


def test_there_are_examples_that_take_no_other_runs_along_and_every_study():
    assert len(RUNS) >= 4
    # Each result folder that is used was named before, and no name is given twice.
    made = re.findall(r"^stixel (?:run|sweep) .*--name (\S+)", README, flags=re.MULTILINE)
    used = re.findall(r"\bresults/(\S+)", README)
    assert len(made) == len(set(made))
    assert set(used) <= set(made)
    text = (ROOT / "docs" / "studies.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `stixel study (\w+)", text, flags=re.MULTILINE) == [*STUDIES]
    (code,) = re.findall(r"^```python\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)
    lists = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.List)]
    assert lists
    for overrides in lists:
        compose(ast.literal_eval(overrides))


@pytest.mark.parametrize("arguments", RUNS, ids=" ".join)
def test_examples_are_valid(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([*arguments, "--dry-run"]) == 0, capsys.readouterr().err


def test_every_command_exists(capsys):
    for verb in set(re.findall(r"^stixel (\w+)", README, flags=re.MULTILINE)):
        assert main([verb, "--help"]) == 0, verb


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_of_the_docs_are_valid(page, capsys):
    """Verbs and overrides; the tutorials' commands run in tests/docs."""
    text = page.read_text(encoding="utf-8")
    for line in set(re.findall(r"^stixel .*$", text, flags=re.MULTILINE)):
        verb, *words = shlex.split(line.removesuffix("\\"), comments=True)[1:]
        assert main([verb, "--help"]) == 0, line
        given = [word for word in words if re.match(r"[a-z_./]+=", word)]
        check_overrides(read_overrides(given, TYPED))


SMALL = ("path.duration=1.2", "rig.width=160", "rig.height=120", "seed=5", "executor=threads")


def test_the_method_fits_on_one_screen_and_gives_the_bytes_of_the_cached_run(tmp_path, monkeypatch):
    lines, _ = inspect.getsourcelines(method.follow_road_user)
    assert len(lines) <= 40
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path))
    found = method.follow_road_user(compose(SMALL).configuration, seed=5)
    cached = run(SMALL)
    for ours, theirs in zip(found, (cached.scans, cached.track, cached.scores), strict=True):
        for field in fields(ours):
            a, b = getattr(ours, field.name), getattr(theirs, field.name)
            if isinstance(a, np.ndarray):
                same = (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
                assert same, field.name
            else:
                assert a == b, field.name
