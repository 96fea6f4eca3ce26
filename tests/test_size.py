"""Lines of each folder of the package. Raise a number only with its reason beside it."""

from pathlib import Path

import pytest

import stixel_cli

PACKAGE = Path(stixel_cli.__file__).parent

BUDGET = {
    # The reader of Feather files stands beside that of all other foreign files; the docstrings of
    # what a script imports have examples.
    "": 1622,
    # Sequences, packs, rows, the page of `stixel bench` and the playback of packs.
    "benchmark": 1024,
    "calibration": 643,
    # `explain` says if a folder has results of other code than the cached ones.
    "cli": 3107,
    "config": 2933,
    # A check that another process has not marked the new cache meanwhile; a file that several
    # stages read is hashed once; the outcome of a task of Dask comes without being fetched.
    "engine": 4918,
    # The box of a track has room for the limbs; loss has one definition, with heading and class.
    "evaluation": 1750,
    # The names of runs, from config/.
    "experiment": 1512,
    "export": 652,
    # Camera poses on the plane, poses of labels, rotations of quaternions: from recordings.
    "geometry": 223,
    "machine": 318,
    "measurements": 1770,
    # The sheet of a frame's stages, of the studies before.
    "pictures": 1492,
    # The motion of logs of Argoverse 2, without images.
    # Messages of bags of ROS 1 and ROS 2: images, calibration, odometry, mountings; what they share
    # with logs of Argoverse: frames and poses by their time.
    "recordings": 2628,
    # Images of a rig out of calibration.
    "rendering": 2333,
    # The layer that studies share: runs, scans, cost, templates, numbered blocks, files.
    "report": 2922,
    "results": 1509,
    # A mesh in other units and along another axis.
    "scene": 3532,
    # Conditions of the rig, the matchers, the path, the pictures and the prior, from config/.
    "stereo": 486,
    "stixels": 2333,
    # A study of the trackers away from home; the motions of Argoverse 2.
    "studies": 4823,
    # The plan of one run, from experiment/ and cli/.
    "sweeps": 2969,
    # `contour`: the bank of forms for what it did not learn from, the search at the first scan;
    # a start from slow and sparse scans.
    "tracking": 6087,
    # Statistics of points, the fit of their noise and the tables of stages, of the studies before.
    "validation": 1555,
}
"""Folder to its greatest number of lines of Python; "" for the modules beside the folders."""

# The filters of PyRecEst: with the tracker they had more than 300 lines.
MODULES = 346
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
