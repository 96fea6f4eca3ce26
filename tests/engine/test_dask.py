"""A real Dask scheduler with two worker processes on loopback; the same loop, the same bytes."""

import logging
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import CancelledError, wait
from contextlib import closing
from textwrap import dedent

import pytest
from executors import EXECUTORS

from stixel_cli.engine.dask_pool import DaskPool
from stixel_cli.engine.errors import CodeChanged, ExecutorError, StageFailure, WorkerDied
from stixel_cli.engine.execute import execute
from stixel_cli.engine.graph import GraphBuilder
from stixel_cli.engine.keys import Stage
from stixel_cli.engine.limits import ENVIRONMENT
from stixel_cli.engine.parameters import PROGRAM, DaskExecutor
from stixel_cli.engine.plan import probe
from stixel_cli.engine.store import Store

dask = pytest.importorskip("dask", reason="Dask is not installed")
distributed = pytest.importorskip("distributed", reason="Dask is not installed")
psutil = pytest.importorskip("psutil", reason="it comes with Dask")

FRAMES = 12
LOOPBACK = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}

SLOW = """
    import os
    import time
    from pathlib import Path
    import numpy as np

    def slow(frames, folder, seed):
        Path(folder, f"running-{frames.start}-{os.getpid()}").touch()
        if frames.start == 5 and len(list(Path(folder).glob("running-5-*"))) == 1:
            time.sleep(600.0)  # until it is killed
        return np.random.default_rng([seed, frames.start]).normal(size=1000)

    def wait_for(file):
        while not Path(file).exists():
            time.sleep(0.01)

    class Unreadable:
        def __reduce__(self):
            return divmod, (1, 0)

    def unreadable():
        return Unreadable()

    def total(slow, frames, previous):
        return slow.sum() + (0.0 if previous is None else previous)

    def hang(frames):
        if frames.start == 2:
            time.sleep(600.0)
        return frames.start

    def kill(frames):
        if frames.start == 2:
            os.kill(os.getpid(), 9)
        return frames.start
    """


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """The address of a scheduler and two workers; their packages are found in `folder`."""
    folder = tmp_path_factory.mktemp("packages")
    package = folder / "dask_steps"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "steps.py").write_text(dedent(SLOW))
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", path)
        patch.syspath_prepend(folder)
        options = {"threads_per_worker": 1, "memory_limit": 0, "silence_logs": logging.CRITICAL}
        options |= {"scheduler_kwargs": {"allowed_failures": 0}, "env": ENVIRONMENT}
        with distributed.LocalCluster(n_workers=2, **LOOPBACK, **options) as started:
            yield started.scheduler_address


def graph_of(folder):
    slow = Stage("slow", "dask_steps.steps:slow", "map", {}, {"folder": str(folder)}, seed=3)
    total = Stage("total", "dask_steps.steps:total", "fold", {"slow": "slow"}, {})
    return GraphBuilder().build([slow, total], FRAMES, 1)


def executor_at(cluster, time_limit=300.0):
    return DaskExecutor("dask", 2, time_limit, cluster)


def executed(project, cluster, graph, name, time_limit=300.0, **options):
    """The execution of one stage by the cluster's workers."""
    executor = executor_at(cluster, time_limit)
    return execute(graph, [name], project.store, executor=executor, **options)


def single(name):
    return GraphBuilder().build([Stage(name, f"dask_steps.steps:{name}", "map", {}, {})], 4, 1)


def test_a_worker_is_killed_in_the_midst_and_the_bytes_are_those_of_local(
    cluster, project, notes, tmp_path
):
    graph = graph_of(tmp_path)
    killed = []

    def kill_one():
        deadline = time.monotonic() + 300.0
        while time.monotonic() < deadline and not killed:
            stuck = list(tmp_path.glob("running-5-*"))
            # One more may wait behind it. What its worker did before has been taken in by then.
            if stuck and len(list(tmp_path.glob("running-*"))) >= FRAMES - 1:
                killed.append(int(stuck[0].name.split("-")[-1]))
                os.kill(killed[0], signal.SIGKILL)
            time.sleep(0.005)

    killer = threading.Thread(target=kill_one)
    killer.start()
    execution = executed(project, cluster, graph, "total", progress=notes)
    killer.join()
    assert len(killed) == 1
    assert {*execution.status.values()} == {"computed"}
    # One for each node that the worker had, the one that waits behind the killed one included.
    assert notes.notes and all(note.startswith("a worker crashed") for note in notes.notes)
    assert any("slow[5:6]" in note for note in notes.notes) and len(notes.notes) <= 2
    by_dask = project.contents(graph)
    project.store.folder = tmp_path / "other"
    execute(graph, ["total"], project.store, executor=EXECUTORS["local"])
    assert by_dask == project.contents(graph) and len(by_dask) == 2 * FRAMES


def test_a_stage_over_its_time_limit(cluster, project, notes):
    graph = single("hang")
    execution = executed(project, cluster, graph, "hang", 3.0, progress=notes, keep_going=True)
    ((key, failure),) = execution.failures.items()
    assert key == graph.of_stage("hang")[2].key
    assert "exceeded its time limit of 3 s" in str(failure) and "in hang" in failure.traceback_text
    assert sum(project.store.has(node.key) for node in graph.of_stage("hang")) == 3


