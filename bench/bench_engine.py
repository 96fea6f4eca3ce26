"""Overhead of the engine: per node (goal 5 ms), of a plan, of the cleanup, of the code's digests.

pytest bench/bench_engine.py
"""

import itertools
import pickle
import sys
import time
from dataclasses import replace

import joblib
import numpy as np
import pytest
from small import sized

from stixel_cli.api import run
from stixel_cli.engine import source_files
from stixel_cli.engine.code import CodeIndex
from stixel_cli.engine.entries import entries, keep_limit
from stixel_cli.engine.execute import execute
from stixel_cli.engine.explain import explain
from stixel_cli.engine.graph import GraphBuilder, merge
from stixel_cli.engine.keys import Stage
from stixel_cli.engine.parameters import LocalExecutor, ThreadsExecutor
from stixel_cli.engine.plan import plan
from stixel_cli.engine.store import Store

NODES = sized(200, 8)
EXECUTORS = {
    "serial": None,
    "local": LocalExecutor("local", 2, None),
    "threads": ThreadsExecutor("threads", 2),
}
STAGES = """
import numpy as np

def make(frames, seed):
    return np.zeros(1000)

def add(made, frames, previous):
    return made + (0.0 if previous is None else previous)
"""


@pytest.fixture
def graph(tmp_path, monkeypatch):
    (tmp_path / "bench_stages.py").write_text(STAGES)
    monkeypatch.syspath_prepend(str(tmp_path))
    sys.modules.pop("bench_stages", None)
    stages = [
        Stage("make", "bench_stages:make", "map", {}, {}, seed=1),
        Stage("add", "bench_stages:add", "fold", {"made": "make"}, {}),
    ]
    return GraphBuilder().build(stages, NODES // 2, 1)


def plain(graph):
    """The same work without the engine: plain calls in order."""
    import bench_stages

    previous = None
    for k in range(NODES // 2):
        previous = bench_stages.add(bench_stages.make(range(k, k + 1), 1), None, previous)


@pytest.mark.benchmark(group="200 empty nodes")
def test_plain_calls(benchmark, graph):
    benchmark(plain, graph)


@pytest.mark.benchmark(group="200 empty nodes")
@pytest.mark.parametrize("executor", EXECUTORS)
def test_overhead_of_a_node(benchmark, graph, tmp_path, executor):
    """Time with the start of the workers; the extra info has milliseconds per node."""
    folders = (Store(tmp_path / f"cache-{i}") for i in itertools.count())
    # Unknown durations, so that `local` starts its workers.
    benchmark.pedantic(
        lambda store: execute(graph, ["add"], store, executor=EXECUTORS[executor]),
        setup=lambda: ((next(folders),), {}),
        rounds=3,
    )
    benchmark.extra_info["ms per node, with start"] = 1e3 * benchmark.stats.stats.median / NODES


@pytest.mark.benchmark(group="400 more nodes")
@pytest.mark.parametrize("executor", [*EXECUTORS][: sized(None, 2)])
def test_overhead_without_the_start(benchmark, tmp_path, executor, graph):
    """Time per node of 600 nodes minus 200 nodes, so without the start of the workers."""

    def seconds(nodes, seed):
        stages = [
            replace(node.stage, seed=seed) if node.stage.name == "make" else node.stage
            for node in (graph.of_stage("make")[0], graph.of_stage("add")[0])
        ]
        store = Store(tmp_path / f"cache-{nodes}-{seed}")
        started = time.perf_counter()
        execute(
            GraphBuilder().build(stages, nodes // 2, 1),
            ["add"],
            store,
            executor=EXECUTORS[executor],
        )
        return time.perf_counter() - started

    found = [(seconds(3 * NODES, i) - seconds(NODES, i)) / (2 * NODES) for i in range(sized(3, 1))]
    benchmark.extra_info["ms per node"] = 1e3 * sorted(found)[len(found) // 2]
    benchmark.pedantic(lambda: None, rounds=1)


POINTS = sized(1000, 50)


@pytest.fixture
def points(tmp_path, monkeypatch):
    """Stages of 1,000 points that differ in their last stage's seed alone: 15 stages, 65 nodes."""
    text = STAGES + "\n\ndef last(added, seed):\n    return seed\n"
    (tmp_path / "bench_points.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    sys.modules.pop("bench_points", None)

    def stages(i):
        first = [Stage(f"make{j}", "bench_points:make", "map", {}, {}, seed=j) for j in range(5)]
        second = [
            Stage(f"add{j}", "bench_points:add", "fold", {"made": f"make{j}"}, {}) for j in range(5)
        ]
        third = [
            Stage(f"last{j}", "bench_points:last", "once", {"added": f"add{j}"}, {}, seed=i)
            for j in range(5)
        ]
        return [*first, *second, *third]

    return [stages(i) for i in range(POINTS)]


@pytest.mark.benchmark(group="plan of 1,000 points, 65 nodes each, all cached")
@pytest.mark.parametrize("how", ["one by one", "merged"])
def test_plan_of_many_points(benchmark, points, tmp_path, how):
    """From stages to what is missing (goal 3 s with the configurations composed as well)."""
    store = Store(tmp_path / "cache")
    if how == "merged":
        builder = GraphBuilder()
        graph = merge(builder.build(stages, 60, 10) for stages in points)
        for key, node in graph.nodes.items():
            store.save(key, 0, stage=node.stage.name)

    def merged():
        builder = GraphBuilder()
        graph = merge(builder.build(stages, 60, 10) for stages in points)
        return plan(graph, list(graph.stages), store, verify=False)

    def one_by_one():
        for stages in points[:50]:
            graph = GraphBuilder().build(stages, 60, 10)
            plan(graph, list(graph.stages), store, verify=False)

    if how == "merged":
        planned = benchmark.pedantic(merged, rounds=3)
        assert not planned.missing
        benchmark.extra_info["nodes"] = len(planned.needed)
    else:
        # Of 50 points only; the time of all is twenty times as long.
        benchmark.pedantic(one_by_one, rounds=1)
        benchmark.extra_info["s for 1,000 points"] = 20 * benchmark.stats.stats.median


@pytest.mark.benchmark(group="look at 5,000 entries")
@pytest.mark.parametrize("what", ["limit", "list", "explain"])
def test_upkeep(benchmark, graph, tmp_path, what):
    store = Store(tmp_path / "cache", max_size=10**12)
    modules = {f"package.module{i}": f"{i:032x}" for i in range(40)}
    for i in range(sized(5000, 50)):
        stage = f"stage{i % 16}" if i % 16 else "make"
        store.save(f"{i:064x}"[::-1], 0, stage=stage, label="x", modules=modules, created=0.0)
    run = {
        "limit": lambda: keep_limit(store),
        "list": lambda: entries(store),
        "explain": lambda: explain(graph, store, ["make"]),
    }[what]
    benchmark.pedantic(run, rounds=3)


@pytest.mark.benchmark(group="200 cached nodes")
def test_plan_of_cached_nodes(benchmark, graph, tmp_path):
    store = Store(tmp_path / "cache")
    execute(graph, ["add"], store)
    planned = benchmark(plan, graph, ["add"], store)
    assert not planned.missing


@pytest.fixture(scope="module")
def scores(tmp_path_factory):
    """The scores of a run: a few dataclasses with many small arrays."""
    overrides = ["measurement=fabricated", *sized([], ["path.duration=1", "executor=threads"])]
    found = run(*overrides, cache=tmp_path_factory.mktemp("scores"))
    return found.scores


@pytest.mark.benchmark(group="write and read a result")
@pytest.mark.parametrize("what", ["200 MB", "16 MB", "scores"])
@pytest.mark.parametrize("how", ["pickle", "joblib", "store"])
def test_write_and_read(benchmark, tmp_path, scores, how, what):
    """The store adds locks, digests and notes."""
    value = scores if what == "scores" else np.zeros(int(what[:-3]) * sized(125_000, 1000))
    store, path = Store(tmp_path / "cache"), tmp_path / "value"
    keys = (f"{i:064x}" for i in itertools.count())

    def with_pickle():
        path.write_bytes(pickle.dumps(value, protocol=5))
        return pickle.loads(path.read_bytes())

    def with_joblib():
        joblib.dump(value, path)
        return joblib.load(path)

    def with_store():
        key = next(keys)
        store.save(key, value)
        return store.load(key)

    benchmark({"pickle": with_pickle, "joblib": with_joblib, "store": with_store}[how])


FUNCTIONS = [
    "stixel_cli.scene.path:build_scenario",
    "stixel_cli.rendering.raycast:render",
    "stixel_cli.stereo.matching:match",
    "stixel_cli.stixels.free_space:find_free_space",
    "stixel_cli.stixels.extraction:extract_stixels",
    "stixel_cli.tracking.gp_ekf:track",
    "stixel_cli.evaluation.evaluate:evaluate",
    "stixel_cli.pictures.camera:camera_pictures",
    "stixel_cli.pictures.birds_eye:track_pictures",
    "stixel_cli.pictures.over_time:error_pictures",
]


def code_of_all():
    index = CodeIndex()
    return [index.code([function.partition(":")[0]]) for function in FUNCTIONS]


@pytest.mark.benchmark(group="code of all stages")
@pytest.mark.parametrize("when", ["first", "again"])
def test_code(benchmark, when):
    """The first time in a process (goal 0.3 s), and when the files are parsed already."""

    def forget():
        if when == "first":
            source_files._digests.clear()

    started = time.perf_counter()
    codes = code_of_all()
    benchmark.extra_info["first, s"] = time.perf_counter() - started
    benchmark.extra_info["modules"] = len({name for one in codes for name in one.modules})
    benchmark.pedantic(code_of_all, setup=forget, rounds=3)
