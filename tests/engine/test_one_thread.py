"""One thread a stage, whatever the other threads of the process are at."""

import importlib
import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from types import SimpleNamespace

import pytest

from stixel_cli.engine.one_thread import one_thread

SLOW_IMPORT = """
from gate import begun, go
begun.set()
assert go.wait(20.0)
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
        assert gate.begun.wait(20.0)
        inside = pool.submit(threads_inside)
        try:
            # It fails at once, or waits: then nothing but the import's end lets it go on.
            with pytest.raises(TimeoutError):
                inside.result(timeout=0.2)
        finally:
            gate.go.set()
        assert inside.result(timeout=20.0) == 1
        assert imported.result(timeout=20.0).getNumThreads() == 4
