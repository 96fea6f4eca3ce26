"""A program that edits the tree in the working folder and prints the edits that no key shows.

It prints JSON: the number of edits of each kind, and the names of those whose stages keep their
keys. The edited code is not executed: keys are of the files.
"""

import ast
import json
import random
import sys
from pathlib import Path

import stixel_cli
from stixel_cli.config.compose import compose
from stixel_cli.experiment.stages import experiment_graph

RUNS = (
    ("path.duration=0.4", "road_user.mesh=wedge.obj"),
    ("measurement=lidar", "path.duration=0.4", "tracker=gp_ekf"),
    (
        *("measurement=file", "measurement.path=scans.csv", "measurement.truth=truth.csv"),
        "tracker=contour",
    ),
)
EACH = 4
"""Edited modules of each kind."""

FILES = (
    ("conf/tracker/gp_ekf.yaml", "sigma_f:", "sigma_f: 0.77 #", 1, "track"),
    ("conf/config.yaml", "- stereo: sgm", "- stereo: bm", 0, "match"),
    ("conf/pace/car.yaml", "turn_speed:", "turn_speed: 3.21 #", 0, "scenario"),
    ("pipelines/stixels.yaml", "{pairs: add_sensor_noise}", "{pairs: render}", 0, "match"),
    (
        "stixel_cli/tracking/contour/class_shapes.json",
        '"size": [ 4520',
        '"size": [4521',
        2,
        "track",
    ),
    ("wedge.obj", "v 3 1 3", "v 3.5 1 3", 0, "scenario"),
    ("wedge.mtl", "map_Kd", "map_Ka", 0, "render"),
    ("scans.csv", "0,0.0,1,9", "0,0.0,1,9.5", 2, "scans"),
    ("truth.csv", "0,0,10", "0,0,11", 2, "scenario"),
)
"""File, text, its replacement, number of the run and a stage that reads the file."""


def imports(tree):
    """The first name that a module imports is bound to another one."""
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            node.names[0].asname = "bound_to_another_name"
            return True
    return False


def decorators(tree):
    """The first function has one decorator more."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.decorator_list.append(ast.Name("decorated"))
            return True
    return False


def constants(tree):
    """The first number is another one."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            node.value += 1
            return True
    return False


def registries(tree):
    """The first table of a module lacks an entry."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict) and node.value.keys:
            del node.value.keys[-1], node.value.values[-1]
            return True
    return False


def keys(run):
    """The key of each node of a run."""
    graph = experiment_graph(compose(RUNS[run]))
    return {(name, i): n for name in graph.stages for i, n in enumerate(graph.of_stage(name))}


def stale(path, text, run, stages):
    """Whether a stage keeps its key while `path` has another text."""
    before = path.read_bytes()
    path.write_text(text, encoding="utf-8")
    try:
        after = keys(run)
    finally:
        path.write_bytes(before)
    return any(after[one].key == node.key for one, node in stages.items() if one in after)


def main():
    """Edit the copy."""
    assert Path(stixel_cli.__file__).is_relative_to(Path.cwd()), stixel_cli.__file__
    rng, runs, counts, wrong = random.Random(0), [keys(i) for i in range(len(RUNS))], {}, []
    readers = {}
    for run, nodes in enumerate(runs):
        for name, node in nodes.items():
            for path, _ in node.identity.code.files.values():
                readers.setdefault((path, run), {})[name] = node
    for edit in (imports, decorators, constants, registries):
        counts[edit.__name__] = 0
        for path, run in rng.sample(sorted(readers), len(readers)):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            if counts[edit.__name__] < EACH and edit(tree):
                counts[edit.__name__] += 1
                text = ast.unparse(ast.fix_missing_locations(tree))
                if stale(path, text, run, readers[path, run]):
                    wrong.append(f"{edit.__name__} of {path}, run {run}")
    for name, old, new, run, stage in FILES:
        path = Path(name)
        text = path.read_text(encoding="utf-8")
        assert old in text, (name, old)
        own = {one: node for one, node in runs[run].items() if one[0] == stage}
        assert own, stage
        if stale(path, text.replace(old, new, 1), run, own):
            wrong.append(f"{name}: {new}")
    counts["files"] = len(FILES)
    json.dump({"counts": counts, "stale": wrong}, sys.stdout)


if __name__ == "__main__":
    main()
