"""From stages to nodes, and their keys: the same for the same work, another for any other."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stixel_cli.engine.graph import GraphBuilder
from stixel_cli.engine.keys import canonical, digest
from stixel_cli.errors import UserError


def labels(graph, name):
    return [node.label for node in graph.of_stage(name)]


def test_targets_are_stages_or_nodes(project):
    graph = project.graph()
    node = graph.of_stage("double")[1].key
    assert graph.expand(["gather", node]) == [graph.of_stage("gather")[0].key, node]
    assert graph.ancestors([node]) == {node, graph.of_stage("numbers")[0].key}
    with pytest.raises(KeyError, match="nothing"):
        graph.expand(["nothing"])


@pytest.mark.parametrize(
    ("index", "changes", "message"),
    [
        (0, {"name": "double"}, "name double"),
        (1, {"inputs": {"numbers": "none"}}, "unknown input none"),
        (1, {"inputs": {"gain": "numbers"}}, "'gain' is given twice"),
        (1, {"settings": {"frames": 1}}, "'frames' is given twice"),
        (3, {"settings": {"seed": 1}}, "'seed' is given twice"),
        (1, {"pattern": "each"}, "'each' is not a pattern"),
        (1, {"frames": (1,)}, "frames are for the pattern pick"),
        (4, {"frames": (10,)}, "frame 10 is not in 0 … 9"),
        (4, {"frames": (2,)}, "show needs frame 9 of grid"),
        (0, {"inputs": {"count": "gather"}, "settings": {}}, "depend on each other"),
        (0, {"function": "steps"}, "is not package.module:function"),
    ],
)
def test_refuses_stages_that_contradict(project, index, changes, message):
    stages = project.stages()
    stages[index] = replace(stages[index], **changes)
    with pytest.raises(ValueError, match=message):
        GraphBuilder().build(stages, 10, 4)


@pytest.mark.parametrize(("frames", "chunk"), [(0, 4), (10, 0)])
def test_refuses_nothing_to_run_over(project, frames, chunk):
    with pytest.raises(ValueError, match="no frames"):
        GraphBuilder().build(project.stages(), frames, chunk)


CHUNK, FRAMES = 4, 10


@dataclass(frozen=True)
class One:
    a: float


@dataclass(frozen=True)
class Other:
    a: float


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text(), inner, max_size=3)
    ),
    max_leaves=6,
)


def spelled(value):
    """A text that tells values apart as keys should."""
    if isinstance(value, dict):
        return ("dict", sorted((key, repr(spelled(value[key]))) for key in value))
    if isinstance(value, list | tuple):
        return (type(value).__name__, [spelled(item) for item in value])
    return (type(value).__name__, repr(value))


@settings(max_examples=200)
@given(plain, plain)
def test_digests_agree_exactly_when_values_do(one, other):
    same = digest(canonical(one)) == digest(canonical(other))
    assert same == (spelled(one) == spelled(other))


def test_values_differ_by_type_and_container_but_for_numpys_floats():
    values = [0.0, -0.0, 0, False, None, "0", (), [], {}, (0.0,), [0.0], One(0.0), Other(0.0)]
    values += [0.1 + 0.2, 0.3, {"a": 0.0}, {"b": 0.0}, "0.0", float("inf")]
    assert len({digest(canonical(value)) for value in values}) == len(values)
    assert canonical(np.float64(0.25)) == canonical(0.25)


@pytest.mark.parametrize("value", [{1, 2}, np.zeros(2), object(), {1: 2}, One, (np.int64(1),)])
def test_a_value_without_canonical_form_is_an_error(value):
    with pytest.raises(TypeError, match="cannot be part of a key"):
        canonical(value)


def keys(graph, *stages):
    return [node.key for name in stages for node in graph.of_stage(name)]


ALL = ("numbers", "double", "running", "gather", "grid", "show")


def test_other_pictures_leave_the_rest_alone(project):
    before, after = project.graph(), project.graph(frames=(2, 5))
    others = [name for name in ALL if name not in ("grid", "show")]
    assert keys(before, *others) == keys(after, *others)
    assert keys(before, "show")[0] == keys(after, "show")[0]
    assert keys(before, "show")[1] != keys(after, "show")[1]


def test_every_part_of_a_stage_counts(project, tmp_path):
    file = tmp_path / "mesh"
    file.write_text("a")
    stage = replace(project.stages()[0], files=(file,))

    def key(stage):
        return GraphBuilder().build([stage], FRAMES, CHUNK).of_stage(stage.name)[0].key

    found = [
        key(stage),
        key(replace(stage, name="counts")),
        key(replace(stage, function=project.function("gather"))),
        key(replace(stage, settings={"count": 11})),
        key(replace(stage, settings={"size": 10})),
        key(replace(stage, modules=(f"{project.name}.helpers",))),
        key(replace(stage, seed=1)),
        key(replace(stage, files=())),
    ]
    file.write_text("b")
    found.append(key(stage))
    assert len(set(found)) == len(found)


def test_a_file_without_an_end_is_refused(project, tmp_path):
    os.mkfifo(tmp_path / "fifo")
    for file in (tmp_path / "fifo", Path("/dev/zero")):
        stage = replace(project.stages()[0], files=(file,))
        with pytest.raises(UserError, match=f"{file}: not a regular file"):
            GraphBuilder().build([stage], FRAMES, CHUNK)
