"""Lines of Python of the package: one total, which only falls, and a number for each folder.

A commit that lowers a folder lowers its number. A folder may rise where another one falls: then
both numbers change, and the total does not rise.
"""

from pathlib import Path

import pytest

import stixel_cli

PACKAGE = Path(stixel_cli.__file__).parent

TOTAL = 44_386
"""Greatest number of lines in all."""

MODULES = 239
"""Greatest number of modules, without `__init__`."""

BUDGET = {
    "": 725,
    "answers": 1356,
    "benchmark": 1000,
    "border": 656,
    "calibration": 559,
    "cli": 2576,
    "config": 2486,
    "engine": 4048,
    "evaluation": 1568,
    "experiment": 1226,
    "export": 695,
    "geometry": 410,
    "live": 613,
    "machine": 185,
    "measurements": 1808,
    "pictures": 1376,
    "recordings": 2593,
    "rendering": 2154,
    "report": 735,
    "results": 1347,
    "scene": 3155,
    "stereo": 451,
    "stixels": 2027,
    "studies": 1611,
    "sweeps": 1987,
    "tracking": 5746,
    "validation": 1293,
}
"""Folder to its greatest number of lines of Python; "" for the modules beside the folders."""


TEMPLATES = 1_900
"""Greatest number of lines of all templates."""


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


def test_the_templates_keep_their_budget():
    kinds = (".j2", ".html", ".css", ".js")
    files = [path for path in PACKAGE.rglob("templates/*") if path.suffix in kinds]
    assert sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files) <= TEMPLATES
