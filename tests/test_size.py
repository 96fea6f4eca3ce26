"""Lines of Python of the package: one total, which only falls, and a number for each folder.

A commit that lowers a folder lowers its number. A folder may rise where another one falls: then
both numbers change, and the total does not rise.
"""

from pathlib import Path

import pytest

import stixel_cli

PACKAGE = Path(stixel_cli.__file__).parent

TOTAL = 51_892
"""Greatest number of lines in all."""

MODULES = 342
"""Greatest number of modules, without `__init__`."""

BUDGET = {
    "": 2236,
    "answers": 1058,
    "benchmark": 1022,
    "calibration": 503,
    "cli": 3101,
    "config": 3096,
    "engine": 4594,
    "evaluation": 1911,
    "experiment": 1549,
    "export": 657,
    "geometry": 413,
    "machine": 316,
    "measurements": 2085,
    "pictures": 1445,
    "recordings": 3056,
    "rendering": 2349,
    "report": 1063,
    "results": 1534,
    "scene": 3712,
    "stereo": 600,
    "stixels": 2357,
    "studies": 2077,
    "sweeps": 2561,
    "tracking": 6899,
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
