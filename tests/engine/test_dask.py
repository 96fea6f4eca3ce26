"""A real Dask scheduler with two worker processes on loopback; the same loop, the same bytes."""

import asyncio
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import wait
from textwrap import dedent

import pytest

from stixel_cli.engine.dask_cluster import PATIENT, Cluster, local_cluster
from stixel_cli.engine.dask_pool import make_dask_pool
from stixel_cli.engine.errors import CodeChanged, ExecutorError, StageFailure
from stixel_cli.engine.execute import execute
from stixel_cli.engine.graph import build_graph
from stixel_cli.engine.keys import Stage
from stixel_cli.engine.parameters import DaskExecutor
from stixel_cli.engine.plan import probe
from stixel_cli.engine.store import Store

dask = pytest.importorskip("dask", reason="Dask is not installed")
distributed = pytest.importorskip("distributed", reason="Dask is not installed")
psutil = pytest.importorskip("psutil", reason="it comes with Dask")

FRAMES = 12

SLOW = """
    import os
    import time
    from pathlib import Path
    import numpy as np

    def slow(frames, folder, seed):
        Path(folder, f"running-{frames.start}-{os.getpid()}").touch()
        if frames.start == 5 and len(list(Path(folder).glob("running-5-*"))) == 1:
            time.sleep(60.0)  # until it is killed
        return np.random.default_rng([seed, frames.start]).normal(size=1000)

    def total(slow, frames, previous):
        return slow.sum() + (0.0 if previous is None else previous)

    def hang(frames):
        if frames.start == 2:
            time.sleep(60.0)
        return frames.start

    def kill(frames):
        if frames.start == 2:
            os.kill(os.getpid(), 9)
        return frames.start
    """


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A scheduler and two workers; their packages are found in `folder`."""
    folder = tmp_path_factory.mktemp("packages")
    package = folder / "dask_steps"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "steps.py").write_text(dedent(SLOW))
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    sys.path.insert(0, str(folder))
    (restart,) = PATIENT.values()
    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": restart}),
        local_cluster(2, env={"PYTHONPATH": path}) as cluster,
    ):
        yield cluster
    sys.path.remove(str(folder))


def graph_of(folder):
    stages = [
        Stage("slow", "dask_steps.steps:slow", "map", {}, {"folder": str(folder)}, seed=3),
        Stage("total", "dask_steps.steps:total", "fold", {"slow": "slow"}, {}),
    ]
    return build_graph(stages, FRAMES, 1)


def executor_at(cluster, time_limit=300.0):
    return DaskExecutor("dask", 2, time_limit, cluster.scheduler_address)


def single(name):
    return build_graph([Stage(name, f"dask_steps.steps:{name}", "map", {}, {})], 4, 1)


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
    execution = execute(
        graph, ["total"], project.store, executor=executor_at(cluster), progress=notes
    )
    killer.join()
    assert len(killed) == 1
    assert {record.status for record in execution.records.values()} == {"computed"}
    assert len(notes.notes) == 1 and notes.notes[0].startswith("a worker crashed")
    by_dask = project.contents(graph)
    project.store.folder = tmp_path / "other"
    execute(graph, ["total"], project.store, executor="local")
    assert by_dask == project.contents(graph) and len(by_dask) == 2 * FRAMES


def test_a_stage_over_its_time_limit(cluster, project, notes):
    graph = single("hang")
    execution = execute(
        graph,
        ["hang"],
        project.store,
        executor=executor_at(cluster, 5.0),
        progress=notes,
        keep_going=True,
    )
    ((key, failure),) = execution.failures.items()
    assert key == graph.of_stage("hang")[2].key
    assert "exceeded its time limit of 5 s" in str(failure) and "in hang" in failure.traceback_text
    assert sum(project.store.has(node.key) for node in graph.of_stage("hang")) == 3


def test_a_stage_that_always_kills_its_worker(cluster, project, notes):
    with pytest.raises(StageFailure, match=r"kill\[2:3\]: WorkerDied: .*twice"):
        execute(
            single("kill"), ["kill"], project.store, executor=executor_at(cluster), progress=notes
        )


def test_an_outcome_that_never_comes_is_computed_again(cluster, monkeypatch):
    """A worker may be killed just after it has finished a task, with the outcome."""
    pool = make_dask_pool(executor_at(cluster))
    gather, lost = pool._client.gather, []

    async def never():
        await asyncio.Event().wait()

    def lose_once(task, **options):
        patience = 300.0 if lost else 0.1
        monkeypatch.setattr("stixel_cli.engine.dask_pool.RESULT_PATIENCE", patience)
        if lost:
            return gather(task, **options)
        lost.append(task)
        return never()

    monkeypatch.setattr(pool._client, "gather", lose_once)
    try:
        assert pool.submit(divmod, 7, 2).result(timeout=300.0) == (3, 1)
        assert len(lost) == 1
    finally:
        pool.close()


def test_a_task_is_cancelled_while_it_runs(cluster):
    pool = make_dask_pool(executor_at(cluster))
    try:
        future = pool.submit(time.sleep, 60.0)
        assert future.cancel()
        assert wait([future], timeout=300.0).done == {future}
    finally:
        pool.close()


def test_a_worker_with_other_versions_is_refused(cluster, project, monkeypatch):
    monkeypatch.setattr("stixel_cli.engine.versions.installed_version", lambda name: "0.0")
    stage = Stage("hang", "dask_steps.steps:hang", "map", {}, {})
    with pytest.raises(CodeChanged, match=r"has numpy \S+, .* planned with 0\.0"):
        execute(build_graph([stage], 1, 1), ["hang"], project.store, executor=executor_at(cluster))


def test_a_scheduler_that_is_lost(project, tmp_path):
    script = tmp_path / "scheduler.py"
    script.write_text(
        dedent(
            """
            import sys, time
            from distributed import LocalCluster
            if __name__ == "__main__":
                cluster = LocalCluster(n_workers=1, threads_per_worker=1, processes=False, protocol="tcp://",
                                       host="127.0.0.1", dashboard_address="127.0.0.1:0")
                print(cluster.scheduler_address, flush=True)
                time.sleep(60.0)
            """
        )
    )
    (tmp_path / "lost_steps.py").write_text(
        "import time\n\ndef wait(frames, folder):\n"
        "    open(folder + '/running', 'w').close()\n    time.sleep(60.0)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    process = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment
    )
    address = process.stdout.readline().strip()

    def kill():
        deadline = time.monotonic() + 300.0
        while not (tmp_path / "running").exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        process.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    stage = Stage("wait", "lost_steps:wait", "map", {}, {"folder": str(tmp_path)})
    try:
        with pytest.raises(ExecutorError, match=f"the Dask scheduler at {address} was lost"):
            executor = DaskExecutor("dask", 1, None, address)
            execute(build_graph([stage], 2, 1), ["wait"], project.store, executor=executor)
    finally:
        killer.join()
        process.communicate(timeout=600)


def test_no_scheduler_there(project, monkeypatch):
    monkeypatch.setattr("stixel_cli.engine.dask_pool.PATIENCE", 0.5)
    executor = DaskExecutor("dask", 2, None, "tcp://127.0.0.1:9")
    with pytest.raises(ExecutorError, match=r"no Dask scheduler at tcp://127.0.0.1:9 \("):
        execute(project.graph(), ["numbers"], project.store, executor=executor)


def test_dask_is_not_installed(project, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ExecutorError, match=r"requires Dask: pip install 'stixel\[dask\]'"):
        execute(project.graph(), ["numbers"], project.store, executor="dask")


OWN = """
    import os
    import signal
    import sys
    import threading
    from stixel_cli.engine.execute import execute
    from stixel_cli.engine.graph import build_graph
    from stixel_cli.engine.parameters import DaskExecutor
    from stixel_cli.engine.keys import Stage
    from stixel_cli.engine.store import Store
    from stixel_cli.engine.progress import Progress

    sys.path.insert(0, {folder!r})
    os.environ["PYTHONPATH"] = {folder!r}
    signal.signal(signal.SIGINT, signal.default_int_handler)

    if __name__ == "__main__":
        stage = Stage("hang", "own_steps:hang", "map", {{}}, {{"folder": {folder!r}}})
        try:
            execute(build_graph([stage], 2, 1), ["hang"], Store({cache!r}),
                    executor=DaskExecutor("dask", 2, 60.0, None))
        except KeyboardInterrupt:
            print("interrupted", flush=True)
    """


def test_ctrl_c_ends_a_cluster_of_its_own(tmp_path):
    (tmp_path / "own_steps.py").write_text(
        dedent(
            """
            import os, time
            def hang(folder, frames):
                open(os.path.join(folder, f"running-{os.getpid()}"), "w").close()
                time.sleep(60.0)
                open(os.path.join(folder, f"slept-{os.getpid()}"), "w").close()
            """
        )
    )
    script = dedent(OWN).format(folder=str(tmp_path), cache=str(tmp_path / "cache"))
    (tmp_path / "own.py").write_text(script)
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "own.py")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 300.0
    while len(list(tmp_path.glob("running-*"))) < 2:
        assert time.monotonic() < deadline and process.poll() is None, process.communicate()
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    assert process.stdout.readline() == "interrupted\n"
    _, errors = process.communicate(timeout=600)
    assert errors == ""
    assert not list(tmp_path.glob("slept-*"))
    for path in tmp_path.glob("running-*"):
        assert not runs(int(path.name.partition("-")[2]))


def runs(pid):
    """Whether a process exists and is not a zombie."""
    try:
        os.kill(pid, 0)
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except (ProcessLookupError, psutil.NoSuchProcess):
        return False


def test_ctrl_c_while_a_cluster_of_its_own_starts(project, monkeypatch):
    made = []

    class Slow(Cluster):
        def address(self):
            made.append(self)
            raise KeyboardInterrupt

    monkeypatch.setattr("stixel_cli.engine.dask_pool.Cluster", Slow)
    with pytest.raises(KeyboardInterrupt):
        execute(project.graph(), ["numbers"], project.store, executor="dask")
    (cluster,) = made
    # It was importing Dask, and had not sent its address yet.
    assert cluster._process.returncode == -signal.SIGKILL
    assert not os.path.exists(cluster._folder)


def test_a_crashed_worker_of_an_own_cluster_may_restart_slowly(project, tmp_path, monkeypatch):
    """Dask gives up a worker after `lost-worker-timeout`, and the run would wait forever."""
    monkeypatch.setenv("DASK_DISTRIBUTED__DEPLOY__LOST_WORKER_TIMEOUT", "0s")
    (tmp_path / "crash_steps.py").write_text(
        "import os\nfrom pathlib import Path\n\n"
        "def crash(folder):\n"
        "    mark = Path(folder, 'crashed')\n"
        "    if not mark.exists():\n"
        "        mark.touch()\n"
        "        os.kill(os.getpid(), 9)\n"
        "    return 1\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    stage = Stage("crash", "crash_steps:crash", "once", {}, {"folder": str(tmp_path)})
    graph = build_graph([stage], 1, 1)
    executor = DaskExecutor("dask", 1, None, None)
    execution = execute(graph, ["crash"], project.store, executor=executor)
    assert [record.status for record in execution.records.values()] == ["computed"]


def test_a_cluster_ends_with_the_process_that_started_it():
    script = """
        import os, signal
        from stixel_cli.engine.dask_cluster import PATIENT, Cluster
        if __name__ == "__main__":
            cluster = Cluster(1)
            print(cluster._process.pid, cluster.address(), flush=True)
            os.kill(os.getpid(), signal.SIGKILL)
        """
    done = subprocess.run(
        [sys.executable, "-c", dedent(script)], capture_output=True, text=True, timeout=600
    )
    pid, address = done.stdout.split()
    assert address.startswith("tcp://127.0.0.1:")
    deadline = time.monotonic() + 300.0
    while runs(int(pid)):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_cluster_that_cannot_be_started(project, monkeypatch, tmp_path):
    (tmp_path / "distributed.py").write_text("raise ImportError('broken')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(ExecutorError, match=r"no Dask scheduler on this machine \(.*broken"):
        execute(project.graph(), ["numbers"], project.store, executor="dask")


@pytest.fixture
def scheduler():
    """The address of a scheduler without workers."""
    with distributed.LocalCluster(
        n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0", protocol="tcp://"
    ) as cluster:
        yield cluster.scheduler_address


def test_a_scheduler_without_workers(scheduler, project, notes, monkeypatch):
    monkeypatch.setattr("stixel_cli.engine.dask_pool.COUNT_INTERVAL", 0.2)
    monkeypatch.setattr("stixel_cli.engine.dask_pool.LONG_PATIENCE", 0.6)
    executor = DaskExecutor("dask", 2, None, scheduler)
    with pytest.raises(ExecutorError, match=f"^no worker at the Dask scheduler {scheduler} for "):
        execute(project.graph(), ["numbers"], project.store, executor=executor, progress=notes)
    assert [note.partition(",")[0] for note in notes.notes] == [
        f"waiting for workers at {scheduler}"
    ]


def test_the_probe(scheduler, tmp_path, monkeypatch):
    monkeypatch.setattr("stixel_cli.engine.dask_pool.PATIENCE", 0.5)
    store, nobody = Store(tmp_path / "cache"), DaskExecutor("dask", 2, None, "tcp://127.0.0.1:9")
    probe(3, store, DaskExecutor("dask", 2, None, scheduler))
    probe(0, store, nobody)
    with pytest.raises(ExecutorError, match=r"no Dask scheduler at tcp://127\.0\.0\.1:9"):
        probe(3, store, nobody)
