"""A full disk, a read-only cache: one clear message, no half result, nothing lost."""

import os
import signal
import subprocess
import sys

import pytest

from stixel_cli.engine.entries import collect, entries
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.parameters import LocalExecutor
from stixel_cli.engine.store import VALUE, Store


def _status(execution):
    (record,) = (one for one in execution.stage_records() if one["name"] == "gather")
    return record["status"]


@pytest.fixture
def disk(tmp_path):
    """A small file system of its own, and a way to change how it is mounted."""
    folder = tmp_path / "disk"
    folder.mkdir()

    def mount(*options):
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", ",".join(options), "tmpfs", str(folder)],
            capture_output=True,
            text=True,
        )
        if done.returncode:
            pytest.skip(f"no file system can be mounted here: {done.stderr.strip()}")

    if not sys.platform.startswith("linux") or os.geteuid() != 0:
        pytest.skip("mounting a small file system takes root on Linux")
    mount("size=400k")
    yield folder, lambda option: mount("remount", option)
    subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.mark.parametrize(
    "executor", ["serial", LocalExecutor("local", 2, 60.0)], ids=["serial", "local"]
)
def test_a_full_disk(project, disk, executor):
    folder, _ = disk
    project.store.folder = folder / "cache"
    project.edit("numbers", "np.arange(count, dtype=np.float64)", "np.arange(200_000.0)")
    with pytest.raises(CacheError, match=r"^cannot write in the cache .*: No space left on device"):
        project.run(executor=executor, keep_going=True)
    assert entries(project.store) == []
    assert list((project.store.folder / "tmp").glob("*/*")) == []
    # With a smaller result all goes on, from what is there.
    project.edit("numbers", "np.arange(200_000.0)", "np.arange(count, dtype=np.float64)")
    project.run(executor=executor)
    assert len(entries(project.store, values=True)) == 12


def test_a_read_only_cache(project, disk):
    folder, remount = disk
    project.store.folder = folder / "cache"
    graph = project.graph()
    project.run(graph)
    project.calls()
    remount("ro")
    assert _status(project.run(graph)) == "cached"
    assert project.store.load(graph.of_stage("show")[0].key)[0] == 0
    for executor in ("local", "threads"):
        # Nothing is to be done, so that nobody is called to do it.
        assert _status(project.run(graph, executor=executor)) == "cached"
    wrong = r"^cannot write in the cache .*: Read-only file system; it lacks 1 of the results "
    with pytest.raises(CacheError, match=wrong):
        project.run(project.graph(seed=2))
    assert project.calls() == [], "said before anything runs"
    with pytest.raises(CacheError, match="Read-only file system"):
        collect(project.store, max_size=0)
    assert collect(project.store, max_size=0, dry_run=True).removed == 12
    remount("rw")
    project.run(project.graph(seed=2))
    assert project.calls() == ["gather"]


STORING = """
import sys
from stixel_cli.engine.store import Store

class Slow:
    def __reduce__(self):
        # Half of the entry is written by now.
        print("storing", flush=True)
        sys.stdin.read()
        return (int, ())

store, key = Store(sys.argv[1]), sys.argv[2]
with store.lock(key):
    store.save(key, [b"x" * 100_000, Slow()], stage="any")
"""


def test_kill_9_in_a_store(tmp_path):
    store, key = Store(tmp_path / "cache"), "ab" * 32
    process = subprocess.Popen(
        [sys.executable, "-c", STORING, str(store.folder), key],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "storing\n"
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=600)
    assert not store.has(key) and len(list((store.folder / "tmp").iterdir())) == 1
    # A lock that outlived its holder would be waited for without end.
    with store.lock(key):
        store.save(key, 1)
    assert store.load(key) == 1
    (left,) = (store.folder / "tmp").iterdir()
    os.utime(left, (0, 0))
    collect(store)
    assert list((store.folder / "tmp").iterdir()) == []
    assert (store.entry(key) / VALUE).exists()
