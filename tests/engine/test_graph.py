"""From stages to nodes: chunks, labels, who takes what from whom, and what is refused."""

from dataclasses import replace

import pytest

from stixel_cli.engine.graph import GraphBuilder


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
