"""Lines of Python of the package: one total, which only falls, and a number for each folder.

A commit that lowers a folder lowers its number. A folder may rise where another one falls: then
both numbers change, and the total does not rise.
"""

from pathlib import Path

import pytest

import stixel_cli

PACKAGE = Path(stixel_cli.__file__).parent

TOTAL = 48_391
"""Greatest number of lines in all."""

MODULES = 276
"""Greatest number of modules, without `__init__`."""

BUDGET = {
    "": 1513,
    "answers": 1318,
    "benchmark": 1013,
    "calibration": 576,
    "cli": 2821,
    "config": 2908,
    "engine": 4287,
    "evaluation": 1728,
    "experiment": 1360,
    "export": 612,
    "geometry": 413,
    "live": 636,
    "machine": 203,
    "measurements": 2087,
    "pictures": 1396,
    "recordings": 2800,
    "rendering": 2269,
    "report": 840,
    "results": 1469,
    "scene": 3531,
    "stereo": 512,
    "stixels": 2248,
    "studies": 1857,
    "sweeps": 2189,
    "tracking": 6653,
    "validation": 1152,
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
