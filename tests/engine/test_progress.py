"""Progress: quiet when it is short, on stderr only, and true about the numbers."""

import sys
from dataclasses import replace

import pytest

from stixel_cli.engine import progress as progress_module
from stixel_cli.engine.plan import Durations
from stixel_cli.engine.progress import Display, Progress, crash_note

FRAMES = 10
"""Of the graph of `project`."""


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress_module.time, "monotonic", lambda: now[0])
    return now


def feed(progress, project, clock, step):
    """All nodes of a graph but `show`, `step` seconds each; and a node that is recomputed."""
    graph = project.graph()
    nodes = [node for node in graph.nodes.values() if node.stage.name != "show"]
    progress.begin(nodes, cached=2)
    for node in nodes:
        progress.started(node)
        clock[0] += step
        progress.tick()
        progress.finished(node, step)
    progress.extend(nodes[:1])
    progress.started(nodes[0])
    progress.note("recomputed")
    progress.finished(nodes[0], step)
    progress.close()


def test_lines(project, clock, capsys):
    feed(Progress(visible=True), project, clock, 3.0)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.splitlines() == [
        "stixel: [10 %] about 27 s left; double 0/10 frames",
        "stixel: [30 %] about 21 s left; double 8/10 frames",
        "stixel: [50 %] about 15 s left; running 4/10 frames",
        "stixel: [70 %] about 9 s left; gather",
        "stixel: [90 %] about 3 s left; grid 1/2 frames",
        "stixel: recomputed",
    ]


def test_an_equal_line_is_not_repeated_soon(clock, capsys):
    lines = Display()
    for _ in range(12):
        clock[0] += 6.0
        lines.show(0.1, "track")
    assert capsys.readouterr().err == "stixel: [10 %] track\n" * 2


def test_the_time_left(project, clock, capsys):
    lines = Progress(visible=True)
    lines.expect({"double": 30.0, "running": 60.0}, 2)
    graph = project.graph()
    nodes = [*graph.of_stage("double"), *graph.of_stage("running")]
    lines.begin(nodes, cached=0)
    assert lines.seconds_left() == 135.0
    lines.started(nodes[0])
    clock[0] += 20.0
    lines.tick()
    lines.finished(nodes[0], 20.0)
    assert lines.seconds_left() == 110.0, "by what was seen, where there is some"
    said = capsys.readouterr().err
    assert said == f"stixel: [0 %] about 2 min left; double 0/{FRAMES} frames\n"
    lines.expect({}, 2)
    assert lines.seconds_left() == 0.5 * (2 * 20.0 + 3 * 20.0), "unknown: as an average node"
    lines.finished(nodes[3], 5.0)
    assert lines.share == 25.0 / (25.0 + 2 * 20.0 + 2 * 5.0)
    lines.expect({"running": 60.0}, 2)
    lines.extend(nodes[:3])
    assert lines.share == 25.0 / 75.0, "it never falls"
    unknown = Progress()
    unknown.begin(nodes, cached=0)
    assert unknown.seconds_left() is None
    assert unknown.text_left == ""


def test_progress_gets_the_durations_of_earlier_runs(project):
    class Kept(Progress):
        def begin(self, nodes, cached):
            super().begin(nodes, cached)
            self.at_first = self.seconds_left()

    first, second = Kept(), Kept()
    project.add_line("gather", "import time; time.sleep(0.02)")
    project.run(progress=first)
    project.run(project.graph(seed=2), progress=second)
    assert first.at_first is None
    assert second.at_first > 0.02


def test_estimates_are_of_the_work_and_leave_out_what_was_never_measured(project):
    project.run()
    durations = Durations(project.store.folder)
    nodes = [n for n in project.graph().nodes.values() if n.frame_count]
    seconds, unknown = durations.estimate(nodes)
    assert seconds > 0.0 and unknown == []
    # Images of four times as many pixels.
    larger = [replace(node, stage=replace(node.stage, amount=4.0)) for node in nodes]
    assert durations.estimate(larger)[0] == pytest.approx(4.0 * seconds)
    new = replace(nodes[0], stage=replace(nodes[0].stage, name="new", function="a.b:c"))
    assert durations.estimate([*nodes, new]) == (pytest.approx(seconds), ["new"])


@pytest.mark.parametrize("terminal", [False, True])
def test_a_short_execution_shows_nothing(project, clock, capsys, monkeypatch, terminal):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    feed(Progress(visible=True), project, clock, 0.01)
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "stixel: recomputed\n")


def test_the_note_on_a_crashed_worker():
    note = crash_note(["double", "double", "grid[0:10]"], True)
    assert "crashed" in note and "double (2 nodes), grid[0:10]" in note and "retrying each" in note
    assert crash_note(["double"], True).endswith("retrying double on its own")
    assert crash_note(["double"], False) == "a worker crashed while running double"
