"""A module of the user's own, in a folder of its own."""

import os
import sys

import pytest

NAMES = iter(range(1000))

TRACKER = """
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Le

import {helper}
from stixel_cli.tracking.track import Track

FILES = []

with open(__file__ + ".imported", "a") as file:
    file.write("x")


@dataclass(frozen=True)
class Parameters:
    alpha: Annotated[float, Gt(0), Le(1)] = 0.5
    mode: Literal["near", "far"] = "near"


def track(scans, initial, prior, tracker: Parameters):
    count = len(scans)
    means = np.tile(initial.mean, (count, 1))
    means[:, 0] += {helper}.OFFSET * tracker.alpha
    square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    contours = means[:, None, :2] + square
    shape = contours, np.ones((count, 4))
    states = means, np.tile(np.eye(6), (count, 1, 1))
    return Track.of_scans(scans.times, states, shape, [[]] * count, np.full(count, np.nan))


def plain(scans, initial, prior, alpha=0.5):
    return track(scans, initial, prior, Parameters(alpha))


def fails(scans, initial, prior):
    return np.zeros(3) + np.zeros(2)  # the line


def wrong(scans, initial, prior):
    return {{"means": 3}}


def short(scans, initial, prior):
    from dataclasses import replace

    return replace(track(scans, initial, prior, Parameters()), nis=np.zeros(1))


def dots(scenario, seed, spread=0.1):
    from stixel_cli.measurements.scans import Scans
    from stixel_cli.randomness import generator

    scans = [
        (pose[:2] + spread * generator(seed, "dots", k).standard_normal((3, 2)),
         np.tile(spread**2 * np.eye(2), (3, 1, 1)))
        for k, pose in enumerate(scenario.target_poses_world)
    ]
    return Scans.of_each(scenario.times, scenario.ego_poses_world, scans)


def no_scans(scenario, seed):
    return []


def no_view(scenario, seed):
    from dataclasses import replace

    return replace(dots(scenario, seed), field_of_view=(-0.5, 0.5))


def offset_m(track, scenario, scans):
    return np.mean(track.means[:, 0] - scenario.target_poses_world[:, 0])


def words(track, scenario, scans):
    return "far"


scans = 3
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A folder with a module of its own name, which is the working directory."""
    # The workers of xdist share a cache, and no name in it: some tests remove their results.
    number = f"{os.environ.get('PYTEST_XDIST_WORKER', '')}_{next(NAMES)}"
    name, helper = f"own_{number}", f"own_helper_{number}"
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / f"{name}.py").write_text(TRACKER.format(helper=helper))
    (folder / f"{helper}.py").write_text("OFFSET = 1.0\n")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return Own(folder, name, helper)


class Own:
    def __init__(self, folder, name, helper):
        self.folder, self.name, self.helper = folder, name, helper
        self.results = folder.parent / "results"

    def imports(self):
        file = self.folder / f"{self.name}.py.imported"
        return len(file.read_text()) if file.exists() else 0

    def forget(self):
        """As a new process: nothing is imported."""
        (self.folder / f"{self.name}.py.imported").unlink(missing_ok=True)
        for name in (self.name, self.helper):
            sys.modules.pop(name, None)


QUICK = ("measurement=fabricated", "path.duration=0.3", "pictures.frames=[]")
THREADS = "executor=threads"
