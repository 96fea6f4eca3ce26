"""A node that fails or takes too long does not stop the others; what depends on it is skipped."""

import os
import threading

import pytest

from stixel_cli.engine import limits
from stixel_cli.engine.errors import CacheError, StageFailure, TimeLimitExceeded
from stixel_cli.engine.graph import merge
from stixel_cli.engine.limits import TimeLimit, limited
from stixel_cli.engine.parameters import LocalExecutor
from stixel_cli.engine.scheduler import run_node


def statuses(execution):
    nodes = execution.graph.nodes
    return {nodes[key].label: status for key, status in execution.status.items()}


@pytest.mark.parametrize("executor", ["serial", "threads", "local"])
def test_a_failed_node_fails_alone(project, notes, executor):
    total = "return doubled.total()"
    project.edit("running", total, f"assert frames.start != 4; {total}")
    graph = project.graph()
    execution = project.run(graph, executor=executor, keep_going=True, progress=notes)
    found = statuses(execution)
    assert found.pop("running[4:8]") == "failed"
    assert (found.pop("running[8:10]"), found.pop("gather")) == ("skipped", "skipped")
    assert set(found.values()) == {"computed"}
    (failure,) = execution.failures.values()
    assert isinstance(failure, StageFailure) and failure.label == "running[4:8]"
    assert "in running" in failure.traceback_text
    running, gather = graph.of_stage("running"), graph.of_stage("gather")[0]
    assert execution.failure_of([gather.key]) == (running[1].key, failure)
    assert execution.failure_of([running[0].key]) is None
    of_stages = [record["status"] for record in execution.stage_records()]
    assert of_stages == ["computed"] * 2 + ["failed", "skipped"] + ["computed"] * 2
    (note,) = notes.notes
    assert note.startswith("failed: running[4:8]: AssertionError: (")
    assert "running.py, line " in note, "the file may be the user's own"
    assert (notes.failures, notes.all_done, notes.all_total) == (1, 9, 9)


def test_two_failures_with_a_common_successor(project, notes):
    project.edit("double", "values = ", "assert frames.start == 8, frames; values = ")
    execution = project.run(keep_going=True, progress=notes)
    found = statuses(execution)
    failed = [label for label in found if found[label] == "failed"]
    computed = [label for label in found if found[label] == "computed"]
    assert failed == ["double[0:4]", "double[4:8]"]
    assert computed == ["numbers", "double[8:10]", "grid[9]", "show[9]"]
    graph = execution.graph
    _, first = execution.failure_of([graph.of_stage("gather")[0].key])
    assert first.label in ("double[0:4]", "double[4:8]")
    assert execution.failure_of([graph.of_stage("show")[1].key]) is None


def test_a_result_that_was_stored_before_a_crash_is_computed(project, notes, tmp_path, monkeypatch):
    mark = tmp_path / "crashed"

    def run_and_crash(node, folder, limit):
        outcome = run_node(node, folder, limit)
        if node.label == "gather" and not mark.exists():
            mark.touch()
            os._exit(9)
        return outcome

    monkeypatch.setattr("stixel_cli.engine.scheduler.run_node", run_and_crash)
    execution = project.run(executor="local", keep_going=True, progress=notes)
    assert mark.exists()
    assert set(statuses(execution).values()) == {"computed"}


def test_an_error_that_every_node_would_meet_ends_the_run(project):
    raising = "from stixel_cli.engine.errors import CacheError; raise CacheError('cannot write')"
    project.add_line("gather", raising)
    with pytest.raises(CacheError, match="cannot write"):
        project.run(keep_going=True)


def test_merged_graphs_run_shared_nodes_once_and_may_pick_no_frame(project):
    graphs = [project.graph(seed=seed) for seed in (1, 2, 3)] + [project.graph(frames=(2, 5))]
    merged = merge(graphs)
    assert len(merged.nodes) == 1 + 3 + 3 + 3 + 3 + 3
    names = list(merged.stages)
    assert names.index("double") < names.index("running")
    assert len(merged.stages["gather"]) == 3 and len(merged.stages["show"]) == 3
    project.run(merged)
    calls = project.calls()
    assert calls.count("gather") == 3 and calls.count("numbers") == 1 and len(calls) == 16
    for graph in graphs:
        assert all(project.store.has(key) for key in graph.nodes)
    assert merge([]).nodes == {}
    merged = merge([project.graph(frames=())])
    assert merged.stages["show"] == ()
    assert merged.expand(["show"]) == []


def test_a_failure_of_a_shared_node_is_every_points(project, notes):
    project.add_line("numbers", "raise ValueError('shared')")
    graphs = [project.graph(seed=seed) for seed in (1, 2)]
    execution = project.run(merge(graphs), keep_going=True, progress=notes)
    assert len(execution.failures) == 1
    for graph in graphs:
        node, failure = execution.failure_of([graph.of_stage("gather")[0].key])
        assert failure.label == "numbers" and node in execution.failures


LIMIT = 1.5
"""Seconds. Long for a node that does nothing, also on a busy machine."""

LOCAL = LocalExecutor("local", 2, LIMIT)
HANG = "import time; time.sleep(600); log.called('slept')"


def test_it_is_killed_and_named_and_not_tried_again(project, notes):
    project.add_line("gather", HANG)
    with pytest.raises(StageFailure, match=r"gather: .*exceeded its time limit of 1.5 s") as caught:
        project.run(executor=LOCAL, progress=notes)
    assert isinstance(caught.value.cause, TimeLimitExceeded)
    assert "in gather" in caught.value.traceback_text, "where it hung"
    calls = project.calls()
    assert calls.count("gather") == 1 and "slept" not in calls
    assert notes.notes == []


def test_other_running_nodes_are_submitted_again(project, notes):
    project.add_line("gather", HANG)
    execution = project.run(executor=LOCAL, keep_going=True, progress=notes)
    assert [failure.label for failure in execution.failures.values()] == ["gather"]
    found = statuses(execution)
    assert found.pop("gather") == "failed" and {*found.values()} == {"computed"}
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
    project.add_line("gather", HANG)
    project.forget()
    with pytest.raises(StageFailure, match=r"gather: .*exceeded its time limit of 0\.2 s"):
        project.run(executor=LocalExecutor("local", 2, 0.2))
    assert "slept" not in project.calls()


def test_the_time_a_lock_is_held_by_another_does_not_count(project):
    graph = project.graph()
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
