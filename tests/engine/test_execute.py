"""Executions: what is computed and what is not, that results do not depend on how, and progress."""

import os
import sys
from dataclasses import replace

import numpy as np
import pytest

from stixel_cli.engine import progress as progress_module
from stixel_cli.engine.cache_folder import store_json
from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.parameters import LocalExecutor
from stixel_cli.engine.plan import DURATIONS, Durations, plan
from stixel_cli.engine.progress import Display, Progress, crash_note
from stixel_cli.engine.store import VALUE

DOUBLE = ["double 0", "double 4", "double 8"]
RUNNING = ["running 0", "running 4", "running 8"]
PICKS = ["grid 2", "grid 9", "show 2", "show 9"]
ALL = sorted(["numbers", *DOUBLE, *RUNNING, "gather", *PICKS])


def load(project, graph, name):
    return [project.store.load(node.key) for node in graph.of_stage(name)]


def test_the_patterns(project):
    graph = project.graph()
    project.run(graph)
    expected = [6.0 * np.arange(0, 4), 6.0 * np.arange(4, 8), 6.0 * np.arange(8, 10)]
    double = load(project, graph, "double")
    assert [chunk.first for chunk in double] == [0, 4, 8]
    for chunk, values in zip(double, expected, strict=True):
        np.testing.assert_array_equal(chunk.values, values)
    totals = [values.sum() for values in expected]
    assert load(project, graph, "running") == list(np.cumsum(totals))
    sums, running, noise = load(project, graph, "gather")[0]
    assert (sums, running) == (totals, list(np.cumsum(totals)))
    np.testing.assert_array_equal(noise, np.random.default_rng(1).normal(size=3))
    assert load(project, graph, "show") == [(0, 12.0, 2), (8, 54.0, 9)]


def test_a_second_run_computes_nothing_and_needs_no_inputs_of_cached_results(project):
    first = project.run()
    assert project.calls() == ALL
    second = project.run()
    assert project.calls() == []
    assert {*first.status.values()} == {"computed"}
    assert {*second.status.values()} == {"cached"}
    for record in second.stage_records():
        assert (record["status"], record["seconds"], record["nodes_computed"]) == ("cached", 0.0, 0)
    graph = project.graph()
    project.run(graph)
    for node in graph.of_stage("double") + graph.of_stage("numbers"):
        for name in (VALUE, "meta.json"):
            (project.store.entry(node.key) / name).unlink()
    project.calls()
    project.run(graph)
    assert project.calls() == []


def test_only_nodes_that_the_targets_need_run(project):
    graph = project.graph()
    execution = project.run(graph, targets=[graph.of_stage("grid")[1].key])
    assert project.calls() == ["double 8", "grid 9", "numbers"]
    assert {record["name"] for record in execution.stage_records()} == {"numbers", "double", "grid"}
    project.run(graph, targets=["grid"])
    assert project.calls() == ["double 0", "grid 2"]


def test_records_by_stage(project):
    graph = project.graph()
    project.run(graph, targets=["numbers"])
    execution = project.run(graph)
    records = {record["name"]: record for record in execution.stage_records()}
    assert list(records) == list(graph.stages)
    double = records["double"]
    assert [double[name] for name in ("status", "nodes", "nodes_computed")] == ["computed", 3, 3]
    assert double["seconds"] > 0.0 and len(double["key"]) == 64
    for node in graph.of_stage("double"):
        notes = project.store.meta(node.key)
        assert 0.0 <= notes["cpu_seconds"] <= notes["seconds"] + 0.02
    numbers = records["numbers"]
    assert (numbers["status"], numbers["key"]) == ("cached", graph.of_stage("numbers")[0].key)


