"""Executions: what is computed and what is not, and that the results do not depend on how."""

import json
import os

import numpy as np
import pytest
from executors import EXECUTORS

from stixel_cli.engine.execute import execute
from stixel_cli.engine.parameters import LocalExecutor
from stixel_cli.engine.plan import DURATIONS, plan
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
        (project.store.entry(node.key) / VALUE).unlink()
        (project.store.entry(node.key) / "meta.json").unlink()
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
        ("helpers", "# a comment", "# another", set()),
        ("double", "A docstring.", "Another.", set()),
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


def test_edited_code_that_is_imported_already_runs_in_a_new_process(project):
    graph = project.graph()
    project.run(graph)
    project.edit("show", "return doubled.first, grid", "return doubled.first, -grid")
    # As in a notebook: the old module is still loaded.
    graph = project.graph()
    execute(graph, ["show"], project.store, EXECUTORS["local"])
    assert load(project, graph, "show") == [(0, -12.0, 2), (8, -54.0, 9)]


def test_plan_computes_and_writes_nothing(project):
    graph = project.graph()
    planned = plan(graph, ["gather"], project.store)
    assert set(planned.missing) == set(planned.needed) == graph.ancestors(graph.expand(["gather"]))
    assert project.calls() == [] and not project.store.folder.exists()
    project.run(graph, targets=["double"])
    missing = plan(graph, ["gather"], project.store).missing
    assert [graph.nodes[key].stage.name for key in missing] == ["running"] * 3 + ["gather"]


def test_a_chunk_sequence_can_be_read_again_and_in_part(project):
    project.edit(
        "gather",
        "return [chunk.total() for chunk in doubled], list(running), noise",
        "return len(doubled), doubled[-1].first, [c.first for c in doubled[1:]], "
        "[c.first for c in doubled] == [c.first for c in doubled]",
    )
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


def test_few_first_targets_are_computed_in_this_process(project):
    project.add_line("gather", "log.process()")
    project.edit("show", "return", "log.process(); return")
    with (project.package / "log.py").open("a") as file:
        file.write("\ndef process():\n    called(str(os.getpid()))\n")
    project.run()
    project.calls()
    known = {project.function("gather"): 0.01, project.function("show"): 100.0}
    (project.store.folder / DURATIONS).write_text(json.dumps(known))
    project.run(
        project.graph(seed=2, frames=(3,)),
        targets=("gather", "grid", "show"),
        executor=LocalExecutor("local", 1, None),
        first=["gather"],
    )
    calls = project.calls()
    assert calls[1:] == [calls[1], "gather", "grid 3", "show 3"]
    assert sum(call == str(os.getpid()) for call in calls) == 1, "gather here, show in a worker"
