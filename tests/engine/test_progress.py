"""Progress: quiet when it is short, on stderr only, and true about the numbers."""

import io

import pytest

from stixel_cli.engine import progress as module
from stixel_cli.engine.progress import Bar, Lines, Progress, crash_note, make_progress


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
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
    feed(Lines(), project, clock, 2.0)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.splitlines() == [
        "stixel: [1/10] numbers done in 2.0 s of work",
        "stixel: [3/10] running double",
        "stixel: [4/10] double (3 nodes) done in 6.0 s of work",
        "stixel: [6/10] running running",
        "stixel: [7/10] running (3 nodes) done in 6.0 s of work",
        "stixel: [8/10] gather done in 2.0 s of work",
        "stixel: [10/10] grid (2 nodes) done in 4.0 s of work",
        "stixel: recomputed",
        "stixel: [11/11] numbers (2 nodes) done in 4.0 s of work",
    ]


def test_the_time_left(project, clock, capsys):
    lines = Lines()
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
    assert capsys.readouterr().err == "stixel: [0/6] running double; about 2 min left\n"
    lines.expect({"double": 30.0}, 2)
    assert lines.seconds_left() is None
    assert lines.text_left == ""


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
    assert 0.02 < second.at_first < 5.0


@pytest.mark.parametrize("make", [Lines, Bar])
def test_a_short_execution_shows_nothing(project, clock, capsys, make):
    feed(make(), project, clock, 0.01)
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "stixel: recomputed\n")


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_bar_on_a_terminal(project, clock, capsys):
    terminal = Terminal()
    # Undone before capsys is, which keeps what stderr was at its beginning.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stderr", terminal)
        patch.setenv("TERM", "xterm")
        bar = make_progress()
        assert isinstance(bar, Bar)
        bar.expect({stage: 60.0 for stage in project.graph().stages}, 1)
        feed(bar, project, clock, 2.0)
    assert "grid; about 2 s left" in terminal.getvalue()
    assert "/10" in terminal.getvalue() and "recomputed" in terminal.getvalue()
    assert capsys.readouterr().out == ""


def test_lines_where_there_is_no_terminal(capsys):
    assert isinstance(make_progress(), Lines)


def test_the_note_on_a_crashed_worker():
    note = crash_note(["double", "double", "grid[0:10]"], True)
    assert "crashed" in note and "double (2 nodes), grid[0:10]" in note and "retrying each" in note
    assert crash_note(["double"], True).endswith("retrying double on its own")
    assert crash_note(["double"], False) == "a worker crashed while running double"
