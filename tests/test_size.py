"""Lines of each folder of the package. Raise a number only with its reason beside it."""

from pathlib import Path

import pytest

import stixel_cli

PACKAGE = Path(stixel_cli.__file__).parent

BUDGET = {
    "": 900,
    "calibration": 654,
    "cli": 2930,
    "config": 3050,
    # A check that another process has not marked the new cache meanwhile.
    "engine": 5039,
    # The box of a track has room for the limbs; loss has one definition, with heading and class.
    "evaluation": 1599,
    "experiment": 1488,
    "export": 590,
    "geometry": 173,
    "machine": 331,
    "measurements": 1710,
    "pictures": 1304,
    "recordings": 2530,
    # Images of a rig out of calibration.
    "rendering": 2640,
    "report": 2124,
    "results": 1607,
    # A mesh in other units and along another axis.
    "scene": 3543,
    "stereo": 471,
    "stixels": 2045,
    "studies": 6340,
    "sweeps": 2403,
    # `contour`: the bank of forms for what it did not learn from, the search at the first scan.
    "tracking": 4712,
    "validation": 1225,
}
"""Folder to its greatest number of lines of Python; "" for the modules beside the folders."""

MODULES = 322
"""Modules of the package, without `__init__`."""


def modules(folder):
    return (PACKAGE / folder).rglob("*.py") if folder else PACKAGE.glob("*.py")


@pytest.mark.parametrize("folder", BUDGET)
def test_a_folder_keeps_its_budget(folder):
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in modules(folder))
    assert lines <= BUDGET[folder]


def test_every_folder_has_a_budget():
    folders = {path.relative_to(PACKAGE).parts[0] for path in PACKAGE.glob("*/*.py")}
    assert {*BUDGET} == {"", *folders}
    assert len([p for p in PACKAGE.rglob("*.py") if p.stem != "__init__"]) <= MODULES
