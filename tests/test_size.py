"""Lines of Python of the package: one total, which only falls, and a number for each folder.

A commit that lowers a folder lowers its number. A folder may rise where another one falls: then
both numbers change, and the total does not rise.
"""

from pathlib import Path

import pytest

import stixel_cli

PACKAGE = Path(stixel_cli.__file__).parent

TOTAL = 50_608
"""Greatest number of lines in all."""

MODULES = 340
"""Greatest number of modules, without `__init__`."""

BUDGET = {
    "": 2204,
    "answers": 1188,
    "benchmark": 1020,
    "calibration": 577,
    "cli": 3091,
    "config": 3081,
    "engine": 4358,
    "evaluation": 1726,
    "experiment": 1547,
    "export": 647,
    "geometry": 413,
    "machine": 294,
    "measurements": 2077,
    "pictures": 1446,
    "recordings": 3059,
    "rendering": 2361,
    "report": 1038,
    "results": 1494,
    "scene": 3680,
    "stereo": 578,
    "stixels": 2345,
    "studies": 1923,
    "sweeps": 2345,
    "tracking": 6822,
    "validation": 1294,
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
