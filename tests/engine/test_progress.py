"""Progress: quiet when it is short, on stderr only, and true about the numbers."""

import io

import pytest

from stixel_cli.engine import progress as module
from stixel_cli.engine.progress import Bar, Lines, make_progress


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    return now


def feed(progress, project, clock, step):
    """All nodes of a graph but `show`, `step` seconds each; and a node that is made again."""
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
    progress.note("made again")
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
        "stixel: made again",
        "stixel: [11/11] numbers (2 nodes) done in 4.0 s of work",
    ]


@pytest.mark.parametrize("make", [Lines, Bar])
def test_what_is_short_is_not_shown(project, clock, capsys, make):
    feed(make(), project, clock, 0.01)
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "stixel: made again\n")


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_bar_on_a_terminal(project, clock, capsys, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    bar = make_progress()
    assert isinstance(bar, Bar)
    feed(bar, project, clock, 2.0)
    assert "/10" in terminal.getvalue() and "made again" in terminal.getvalue()
    assert capsys.readouterr().out == ""


def test_lines_where_there_is_no_terminal():
    assert isinstance(make_progress(), Lines)
