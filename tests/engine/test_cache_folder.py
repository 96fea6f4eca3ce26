"""Only a cache is used as one, and only what the store made is removed from it."""

import os
import time
from pathlib import Path

import pytest

from stixel_cli.border import write_whole
from stixel_cli.cli.app import main
from stixel_cli.engine import cache_folder
from stixel_cli.engine.cache_folder import MARK, Lease, is_marked, made_here, make_folder
from stixel_cli.engine.cleanup import clear, collect, evicted, keep_limit
from stixel_cli.engine.entries import set_aside
from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.parameters import CacheParameters
from stixel_cli.engine.plan import DURATIONS, Durations
from stixel_cli.engine.source_files import kept_source
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
    files = [put(folder / name / "old", 1e6) for name in ("tmp", "sources", "quarantine", "ab")]
    monkeypatch.setenv("STIXEL_CACHE", str(folder))
    return files


@pytest.mark.parametrize(
    "words",
    [("cache", "gc"), ("cache", "clear", "--yes"), ("cache", "ls"), ("run", *SMALL)],
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
    """The mark itself is no foreign file."""
    foreign = cache_folder._foreign

    def marked_meanwhile(folder):
        monkeypatch.setattr(cache_folder, "_foreign", foreign)
        make_folder(tmp_path, "locks")
        return foreign(folder)

    monkeypatch.setattr(cache_folder, "_foreign", marked_meanwhile)
    assert make_folder(tmp_path, "tmp").is_dir()


def test_an_unmarked_cache_of_an_earlier_version_is_marked(tmp_path):
    store = Store(tmp_path / "cache")
    store.save(KEY, 1)
    with store.lock(KEY):
        lease = Lease(store.folder)
        lease.take([KEY])
        (store.folder / MARK).unlink()
        again = open_store(CacheParameters(str(store.folder), None))
    assert not is_marked(store.folder)
    again.save("cd" + KEY[2:], 2)
    lease.end()
    assert is_marked(store.folder) and again.load(KEY) == 1


def test_files_of_others_in_a_cache_stay(tmp_path):
    store = Store(tmp_path / "cache", max_size=0)
    store.save(KEY, 1)
    others = [
        put(store.folder / name, 1e8)
        for name in ("mine", "tmp/old", "sources/mine.py", "quarantine/x", "locks/mine.lock")
    ]
    (store.folder / "no").mkdir()
    assert set_aside(store) == 0
    keep_limit(store)
    collect(store, 0, 0.0)
    done = clear(store)
    assert not store.has(KEY) and done.kept == 0
    assert all(file.exists() for file in others) and (store.folder / "no").is_dir()


def test_the_store_makes_no_other_names(tmp_path):
    # What runs leave behind is recognised: otherwise an unmarked cache would be refused.
    store = Store(tmp_path / "cache")
    store.save(KEY, 1)
    (store.entry(KEY) / VALUE).write_bytes(b"damaged")
    with pytest.raises(MissingEntry):
        store.load(KEY)
    [aside] = (store.folder / "quarantine").iterdir()
    assert made_here(aside)


def test_a_run_leaves_only_names_of_the_store(tmp_path, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    for _ in range(2):
        assert main(["run", *SMALL, "--results", str(tmp_path / "results")]) == 0
    names = [
        path
        for folder in (tmp_path / "cache").iterdir()
        if folder.is_dir()
        for path in folder.iterdir()
        if not made_here(path)
    ]
    assert names == []


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


def test_other_files_of_the_cache_do_not_block(tmp_path):
    store = Store(tmp_path)
    store.save(KEY, 1, stage="a", label="a")
    (tmp_path / "sources").mkdir()
    os.mkfifo(tmp_path / "sources" / f"{'a' * 32}.py")
    assert kept_source(tmp_path, "a" * 32) is None
    nested(tmp_path / "evicted.jsonl")
    assert evicted(store) == {}
    (tmp_path / "evicted.jsonl").unlink()
    os.mkfifo(tmp_path / "evicted.jsonl")
    assert evicted(store) == {}
    assert [one.name for one in clear(store).removed] == [KEY]


def test_a_value_that_has_grown_is_not_read(tmp_path):
    store = Store(tmp_path)
    store.save(KEY, 1)
    with (store.entry(KEY) / VALUE).open("r+b") as file:
        file.truncate(64 * 2**30)  # a sparse file
    with pytest.raises(MissingEntry, match="larger"):
        store.load(KEY)


def test_a_composition_that_a_kill_left_unfinished_is_a_name_of_the_store(tmp_path, monkeypatch):
    unfinished = []
    monkeypatch.setattr(Path, "replace", lambda partial, file: unfinished.append(partial))
    write_whole(tmp_path / "configurations" / f"{'0' * 64}.json", "{}")
    assert made_here(*unfinished)
