"""A read-only cache: one clear message, and what it holds serves."""

import os
import subprocess
import sys

import pytest

from stixel_cli.engine.entries import collect
from stixel_cli.engine.errors import CacheError


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
    mount("size=4m")
    yield folder, lambda option: mount("remount", option)
    subprocess.run(["umount", "-l", str(folder)], check=True)


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
