"""A stage that exceeds its time limit is ended and fails; other running nodes do not fail."""

import pytest

from stixel_cli.engine import limits
from stixel_cli.engine.errors import StageFailure, TimeLimitExceeded
from stixel_cli.engine.limits import TimeLimit, limited
from stixel_cli.engine.parameters import LocalExecutor

LIMIT = 1.5
"""Seconds. Long for a node that does nothing, also on a busy machine."""

LOCAL = LocalExecutor("local", 2, LIMIT)
HANG = "import time; time.sleep(600); log.called('slept')"


def hang(project, function):
    project.add_line(function, HANG)


def test_it_is_killed_and_named_and_not_tried_again(project, notes):
    hang(project, "gather")
    with pytest.raises(StageFailure, match=r"gather: .*exceeded its time limit of 1.5 s") as caught:
        project.run(executor=LOCAL, progress=notes)
    assert isinstance(caught.value.cause, TimeLimitExceeded)
    assert "in gather" in caught.value.traceback_text, "where it hung"
    calls = project.calls()
    assert calls.count("gather") == 1 and "slept" not in calls
    assert notes.notes == []


def test_other_running_nodes_are_submitted_again(project, notes):
    hang(project, "gather")
    graph = project.graph()
    execution = project.run(graph, executor=LOCAL, keep_going=True, progress=notes)
    assert [failure.label for failure in execution.failures.values()] == ["gather"]
    others = [
        status
        for key, status in execution.status.items()
        if execution.graph.nodes[key].label != "gather"
    ]
    assert set(others) == {"computed"}
    assert project.calls().count("gather") == 1
    assert list((project.store.folder / "tmp").glob("limit-*")) != [], "the mark, for a look"


def test_a_node_below_its_limit_leaves_no_mark(project):
    project.run(executor=LocalExecutor("local", 2, 600.0))
    assert list((project.store.folder / "tmp").iterdir()) == []


def test_small_work_in_this_process_is_interrupted(project, monkeypatch):
    project.run()
    # However long the nodes have taken: they are small.
    for name in ("SMALL", "SMALL_FOR_COPIES"):
        monkeypatch.setattr(f"stixel_cli.engine.execute.{name}", 600.0)
    monkeypatch.setattr("stixel_cli.engine.execute.make_pool", None)
    hang(project, "gather")
    project.forget()
    with pytest.raises(StageFailure, match=r"gather: .*exceeded its time limit of 0\.2 s"):
        project.run(executor=LocalExecutor("local", 2, 0.2))
    assert "slept" not in project.calls()


def test_the_time_a_lock_is_held_by_another_does_not_count(project):
    graph = project.graph()
    import threading

    held, gone = threading.Event(), threading.Event()

    def hold():
        with project.store.lock(graph.of_stage("numbers")[0].key):
            held.set()
            gone.wait(4.0)

    thread = threading.Thread(target=hold)
    thread.start()
    held.wait()
    project.run(graph, ["numbers"], executor=LocalExecutor("local", 1, LIMIT))
    thread.join()


def test_a_mark_of_before_counts(tmp_path):
    # As with Dask, which hands what a lost worker ran to the next.
    limit = TimeLimit(5.0, tmp_path / "mark")
    limit.mark.write_text("Timeout")
    with pytest.raises(TimeLimitExceeded), limited(limit):
        raise AssertionError("not reached")
    limit.mark.write_text("")
    with limited(limit):
        pass
    assert not limit.mark.exists()


def test_where_nothing_can_be_interrupted_workers_are_started(project, monkeypatch):
    project.run()
    monkeypatch.setattr("stixel_cli.engine.execute.can_interrupt", lambda: False)
    monkeypatch.setattr("stixel_cli.engine.execute.make_pool", None)
    with pytest.raises(TypeError, match="NoneType"):
        project.run(project.graph(seed=2), executor=LOCAL)
    assert limits.can_interrupt()
