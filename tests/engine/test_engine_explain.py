"""Why a node would run: the key that changed, the function, the version, or the cache's doing."""

import shutil
from dataclasses import replace

import pytest

from stixel_cli.engine.entries import collect
from stixel_cli.engine.explain import by_stage, explain
from stixel_cli.engine.graph import GraphBuilder

FRAMES, CHUNK = 10, 4


@pytest.fixture
def reasons(project):
    """The reasons of each node that would run, by its label, after a first run."""
    project.run()

    def reasons(graph, targets=None):
        return {one.label: one.text for one in explain(graph, project.store, targets)}

    return reasons


def test_a_setting_its_dependents_the_seed_a_version_and_groups_of_equal_reasons(
    project, reasons, monkeypatch
):
    answer = reasons(project.graph(factor=2.5))
    assert answer["double[4:8]"] == "gain.factor changed from 2.0 to 2.5"
    assert answer["running[0:4]"] == "input changed: double"
    assert answer["show[9]"] == "input changed: double; input changed: grid"
    assert "numbers" not in answer
    assert reasons(project.graph(seed=7)) == {"gather": "seed changed from 1 to 7"}
    groups = by_stage(explain(project.graph(factor=2.5), project.store, ["double", "running"]))
    texts = ["gain.factor changed from 2.0 to 2.5", "input changed: double"]
    assert [(len(group), text) for group, text in groups] == [(3, text) for text in texts]
    monkeypatch.setattr("stixel_cli.engine.versions.installed_version", lambda name: "0.0")
    answer = reasons(project.graph(), ["numbers"])["numbers"]
    assert answer.startswith("numpy changed from ") and answer.endswith(" to 0.0")


def test_a_setting_has_the_name_of_its_key(project, reasons):
    first, double, *others = project.stages(factor=2.5)
    named = [first, replace(double, keys={"gain": "world.gain"}), *others]
    graph = GraphBuilder().build(named, FRAMES, CHUNK)
    assert graph.nodes.keys() == project.graph(factor=2.5).nodes.keys(), "no part of the key"
    answer = reasons(graph, ["double"])
    assert answer["double[4:8]"] == "world.gain.factor changed from 2.0 to 2.5"


def test_a_setting_that_only_one_of_the_two_has(project, reasons):
    project.edit("numbers", "def numbers(count)", "def numbers(count, start=0.0)")
    project.forget()
    (stage, *_) = project.stages()
    with_start = replace(stage, settings={"count": FRAMES, "start": 1.0})
    graph = GraphBuilder().build([with_start], FRAMES, CHUNK)
    assert reasons(graph)["numbers"].startswith("start is read now; code: ")
    project.run(graph, ["numbers"])
    for path in project.store.folder.glob("??/*"):
        notes = project.store.meta(path.name)
        if notes["stage"] == "numbers" and "start" not in notes["settings"]:
            shutil.rmtree(path)
    graph = GraphBuilder().build([replace(stage, settings={"count": 7})], FRAMES, CHUNK)
    assert reasons(graph)["numbers"] == "count changed from 10 to 7; start is no longer read"


def test_another_function(project, reasons):
    project.write("other", "def other(rig):\n    return rig")
    project.forget()
    before, after = project.function("numbers"), project.function("other")
    other = replace(project.stages()[0], function=after, settings={"rig": 3})
    graph = GraphBuilder().build([other], FRAMES, CHUNK)
    # What the other function reads is no change of its own.
    assert reasons(graph)["numbers"] == f"its function changed from {before} to {after}"


def test_the_nearest_has_the_same_function(project):
    project.write("twin", "def twin(numbers, gain, frames):\n    return 1")
    project.forget()
    numbers, double, *_ = project.stages()
    twin = replace(double, function=project.function("twin"))
    project.run(GraphBuilder().build([numbers, twin], FRAMES, CHUNK), ["double"])
    few = [numbers, project.stages(factor=9.0)[1]]
    project.run(GraphBuilder().build(few, 4, CHUNK), ["double"])
    graph = GraphBuilder().build([numbers, double], FRAMES, CHUNK)
    found = {one.label: one.text for one in explain(graph, project.store, ["double"])}
    # Other frames of the same function are nearer than the same frames of another.
    assert "its function" not in found["double[4:8]"]


def test_code_that_changed_and_not_what_is_reached_because_of_it(project, reasons):
    project.edit("helpers", "FACTOR * values", "values * FACTOR")
    project.edit("helpers", "FACTOR = 3.0", "FACTOR = 3.5")
    project.forget()
    change = f"code: {project.name}.helpers changed"
    assert reasons(project.graph(), ["double"])["double[0:4]"] == change
    project.write("more", "OFFSET = 1.0")
    project.edit("helpers", "UNUSED = 1.0", "from .more import OFFSET as UNUSED")
    project.forget()
    # What is reached because of the change is not a second reason.
    assert reasons(project.graph())["double[0:4]"] == change


def test_a_file(project, tmp_path):
    mesh = tmp_path / "mesh"
    mesh.write_text("a")
    stage = replace(project.stages()[0], files=(mesh,))
    project.run(GraphBuilder().build([stage], FRAMES, CHUNK), ["numbers"])
    mesh.write_text("b")
    (one,) = explain(GraphBuilder().build([stage], FRAMES, CHUNK), project.store)
    assert one.text == f"the content of {mesh} changed"


def test_a_stored_input_is_followed_to_its_change_and_the_most_alike_is_compared(project, reasons):
    other = project.graph(factor=4.0)
    project.run(other, ["double"])
    answer = reasons(project.graph(factor=4.0))["running[0:4]"]
    assert answer == "input changed: double; gain.factor changed from 2.0 to 4.0"
    project.run(project.graph(factor=9.0, offset=1.0))
    answer = reasons(project.graph(factor=9.0, offset=2.0))
    assert answer["double[0:4]"] == "gain.offset changed from 1.0 to 2.0"


def test_a_removed_result(project, reasons):
    graph = project.graph()
    first, other = (node.key for node in graph.of_stage("double")[:2])
    for key in (first, other):
        project.store.remove(key)
    found = explain(graph, project.store, [first, other], ({first}, {}))
    new = "new: no result of double[4:8] is stored"
    assert {one.key: one.text for one in found} == {first: "removed from the cache", other: new}
    collect(project.store, max_size=0)
    assert reasons(graph, ["numbers"]) == {"numbers": "new: no result of numbers is stored"}


def test_the_folders_own_results_are_compared_however_many_others_there_are(project, monkeypatch):
    first = project.graph()
    project.run()
    project.run(project.graph(factor=2.4))
    monkeypatch.setattr("stixel_cli.engine.entries.COMPARED", 1)
    folder = {node.key for node in first.nodes.values()}, {}
    found = explain(project.graph(factor=2.5), project.store, ["double"], folder)
    assert {one.text for one in found} == {"gain.factor changed from 2.0 to 2.5"}