@pytest.mark.parametrize(
    ("module", "old", "new", "rerun"),
    [
        ("helpers", "FACTOR * values", "values * FACTOR * 2", set(ALL) - {"numbers"}),
        ("helpers", "FACTOR = 3.0", "FACTOR = 4.0", set(ALL) - {"numbers"}),
        ("helpers", "UNUSED * values", "UNUSED + values", set(ALL) - {"numbers"}),
        ("gather", "list(running)", "list(running)[:]", {"gather"}),
        ("running", "0.0 if previous is None", "1.0 if previous is None", {*RUNNING, "gather"}),
        ("show", "return doubled.first, grid", "return doubled.first, -grid", {*PICKS[2:]}),
    ],
)
def test_an_edit_reruns_the_stage_and_its_dependents(project, module, old, new, rerun):
    project.run()
    project.calls()
    project.edit(module, old, new)
    project.run()
    assert set(project.calls()) == rerun
    project.edit(module, new, old)
    project.run()
    assert project.calls() == [], "the code is as it was, and its results are still there"


def test_the_same_bytes_on_any_executor(project):
    graph = project.graph()
    found = []
    for executor in ("serial", "threads", LocalExecutor("local", 1, None), "local"):
        project.store.folder = project.folder / f"cache-{len(found)}"
        project.run(graph, executor=executor)
        assert project.calls() == ALL
        found.append(project.contents(graph))
        assert len(found[-1]) == len(graph.nodes)
    assert found[0] == found[1] == found[2] == found[3]


def test_small_known_work_starts_no_workers(project, monkeypatch):
    project.run()
    # However long it has taken on a busy machine.
    for name in ("SMALL", "SMALL_FOR_COPIES"):
        monkeypatch.setattr(f"stixel_cli.engine.execute.{name}", 600.0)
    monkeypatch.setattr("stixel_cli.engine.execute.make_pool", None)
    project.calls()
    project.run(project.graph(seed=2), executor="local")
    assert project.calls() == ["gather"]


def test_plan_computes_and_writes_nothing(project):
    graph = project.graph()
    planned = plan(graph, ["gather"], project.store)
    assert set(planned.missing) == set(planned.needed) == graph.ancestors(["gather"])
    assert project.calls() == [] and not project.store.folder.exists()
    project.run(graph, targets=["double"])
    missing = plan(graph, ["gather"], project.store).missing
    assert [graph.nodes[key].stage.name for key in missing] == ["running"] * 3 + ["gather"]


def test_a_chunk_sequence_can_be_read_again_and_in_part(project):
    old = "return [chunk.total() for chunk in doubled], list(running), noise"
    new = "return len(doubled), doubled[-1].first, [c.first for c in doubled[1:]], "
    project.edit("gather", old, f"{new}[c.first for c in doubled] == [c.first for c in doubled]")
    graph = project.graph()
    project.run(graph)
    assert load(project, graph, "gather") == [(3, 8, [4, 8], True)]


@pytest.mark.parametrize("executor", ["serial", "threads", "local"])
def test_the_first_targets_are_computed_before_the_others(project, executor):
    graph = project.graph()
    stored = []

    def on_first():
        stored.append({node.label for node in graph.nodes.values() if project.store.has(node.key)})

    options = {"executor": executor, "workers": 1, "on_first": on_first}
    project.run(graph, first=["gather"], **options)
    assert len(stored) == 1 and "gather" in stored[0]
    if executor == "serial":
        assert not any(label.startswith(("grid", "show")) for label in stored[0])
    project.run(graph, first=["gather"], **options)
    assert len(stored) == 2, "also if everything is cached"


def test_few_first_targets_are_computed_in_this_process(project, monkeypatch):
    project.add_line("gather", "import os; log.called(str(os.getpid()))")
    project.edit("show", "return", "import os; log.called(str(os.getpid())); return")
    project.run()
    project.calls()
    known = {project.function("gather"): 0.01, project.function("show"): 100.0}
    store_json(project.store.folder, "", DURATIONS, known)
    begun, options = [], {"executor": LocalExecutor("local", 1, None), "first": ["gather"]}
    monkeypatch.setattr(Progress, "started", lambda _, node: begun.append(node.stage.name))
    project.run(project.graph(seed=2, frames=(3, 5)), ("gather", "grid", "show"), **options)
    calls = project.calls()
    assert begun[:2] == ["grid", "gather"], "no worker waits for this process, or has work to come"
    assert calls[3:] == ["gather", "grid 3", "grid 5", "show 3", "show 5"]
    assert sum(call == str(os.getpid()) for call in calls) == 1, "gather here, show in a worker"


