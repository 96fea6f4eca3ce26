"""Lines of Python of the package: one total, which only falls, and a number for each folder.

A commit that lowers a folder lowers its number. A folder may rise where another one falls: then
both numbers change, and the total does not rise.
"""

from pathlib import Path

import pytest

import stixel_cli

PACKAGE = Path(stixel_cli.__file__).parent

TOTAL = 51_608
"""Greatest number of lines in all."""

MODULES = 341
"""Greatest number of modules, without `__init__`."""

BUDGET = {
    "": 2261,
    "answers": 1202,
    "benchmark": 1018,
    "calibration": 577,
    "cli": 3183,
    "config": 3053,
    "engine": 4510,
    "evaluation": 1726,
    "experiment": 1548,
    "export": 657,
    "geometry": 413,
    "machine": 316,
    "measurements": 2211,
    "pictures": 1445,
    "recordings": 3067,
    "rendering": 2361,
    "report": 1062,
    "results": 1531,
    "scene": 3693,
    "stereo": 586,
    "stixels": 2345,
    "studies": 2079,
    "sweeps": 2486,
    "tracking": 6580,
    "validation": 1698,
}
"""Folder to its greatest number of lines of Python; "" for the modules beside the folders."""


def lines_of(folder):
    paths = (PACKAGE / folder).rglob("*.py") if folder else PACKAGE.glob("*.py")
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)


@pytest.mark.parametrize("folder", BUDGET)
def test_a_folder_keeps_its_budget(folder):
    assert lines_of(folder) <= BUDGET[folder]


def test_the_budgets_are_those_of_all_folders_and_sum_up_to_the_total():
    folders = {path.relative_to(PACKAGE).parts[0] for path in PACKAGE.glob("*/*.py")}
    assert {*BUDGET} == {"", *folders}
    assert sum(BUDGET.values()) <= TOTAL
    assert len([p for p in PACKAGE.rglob("*.py") if p.stem != "__init__"]) <= MODULES
