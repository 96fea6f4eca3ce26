"""A slow step of a stage, such as one scan of a tracker, is named once; without any sleep."""

import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.engine import task
from stixel_cli.engine.graph import build_graph
from stixel_cli.engine.task import SLOW, Steps
from stixel_cli.experiment.stages import pipeline_stages
from stixel_cli.measurements.scans import Scans

WATCHED = """
    def watched(self, begin):
        object.__setattr__(self, "begin", begin)
        return self

    def total(self)"""


def scans(*counts):
    each = [(np.zeros((n, 2)), np.zeros((n, 2, 2))) for n in counts]
    return Scans.of_each(0.1 * np.arange(len(counts)), np.zeros((len(counts), 3)), each)


def note_of(read, seconds):
    """The note on a stage that reads the rows of the scans `read`; the clock shows `seconds`."""
    ticks = iter(seconds)
    steps = Steps(lambda: next(ticks))
    watched = scans(3, 3000, 0).watched(steps.begin)
    for k in read:
        assert watched.rows(k) == scans(3, 3000, 0).rows(k)
    steps.begin("the end")
    return steps.note


@pytest.mark.parametrize(
    ("read", "seconds", "said"),
    [
        ([0, 1, 2], [0.0, 1.0, 62.0, 70.0], "took 61 s for scan k = 1 of 3000 points"),
        ([0, 1, 1, 2], [0.0, 1.0, 62.0, 62.1], "took 61 s for scan k = 1 of 3000 points"),
        ([0, 1, 2], [0.0, 4.9, 9.8, 14.7], ""),
        ([2], [0.0, SLOW + 1.0], "took 6 s for scan k = 2 of 0 points"),
        ([], [0.0], ""),
    ],
)
def test_the_slowest_step_is_named_by_a_clock(read, seconds, said):
    assert note_of(read, seconds) == said


def test_watched_scans_are_the_same_to_other_processes():
    plain = scans(2, 3)
    watched = plain.watched([].append)
    assert pickle.dumps(watched) == pickle.dumps(plain)
    assert pickle.loads(pickle.dumps(watched)).rows(1) == slice(2, 5)


@pytest.mark.parametrize("tracker", ["contour", "pyrecest"])
def test_the_scans_of_every_tracker_are_watched(tracker):
    stages = {one.name: one for one in pipeline_stages(compose([f"tracker={tracker}"]))}
    assert stages["track"].watched == "scans"
    assert not stages["scores"].watched


@pytest.mark.parametrize("executor", ["serial", "threads"])
def test_an_execution_says_it_once_for_each_function(project, notes, monkeypatch, executor):
    monkeypatch.setattr(task, "SLOW", 0.0)
    project.edit("nouns", "    def total(self)", WATCHED)
    project.edit("grid", "return float", "doubled.begin(f'frame {frame}'); return float")
    stages = [
        replace(one, watched="doubled") if one.name == "grid" else one for one in project.stages()
    ]
    # The first node of a stage whose machine code is not cached compiles it.
    notes.uncompiled = frozenset([f"{project.name}.grid"])
    project.run(build_graph(stages[:5], 10, 10), ["grid"], executor="serial", progress=notes)
    assert len(notes.notes) == 1 and "frame 9" in notes.notes[0]
    notes.notes.clear()
    project.run(build_graph(stages, 10, 4), executor=executor, progress=notes)
    assert len(notes.notes) == 1
    assert re.fullmatch(rf"{project.name}\.grid:grid took \d+ s for frame \d", notes.notes[0])
    project.run(build_graph(stages, 10, 4), executor=executor, progress=notes)
    assert len(notes.notes) == 1