def test_a_stage_that_always_kills_its_worker(cluster, project, notes):
    with pytest.raises(StageFailure, match=r"kill\[2:3\]: WorkerDied: .*twice"):
        executed(project, cluster, single("kill"), "kill", progress=notes)


def test_an_outcome_that_never_comes_counts_as_a_crash(cluster):
    """Dask's message that a task is finished came, but not the one with its outcome."""
    lost = []
    with closing(DaskPool(executor_at(cluster))) as pool:
        pool._client.subscribe_topic(PROGRAM, lost.append)
        with pytest.raises(WorkerDied, match="no outcome") as raised:
            outcome_of(pool, pool.submit(divmod, 7, 2))
        assert pool.died(raised.value)
        # Now it is of no task any more. Tasks of the tests before may send theirs, too.
        for event in lost:
            pool._receive(event)
        pool._client.subscribe_topic(PROGRAM, pool._receive)
        assert outcome_of(pool, pool.submit(divmod, 7, 2)) == (3, 1)


def outcome_of(pool, future):
    """Wait as the scheduler does."""
    deadline = time.monotonic() + 300.0
    while not wait([future], timeout=0.01).done and time.monotonic() < deadline:
        pool.tend(print)
    return future.result(timeout=0.0)


def test_an_outcome_that_cannot_be_decoded_here_is_an_error(cluster):
    from dask_steps.steps import unreadable

    with closing(DaskPool(executor_at(cluster))) as pool:
        with pytest.raises(ZeroDivisionError):
            outcome_of(pool, pool.submit(unreadable))
        with pytest.raises(TypeError):
            outcome_of(pool, pool.submit(divmod, 7))


def test_a_task_is_cancelled_while_it_runs(cluster, tmp_path):
    from dask_steps.steps import wait_for

    pool = DaskPool(executor_at(cluster))
    try:
        future = pool.submit(wait_for, str(tmp_path / "go"))
        assert future.cancel()
        with pytest.raises(CancelledError):
            outcome_of(pool, future)
    finally:
        # Its worker is busy with it until then.
        (tmp_path / "go").touch()
        pool.close()


def test_a_worker_with_other_versions_is_refused(cluster, project, monkeypatch):
    monkeypatch.setattr("stixel_cli.engine.versions.installed_version", lambda name: "0.0")
    stage = Stage("hang", "dask_steps.steps:hang", "map", {}, {})
    with pytest.raises(CodeChanged, match=r"has numpy \S+, .* planned with 0\.0"):
        executed(project, cluster, GraphBuilder().build([stage], 1, 1), "hang")


SCHEDULER = """
    import time
    from distributed import LocalCluster
    cluster = LocalCluster(n_workers=1, threads_per_worker=1, processes=False, protocol="tcp://",
                           host="127.0.0.1", dashboard_address="127.0.0.1:0")
    print(cluster.scheduler_address, flush=True)
    time.sleep(600.0)
    """


def test_a_scheduler_that_is_lost(cluster, project, tmp_path):
    """The one of another process, whose worker hangs; `cluster` has the packages' path."""
    command = [sys.executable, "-c", dedent(SCHEDULER)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    address = process.stdout.readline().strip()

    def kill():
        deadline = time.monotonic() + 300.0
        while not list(tmp_path.glob("running-5-*")) and time.monotonic() < deadline:
            time.sleep(0.02)
        process.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        with pytest.raises(ExecutorError, match=f"the Dask scheduler at {address} is gone"):
            executed(project, address, graph_of(tmp_path), "slow", None)
    finally:
        killer.join()
        process.communicate(timeout=600)


def test_without_an_address_or_dask_it_is_refused(project, monkeypatch):
    with pytest.raises(ExecutorError, match=r"executor\.address: is required"):
        executed(project, None, project.graph(), "numbers")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ExecutorError, match=r"requires Dask: pip install 'stixel\[dask\]'"):
        executed(project, "tcp://a:1", project.graph(), "numbers")


def test_a_scheduler_without_workers(project, notes, monkeypatch):
    monkeypatch.setattr("stixel_cli.engine.dask_pool.COUNT_INTERVAL", 0.2)

    def end_patience(text):
        notes.notes.append(text)
        monkeypatch.setattr("stixel_cli.engine.dask_pool.LONG_PATIENCE", 0.0)

    notes.note = end_patience
    with distributed.LocalCluster(n_workers=0, protocol="tcp://", **LOOPBACK) as nobody:
        scheduler = nobody.scheduler_address
        with pytest.raises(ExecutorError, match=f"^no worker at the Dask scheduler {scheduler} "):
            executed(project, scheduler, project.graph(), "numbers", progress=notes)
    (note,) = notes.notes
    assert note.startswith(f"waiting for workers at {scheduler},")


def test_the_probe(cluster, tmp_path, monkeypatch):
    store, nobody = Store(tmp_path / "cache"), DaskExecutor("dask", 2, None, "tcp://127.0.0.1:9")
    probe(3, store, executor_at(cluster))
    monkeypatch.setattr("stixel_cli.engine.dask_pool.PATIENCE", 0.5)
    probe(0, store, nobody)
    with pytest.raises(ExecutorError, match=r"no Dask scheduler at tcp://127\.0\.0\.1:9"):
        probe(3, store, nobody)
