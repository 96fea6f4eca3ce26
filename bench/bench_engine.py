"""What the engine costs beside the work: a node (goal 5 ms), a plan, the hash of the code.

pytest bench/bench_engine.py
"""

import itertools
import sys
import time

import pytest

from stixel_cli.engine import code_hash, source
from stixel_cli.engine.code_hash import CodeIndex
from stixel_cli.engine.execute import execute
from stixel_cli.engine.graph import build_graph
from stixel_cli.engine.plan import plan
from stixel_cli.engine.stage import Stage
from stixel_cli.engine.store import Store

NODES = 200
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
        Stage("make", "bench_stages:make", "map", {}, {}, packages=("numpy",), seed=1),
        Stage("add", "bench_stages:add", "fold", {"made": "make"}, {}),
    ]
    return build_graph(stages, NODES // 2, 1)


def plain(graph):
    """The same work without an engine: the functions called in order."""
    import bench_stages

    previous = None
    for k in range(NODES // 2):
        previous = bench_stages.add(bench_stages.make(range(k, k + 1), 1), None, previous)


@pytest.mark.benchmark(group="200 empty nodes")
def test_plain_calls(benchmark, graph):
    benchmark(plain, graph)


@pytest.mark.benchmark(group="200 empty nodes")
@pytest.mark.parametrize("executor", ["serial", "threads", "local"])
def test_overhead_of_a_node(benchmark, graph, tmp_path, executor):
    """The time includes the start of the workers; milliseconds a node are in the extra info."""
    folders = (Store(tmp_path / f"cache-{i}") for i in itertools.count())
    # Unknown durations, so that `local` starts its workers.
    benchmark.pedantic(
        lambda store: execute(graph, ["add"], store, executor=executor),
        setup=lambda: ((next(folders),), {}),
        rounds=3,
    )
    benchmark.extra_info["ms a node"] = 1e3 * benchmark.stats.stats.median / NODES


@pytest.mark.benchmark(group="200 cached nodes")
def test_plan_of_cached_nodes(benchmark, graph, tmp_path):
    store = Store(tmp_path / "cache")
    execute(graph, ["add"], store, executor="serial")
    planned = benchmark(plan, graph, ["add"], store)
    assert not planned.missing


@pytest.mark.benchmark(group="store of 16 MB")
@pytest.mark.parametrize("what", ["plain", "store"])
def test_load(benchmark, tmp_path, what):
    import joblib
    import numpy as np

    store, key = Store(tmp_path / "cache"), "0" * 64
    store.save(key, np.zeros(2_000_000))
    path = store.entry(key) / "value.joblib"
    benchmark(store.load, key) if what == "store" else benchmark(joblib.load, path)


FUNCTIONS = [
    "stixel_cli.scene.build:build_scenario",
    "stixel_cli.scene.raycast:render",
    "stixel_cli.stereo.sgm:match",
    "stixel_cli.stixels.free_space:find_free_space",
    "stixel_cli.stixels.extraction:extract_stixels",
    "stixel_cli.tracking.gp_ekf:track",
    "stixel_cli.evaluation.evaluate:evaluate",
    "stixel_cli.report.camera:camera_pictures",
    "stixel_cli.report.birds_eye:track_pictures",
    "stixel_cli.report.over_time:run_pictures",
]


def hash_all():
    index = CodeIndex()
    return [index.hash(function) for function in FUNCTIONS]


@pytest.mark.benchmark(group="code of all stages")
@pytest.mark.parametrize("when", ["first", "again"])
def test_code_hash(benchmark, when):
    """The first time in a process (goal 0.3 s), and when the files are parsed already."""

    def forget():
        if when == "first":
            source._parsed.clear()
            code_hash._definitions.clear()

    started = time.perf_counter()
    hashes = hash_all()
    benchmark.extra_info["first, s"] = time.perf_counter() - started
    benchmark.extra_info["parts"] = len({part for code in hashes for part in code.parts})
    benchmark.pedantic(hash_all, setup=forget, rounds=3)
