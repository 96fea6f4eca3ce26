"""Clusters of Dask that the command starts itself."""

import os
import signal
import subprocess
import sys
import time
from textwrap import dedent

import pytest
from executors import EXECUTORS

from stixel_cli.engine.dask_cluster import Cluster
from stixel_cli.engine.errors import ExecutorError
from stixel_cli.engine.execute import execute
from stixel_cli.engine.graph import build_graph
from stixel_cli.engine.keys import Stage
from stixel_cli.engine.parameters import DaskExecutor

pytest.importorskip("dask", reason="Dask is not installed")
pytest.importorskip("distributed", reason="Dask is not installed")
psutil = pytest.importorskip("psutil", reason="it comes with Dask")

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
                time.sleep(600.0)
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
        execute(project.graph(), ["numbers"], project.store, executor=EXECUTORS["dask"])
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
    assert [*execution.status.values()] == ["computed"]


def test_a_cluster_ends_with_the_process_that_started_it():
    script = """
        import os, signal
        from stixel_cli.engine.dask_cluster import Cluster
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
        execute(project.graph(), ["numbers"], project.store, executor=EXECUTORS["dask"])
