"""Only a cache is used as one, a read-only one too; only what the store made is removed."""

import os
import subprocess
import sys
import time

import pytest

from stixel_cli.cli.app import main
from stixel_cli.engine import cache_folder
from stixel_cli.engine.cache_folder import MARK, is_marked, make_folder
from stixel_cli.engine.entries import collect, keep_limit
from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.parameters import CacheParameters
from stixel_cli.engine.plan import DURATIONS, Durations
from stixel_cli.engine.store import VALUE, Store, open_store

KEY = "ab" + "0" * 62
SMALL = ("measurement=fabricated", "tracker=point", "path.duration=0.5", "pictures.frames=[]")


def put(file, age=0.0):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("the user's")
    os.utime(file, (time.time() - age, time.time() - age))
    return file


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A user's folder with names as a cache has them, as the cache."""
    folder = tmp_path / "home"
    files = [put(folder / name / "old", 1e6) for name in ("tmp", "sources", "locks", "ab")]
    monkeypatch.setenv("STIXEL_CACHE", str(folder))
    return files


@pytest.mark.parametrize(
    "words", [("cache", "gc"), ("cache", "clear", "--yes"), ("cache", "ls"), ("run", *SMALL)]
)
def test_a_folder_with_other_files_is_refused_and_left_alone(home, words, capsys, monkeypatch):
    monkeypatch.chdir(home[0].parents[2])
    before = sorted(home[0].parents[1].rglob("*"))
    assert main([*words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "not make" in said and "STIXEL_CACHE" in said
    assert sorted(home[0].parents[1].rglob("*")) == before


def test_whoever_creates_the_cache_marks_it(tmp_path):
    store = Store(tmp_path / "new" / "cache")
    store.save(KEY, 1)
    assert is_marked(store.folder)
    first, second = (store.folder / MARK).read_text().splitlines()
    assert first == "Signature: 8a477f597d28d172789f06886806bc55" and second == "stixel cache"
    # The mark of another program is none.
    (store.folder / MARK).write_text(f"{first}\nanother program\n")
    assert not is_marked(store.folder)
    with pytest.raises(CacheError, match=MARK):
        open_store(CacheParameters(str(store.folder), None))


def test_a_cache_that_another_process_marks_at_the_same_time(tmp_path, monkeypatch):
    listed = cache_folder.inside

    def marked_meanwhile(folder):
        monkeypatch.setattr(cache_folder, "inside", listed)
        make_folder(tmp_path, "locks")
        return listed(folder)

    monkeypatch.setattr(cache_folder, "inside", marked_meanwhile)
    assert make_folder(tmp_path, "tmp").is_dir()


def test_files_of_others_in_a_cache_stay(tmp_path):
    store = Store(tmp_path / "cache", max_size=0)
    store.save(KEY, 1)
    others = [
        put(store.folder / name, 1e8)
        for name in ("mine", "tmp/old", "sources/mine.py", "locks/mine.lock")
    ]
    (store.folder / "no").mkdir()
    keep_limit(store)
    collect(store, 0, 0.0)
    done = collect(store, 0)
    assert not store.has(KEY) and done.kept == 0
    assert all(file.exists() for file in others) and (store.folder / "no").is_dir()


def nested(file):
    file.write_text("[" * 100_000)


@pytest.mark.parametrize("damage", [os.mkfifo, nested, os.mkdir])
def test_damaged_durations_are_ignored(tmp_path, damage):
    damage(tmp_path / DURATIONS)
    assert Durations(tmp_path).by_stage([]) == {}


@pytest.mark.parametrize("seconds", ["1e999", "NaN", "-1", "1e300"])
def test_durations_that_no_node_takes_are_ignored(project, seconds):
    project.run()
    nodes = list(project.graph().nodes.values())
    assert Durations(project.store.folder).estimate(nodes)[1] == []
    wrong = ",".join(f'"{node.stage.function}": {seconds}' for node in nodes)
    (project.store.folder / DURATIONS).write_text(f"{{{wrong}}}")
    assert Durations(project.store.folder).by_stage(nodes) == {}


def test_a_value_that_has_grown_is_not_read(tmp_path):
    store = Store(tmp_path)
    store.save(KEY, 1)
    with (store.entry(KEY) / VALUE).open("r+b") as file:
        file.truncate(64 * 2**30)  # a sparse file
    with pytest.raises(MissingEntry, match="too large"):
        store.load(KEY)


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
