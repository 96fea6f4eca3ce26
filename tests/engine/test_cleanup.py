"""The cache's upkeep: only a cache is used as one, what is listed, what goes first or never."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from stixel_cli.engine import cache_folder
from stixel_cli.engine.cache_folder import MARK, Lease, check_owner, make_folder
from stixel_cli.engine.entries import collect, entries, entry_folders, keep_limit
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.parameters import CacheParameters, parse_age, parse_size
from stixel_cli.engine.plan import DURATIONS, Durations
from stixel_cli.engine.source_files import save_digests
from stixel_cli.engine.store import VALUE, Store, default_cache_folder, open_store

KEYS = [f"{i:02x}" * 32 for i in range(1, 6)]


@pytest.fixture
def store(tmp_path):
    """Five entries of some 8 KB, the first used the longest ago, one day apart."""
    store = Store(tmp_path / "cache")
    for i, key in enumerate(KEYS):
        store.save(key, np.zeros(1000), stage=f"stage{i % 2}", label=f"label{i}", created=1e9 + i)
        used = time.time() - 86400.0 * (len(KEYS) - i)
        os.utime(store.entry(key), (used, used))
    return store


def left(store):
    return [key for key in KEYS if store.has(key)]


def test_entries(store):
    found = entries(store)
    assert [one.key for one in found] == KEYS
    assert [one.stage for one in found] == ["stage0", "stage1"] * 2 + ["stage0"]
    assert found[2].label == "label2"
    assert all(8000 < one.size < 9000 for one in found)
    assert found[0].last_use == pytest.approx(time.time() - 5 * 86400.0, abs=60.0)
    assert entries(Store(store.folder / "nothing")) == []
    # A file of an older version counts.
    (store.entry(KEYS[2]) / "value.pickle").write_bytes(b"x" * 1000)
    sizes = {one.key: one.size for one in entry_folders(store)}
    assert sizes[KEYS[2]] == found[2].size + 1000


def test_the_least_recently_used_go_first(store):
    size = entries(store)[0].size
    store.load(KEYS[0])
    collection = collect(store, max_size=3 * size + 100)
    assert left(store) == [KEYS[0], KEYS[3], KEYS[4]]
    assert (collection.removed, collection.kept, collection.in_use) == (2, 3, 0)
    assert collection.kept_size == sum(one.size for one in entries(store))
    assert list((store.folder / "tmp").iterdir()) == []


def test_a_lease_that_is_taken_again_lets_the_others_go(store):
    own = Lease(store.folder)
    own.take(KEYS)
    own.take(KEYS[2:3])
    collect(store, max_size=0)
    assert left(store) == KEYS[2:3]
    own.close()
    own.close()


HOLD = """
import sys, time
from stixel_cli.engine.cache_folder import Lease
from pathlib import Path
own = Lease(Path(sys.argv[1]))
own.take(sys.argv[2:])
print("taken", flush=True)
time.sleep(600)
"""


def test_the_lease_of_another_process_holds_until_it_is_killed(store):
    command = [sys.executable, "-c", HOLD, str(store.folder), *KEYS[:3]]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "taken\n"
    collect(store, max_size=0)
    assert left(store) == KEYS[:3]
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=600)
    collect(store, max_size=0)
    assert left(store) == []


def test_what_killed_processes_left(store):
    folder, hours_ago = store.folder / "tmp", time.time() - 2 * 3600.0
    fresh, old = (folder / f"{KEYS[0][:16]}-host-1-{i}f" for i in (1, 2))
    for path in (fresh, old):
        path.mkdir()
        (path / VALUE).write_bytes(b"half")
    mark = folder / "limit-1"
    mark.touch()
    for path in (old, mark):
        os.utime(path, (hours_ago, hours_ago))
    (store.folder / "locks").mkdir(exist_ok=True)
    lock = store.folder / "locks" / f"{KEYS[0]}.lock"
    lock.touch()
    held = store.folder / "locks" / f"{KEYS[1]}.lock"
    with store.lock(KEYS[1]):
        found = collect(store, dry_run=True)
        assert (found.left, found.left_size) == (1, len(b"half")) and old.exists()
        assert collect(store) == found
        assert not old.exists() and not lock.exists()
        assert fresh.exists() and mark.exists() and held.exists()
    assert left(store) == KEYS


def test_a_bad_entry_that_cannot_be_removed(store, monkeypatch):
    (store.entry(KEYS[1]) / VALUE).write_bytes(b"")
    monkeypatch.setattr(Path, "rename", lambda *args: (_ for _ in ()).throw(OSError("no")))
    bad = []
    assert len(entries(store, bad, values=True)) == 4
    ((one, fault),) = bad
    assert one.label == "label1" and "content has changed" in fault.reason and not fault.removed


def test_clear(store):
    save_digests(store.folder)
    assert list((store.folder / "sources").iterdir())
    collection = collect(store, 0)
    assert (collection.removed, collection.kept, collection.left) == (5, 0, 1)
    assert entries(store) == [] and not list((store.folder / "sources").iterdir())
    assert collect(Store(store.folder / "nothing"), 0).removed == 0


def test_a_cache_that_cannot_be_written(store, monkeypatch):
    def refuse(*arguments, **options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.touch", refuse)
    with pytest.raises(CacheError, match=r"cannot write in the cache .*: Permission denied"):
        collect(store, max_size=0)
    assert left(store) == KEYS
    store.max_size = 1
    keep_limit(store)
    assert left(store) == KEYS, "as it is, with no word"


def test_the_limit_is_kept_without_being_asked(project):
    graph = project.graph()
    project.store.max_size = 1
    project.run(graph)
    labels = {one.label for one in entries(project.store)}
    assert labels == {"gather", "show[2]", "show[9]"}, "the targets are about to be loaded"
    project.store.max_size = 10**9
    project.calls()
    project.run(project.graph(seed=5), ["gather"])
    assert len(entries(project.store)) > 3


def test_the_limit_is_kept_on_the_way(project, monkeypatch):
    monkeypatch.setattr("stixel_cli.engine.execute.Scheduler.keep_limit", lambda run: None)
    project.run(project.graph(factor=7.0))
    old = {one.key for one in entries(project.store)}
    monkeypatch.undo()
    monkeypatch.syspath_prepend(str(project.folder))
    monkeypatch.setenv("CALLS", str(project.calls_file))
    project.store.max_size = 1
    project.edit("gather", 'log.called("gather")', "raise ValueError")
    with pytest.raises(Exception, match="ValueError"):
        project.run(project.graph())
    assert not old & {one.key for one in entries(project.store)}


def test_the_store_of_the_configuration(monkeypatch, tmp_path):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "named"))
    store = open_store(CacheParameters(None, "2GB"))
    assert (store.folder, store.max_size) == (default_cache_folder(), 2_000_000_000)
    monkeypatch.delenv("STIXEL_CACHE")
    assert default_cache_folder().name == "stixel"
    store = open_store(CacheParameters(str(tmp_path / "own"), None))
    assert (store.folder, store.max_size) == (tmp_path / "own", None)


def test_sizes_and_ages():
    sizes = {"1kB": 1000, "1.5 GB": 1_500_000_000, "2GiB": 2 * 2**30, "7": 7, "0": 0}
    assert {text: parse_size(text) for text in sizes} == sizes
    ages = {"90s": 90.0, "10min": 600.0, "12h": 43200.0, "30d": 2_592_000.0, "2w": 1_209_600.0}
    assert {text: parse_age(text) for text in ages} == ages
    for parse in (parse_size, parse_age):
        for text in ("", "x", "-1GB", "1 m", "1e3", "nan", "10 G B", "1d2h", "١GB"):
            with pytest.raises(ValueError, match="write "):
                parse(text)


KEY = "ab" + "0" * 62
SMALL = ("measurement=fabricated", "tracker=point", "path.duration=0.5", "pictures.frames=[]")


def put(file, age=0.0):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("the user's")
    os.utime(file, (time.time() - age, time.time() - age))
    return file


@pytest.mark.parametrize(
    "words", [("cache", "gc"), ("cache", "clear", "--yes"), ("cache", "ls"), ("run", *SMALL)]
)
def test_a_folder_with_other_files_is_refused_and_left_alone(tmp_path, words, told, monkeypatch):
    # A user's folder with names as a cache has them.
    folder = tmp_path / "home"
    for name in ("tmp", "sources", "locks", "ab"):
        put(folder / name / "old", 1e6)
    monkeypatch.setenv("STIXEL_CACHE", str(folder))
    monkeypatch.chdir(tmp_path)
    before = sorted(folder.rglob("*"))
    said = told(*words, code=2)
    assert said.count("\n") == 1 and "not make" in said and "STIXEL_CACHE" in said
    assert sorted(folder.rglob("*")) == before


def test_whoever_creates_the_cache_marks_it(tmp_path):
    store = Store(tmp_path / "new" / "cache")
    store.save(KEY, 1)
    check_owner(store.folder)
    first, second = (store.folder / MARK).read_text().splitlines()
    assert first == "Signature: 8a477f597d28d172789f06886806bc55" and second == "stixel cache"
    # The mark of another program is none.
    (store.folder / MARK).write_text(f"{first}\nanother program\n")
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
    names = ("mine", "tmp/old", "sources/mine.py", "locks/mine.lock")
    others = [put(store.folder / name, 1e8) for name in names]
    (store.folder / "no").mkdir()
    keep_limit(store)
    collect(store, 0, 0.0)
    done = collect(store, 0)
    assert not store.has(KEY) and done.kept == 0
    assert all(file.exists() for file in others) and (store.folder / "no").is_dir()


@pytest.mark.parametrize("damage", [os.mkfifo, lambda file: file.write_text("[" * 10**5), os.mkdir])
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


def _status(execution):
    (record,) = (one for one in execution.stage_records() if one["name"] == "gather")
    return record["status"]


@pytest.fixture
def disk(tmp_path):
    """A small file system of its own, and a way to change how it is mounted."""
    folder = tmp_path / "disk"
    folder.mkdir()

    def mount(*options):
        command = ["mount", "-t", "tmpfs", "-o", ",".join(options), "tmpfs", str(folder)]
        done = subprocess.run(command, capture_output=True, text=True)
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
    wrong = r"^cannot write in the cache .*: Read-only file system: choose another "
    with pytest.raises(CacheError, match=wrong):
        project.run(project.graph(seed=2))
    assert project.calls() == [], "said before anything runs"
    with pytest.raises(CacheError, match="Read-only file system"):
        collect(project.store, max_size=0)
    assert collect(project.store, max_size=0, dry_run=True).removed == 12
    remount("rw")
    project.run(project.graph(seed=2))
    assert project.calls() == ["gather"]
