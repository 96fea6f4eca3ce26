"""Clusters of Dask that the command starts itself."""

import os
import signal
import subprocess
import sys
import time
from textwrap import dedent

import pytest
from executors import EXECUTORS

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


def test_a_client_that_cannot_connect_leaves_no_workers(project, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("stixel_cli.engine.dask_pool.connected", interrupted)
    before = set(psutil.Process().children(recursive=True))
    with pytest.raises(KeyboardInterrupt):
        execute(project.graph(), ["numbers"], project.store, executor=EXECUTORS["dask"])
    workers = set(psutil.Process().children(recursive=True)) - before
    assert not any("distributed" in " ".join(process.cmdline()) for process in workers)


def test_a_crashed_worker_of_an_own_cluster_may_restart_slowly(project, tmp_path, monkeypatch):
    """Dask gives up a worker after `lost-worker-timeout`, and the run would wait forever."""
    dask = pytest.importorskip("dask")
    monkeypatch.setitem(dask.config.get("distributed.deploy"), "lost-worker-timeout", "0s")
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


def test_a_cluster_ends_with_the_process_that_started_it(tmp_path):
    script = """
        import os, signal
        from stixel_cli.engine.dask_pool import local_cluster
        if __name__ == "__main__":
            with local_cluster(1) as address:
                import psutil
                print(*(process.pid for process in psutil.Process().children(True)), flush=True)
                os.kill(os.getpid(), signal.SIGKILL)
        """
    (tmp_path / "killed.py").write_text(dedent(script))
    done = subprocess.run(
        [sys.executable, str(tmp_path / "killed.py")], capture_output=True, text=True, timeout=600
    )
    workers = list(map(int, done.stdout.split()))
    assert workers, done.stderr
    deadline = time.monotonic() + 300.0
    while any(map(runs, workers)):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_cluster_that_cannot_be_started(project, monkeypatch):
    import distributed

    def broken(**_):
        raise RuntimeError("broken")

    monkeypatch.setattr(distributed, "LocalCluster", broken)
    with pytest.raises(ExecutorError, match=r"no Dask scheduler on this machine \(.*broken"):
        execute(project.graph(), ["numbers"], project.store, executor=EXECUTORS["dask"])