FRAMES_OF_PROGRESS = 10
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
    progress = Progress(visible=True)
    progress.known = dict.fromkeys(("double", "running", "gather", "grid"), 3.0)
    feed(progress, project, clock, 3.0)
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
    lines.known, lines.workers = {"double": 30.0, "running": 60.0}, 2
    graph = project.graph()
    nodes = [*graph.of_stage("double"), *graph.of_stage("running")]
    lines.begin(nodes, cached=0)
    assert lines.seconds_left() == 0.5 * (3 * 30.0 + 3 * 60.0)
    lines.started(nodes[0])
    clock[0] += 20.0
    lines.tick()
    said = capsys.readouterr().err
    assert said == f"stixel: [0 %] about 2 min left; double 0/{FRAMES_OF_PROGRESS} frames\n"
    for node in nodes[:2]:
        lines.finished(node, 900.0)
    assert lines.seconds_left() == 0.5 * (30.0 + 3 * 60.0), "each worker's first node compiles"
    lines.finished(nodes[2], 20.0)
    assert lines.share == 0.25
    lines.extend(nodes[:3])
    assert lines.seconds_left() == 0.5 * (3 * 20.0 + 3 * 60.0), "by what was seen"
    assert lines.share == 0.25, "it never falls"


def test_no_time_is_estimated_before_each_stage_has_run_on_each_worker(project):
    lines = Progress()
    lines.known, lines.workers = {}, 2
    graph = project.graph()
    double, running = graph.of_stage("double"), graph.of_stage("running")
    lines.begin([*double, *double, *running, *running], cached=0)
    for node, seconds in (*((n, 20.0) for n in double), *((n, 900.0) for n in running[:2])):
        lines.finished(node, seconds)
        assert (lines.seconds_left(), lines.text_left) == (None, "")
    assert lines.share == pytest.approx(5 / 12), "of the nodes"
    lines.finished(running[2], 80.0)
    assert lines.seconds_left() == 0.5 * (3 * 20.0 + 3 * 80.0)
    assert lines.text_left == "about 2 min left; "
    failure = StageFailure("running", "running[0:4]", ValueError("no"), "")
    lines.failed(running[0], failure, running[1:])
    assert lines.seconds_left() == 0.5 * 3 * 20.0


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


def test_the_first_nodes_of_the_workers_only_lower_an_estimate(project):
    graph = project.graph()
    nodes = graph.of_stage("double")

    def learned(seconds, workers):
        durations = Durations(project.store.folder)
        by_key = {n.key: one * n.work for n, one in zip(nodes, seconds, strict=False)}
        durations.learn(graph, by_key, workers)
        return Durations(project.store.folder).estimate([replace(nodes[0], first=0, stop=1)])[0]

    assert learned([9.0], 2) == 9.0, "nothing else is known"
    assert learned([7.0, 3.0], 2) == 5.0
    assert learned([9.0, 9.0], 2) == 5.0
    assert learned([9.0, 9.0, 1.0], 2) == 3.0, "half old, half of the third node"
    assert learned([9.0], 1) == 3.0


@pytest.mark.parametrize("terminal", [False, True])
def test_a_short_execution_shows_nothing(project, clock, capsys, monkeypatch, terminal):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    feed(Progress(visible=True), project, clock, 0.01)
    assert capsys.readouterr() == ("", "stixel: recomputed\n")


def test_the_note_on_a_crashed_worker():
    note = crash_note(["double", "double", "grid[0:10]"], True)
    assert "double (2 nodes), grid[0:10]; retrying them one at a time" in note
    assert crash_note(["double"], True).endswith("retrying it")
    assert crash_note(["double"], False) == "a worker crashed while running double"
