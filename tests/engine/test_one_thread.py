"""One thread per stage, whatever the other threads of the process do."""

import importlib
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from types import SimpleNamespace

import pytest
from threadpoolctl import ThreadpoolController, threadpool_info, threadpool_limits

from stixel_cli.engine.errors import ExecutorError
from stixel_cli.engine.limits import ENVIRONMENT, one_thread
from stixel_cli.engine.store import Store

THREADS = """
def threads():
    from threadpoolctl import threadpool_info
    return max(library["num_threads"] for library in threadpool_info())
"""

SLOW_IMPORT = """
from gate import begun, go
begun.set()
assert go.wait(600.0)
threads = 4
def getNumThreads(): return threads
def setNumThreads(number):
    global threads
    threads = number
"""


@pytest.fixture
def gate(tmp_path, monkeypatch):
    """A stand-in for OpenCV that stays half imported from `begun` until `go`."""
    gate = SimpleNamespace(begun=Event(), go=Event())
    (tmp_path / "cv2.py").write_text(SLOW_IMPORT)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "cv2", raising=False)
    monkeypatch.setitem(sys.modules, "gate", gate)
    yield gate
    sys.modules.pop("cv2", None)


def test_opencv_that_another_thread_imports_just_now_is_waited_for(gate):
    def threads_inside():
        with one_thread():
            return sys.modules["cv2"].getNumThreads()

    with ThreadPoolExecutor(2) as pool:
        imported = pool.submit(importlib.import_module, "cv2")
        assert gate.begun.wait(600.0)
        inside = pool.submit(threads_inside)
        try:
            # It fails at once, or waits: then nothing but the import's end lets it go on.
            with pytest.raises(TimeoutError):
                inside.result(timeout=0.2)
        finally:
            gate.go.set()
        assert inside.result(timeout=600.0) == 1
        assert imported.result(timeout=600.0).getNumThreads() == 4


def in_a_thread(call):
    """The result of `call()` in a thread that ends."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(call).result(timeout=600.0)


def threads():
    return max(library["num_threads"] for library in threadpool_info())


def threads_inside():
    with one_thread():
        return threads()


@pytest.fixture
def two_threads(monkeypatch):
    """Libraries that were loaded with two threads, as on a machine of two cores."""
    for name in ENVIRONMENT:
        monkeypatch.delenv(name, raising=False)
    controller = ThreadpoolController()
    limits = in_a_thread(lambda: controller.limit(limits=2))
    yield
    in_a_thread(limits.restore_original_limits)


def test_every_thread_gets_the_limit_and_it_ends_with_the_last(two_threads):
    assert threads_inside() == 1
    assert in_a_thread(threads_inside) == 1
    inside, go = Event(), Event()

    def stay():
        with one_thread():
            inside.set()
            assert go.wait(600.0)
            return threads()

    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(stay)
        assert inside.wait(600.0)
        with one_thread():
            go.set()
            assert first.result(timeout=600.0) == 1
            # The one that set it has left.
            assert threads() == 1
    assert threads() == 2
    assert not any(name in os.environ for name in ENVIRONMENT)


def test_twenty_runs_on_threads_give_the_same_bytes(project, two_threads):
    """Load on the machine decides which thread runs which chunk."""
    project.edit("double", "from . import log", "import numpy as np\n\nfrom . import log")
    noise = "np.random.default_rng(frames.start).normal(size=(300, 300))"
    old = "values = numbers[frames.start:frames.stop]"
    project.edit("double", old, f"a = {noise}; values = (a @ a)[: len(frames), 0]")
    project.edit("double", "return Chunk(frames.start,", "return Chunk(threads(),")
    path = project.package / "double.py"
    path.write_text(path.read_text() + THREADS)
    # This thread lives on, and was the first to set a limit.
    assert threads_inside() == 1
    graph = project.graph()
    found = set()
    for run in range(20):
        project.store = Store(project.folder / f"cache{run}")
        project.run(graph, targets=["double"], executor="threads")
        chunks = [project.store.load(node.key) for node in graph.of_stage("double")]
        assert [chunk.first for chunk in chunks] == [1] * 3
        found.add(b"".join(chunk.values.tobytes() for chunk in chunks))
    assert len(found) == 1


def test_limits_of_the_caller_do_not_matter_and_one_of_another_thread_is_an_error(
    project, two_threads
):
    with threadpool_limits(2):
        project.run(executor="threads")
    with threadpool_limits(2, user_api="blas"):
        with pytest.raises(ExecutorError, match=r"openblas.*: uses 2 threads"):
            in_a_thread(threads_inside)
        # This thread may change its own.
        assert threads_inside() == 1
    assert in_a_thread(threads_inside) == 1


def test_the_command_line_has_one_thread_before_numpy_is_imported():
    code = "import json, os, sys; from stixel_cli.cli.app import main; "
    code += "sys.argv = ['stixel', '--version']; main(); assert 'numpy' not in sys.modules; "
    code += "print(json.dumps(dict(os.environ)))"
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "4"}
    said = subprocess.check_output([sys.executable, "-c", code], env=environment, text=True)
    found = json.loads(said.splitlines()[-1])
    assert found.items() >= ENVIRONMENT.items()
