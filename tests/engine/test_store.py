"""The store: what comes back is what was put in, or nothing does."""

import errno
import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from stixel_cli.engine.cache_folder import collector_lock
from stixel_cli.engine.errors import CacheError, MissingEntry
from stixel_cli.engine.store import META, VALUE, Store

KEY = "ab" + "0" * 62


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "cache")


def test_each_load_is_a_new_object_that_may_be_written(store):
    store.save(KEY, np.zeros(3))
    store.load(KEY)[0] = 1.0
    assert store.load(KEY)[0] == 0.0


def test_load_returns_the_stored_value_and_nothing_is_made_before(store):
    assert not store.has(KEY) and not store.verify(KEY)
    with pytest.raises(MissingEntry, match="not found"):
        store.load(KEY)
    assert not store.folder.exists()
    value = (np.arange(12.0).reshape(3, 4).T, b"bytes", {"a": [1, None]}, np.zeros((0, 2), "f4"))
    assert not store.has(KEY)
    size = store.save(KEY, value, stage="any", seconds=0.5)
    assert store.has(KEY) and store.verify(KEY)
    array, content, plain, empty = store.load(KEY)
    np.testing.assert_array_equal(array, value[0])
    assert (content, plain, empty.shape, empty.dtype) == (b"bytes", {"a": [1, None]}, (0, 2), "f4")
    meta = store.meta(KEY)
    assert (meta["stage"], meta["seconds"], meta["size"]) == ("any", 0.5, size)
    assert (store.entry(KEY) / VALUE).stat().st_size == size
    assert list((store.folder / "tmp").iterdir()) == []


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def put(make, path):
    path.unlink()
    make(path)


def change_notes(entry, **notes):
    """Other notes, as valid as those before, under the digest of those before."""
    found = json.loads((entry / META).read_text())
    (entry / META).write_text(json.dumps(found | notes, indent=1))


def old_notes(entry):
    """Notes as they were stored before they had a digest of their own."""
    found = json.loads((entry / META).read_text())
    del found["notes_digest"]
    return json.dumps(found, indent=1)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda entry: flip(entry / VALUE), "has changed"),
        (lambda entry: (entry / VALUE).write_bytes((entry / VALUE).read_bytes()[:-9]), "changed"),
        (lambda entry: (entry / VALUE).write_bytes(b""), "changed"),
        (lambda entry: os.truncate(entry / VALUE, 64 * 2**30), "too large"),  # a sparse file
        (lambda entry: (entry / VALUE).unlink(), "value.joblib is missing"),
        (lambda entry: put(Path.mkdir, entry / VALUE), "directory"),
        (lambda entry: put(Path.mkdir, entry / META), "directory"),
        # To open a FIFO would block until a process writes to it.
        (lambda entry: put(os.mkfifo, entry / VALUE), "not a regular file"),
        (lambda entry: put(os.mkfifo, entry / META), "not a regular file"),
        (lambda entry: (entry / META).write_text("{"), "notes are damaged"),
        (lambda entry: (entry / META).write_text("[]"), "notes are damaged"),
        (lambda entry: (entry / META).unlink(), "meta.json is missing"),
        (lambda entry: flip(entry / META), "notes have changed"),
        (lambda entry: change_notes(entry, size=7), "notes have changed"),
        (lambda entry: (entry / META).write_text(old_notes(entry)), "of an older version"),
    ],
)
def test_a_damaged_entry_is_removed(store, spoil, reason):
    store.save(KEY, np.arange(100))
    spoil(store.entry(KEY))
    with pytest.raises(MissingEntry, match=reason):
        store.load(KEY)
    assert not store.has(KEY) and not store.entry(KEY).exists()
    store.save(KEY, np.arange(3))
    np.testing.assert_array_equal(store.load(KEY), np.arange(3))


def test_notes_that_are_damaged_or_of_another_key_are_not_believed(store):
    store.save(KEY, 1)
    change_notes(store.entry(KEY), digest="0" * 64)
    assert not store.has(KEY)
    assert store.entry(KEY).exists(), "nothing is removed by a look"
    store.save(KEY, 2)
    assert store.load(KEY) == 2
    store.save(KEY, 1)
    other = "cd" + KEY[2:]
    store.entry(other).parent.mkdir(parents=True)
    store.entry(KEY).rename(store.entry(other))
    assert not store.has(other)
    with pytest.raises(MissingEntry, match="another key"):
        store.load(other)


def test_a_folder_that_a_collector_removes_on_the_way(store, monkeypatch):
    store.save("cd" + KEY[2:], 1)
    rename, removed = Path.rename, []

    def rename_late(path, target):
        if not removed:
            removed.append(target.parent)
            target.parent.rmdir()
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", rename_late)
    store.save(KEY, 1)
    assert removed == [store.entry(KEY).parent]
    assert store.load(KEY) == 1


def test_a_failed_save_leaves_nothing_and_a_second_one_the_first(store):
    with pytest.raises(Exception, match="pickle"):
        store.save(KEY, lambda: 1)
    assert not store.has(KEY)
    assert list((store.folder / "tmp").iterdir()) == []
    store.save(KEY, 1)
    store.save(KEY, 2)
    assert store.load(KEY) == 1
    assert list((store.folder / "tmp").iterdir()) == []


def test_a_folder_that_cannot_be_written_is_one_clear_error(tmp_path):
    (tmp_path / "file").write_text("")
    store = Store(tmp_path / "file" / "cache")
    assert not store.has(KEY)
    for attempt in (store.check_writable, lambda: store.save(KEY, 1), store.lock(KEY).__enter__):
        with pytest.raises(CacheError, match=r"cannot write in the cache .*: Not a directory"):
            attempt()


def test_a_full_disk_leaves_no_half_entry(store):
    # A limit on the size of files stands for the full disk.
    script = f"""
import resource, signal
import numpy as np
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.store import Store
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    Store({str(store.folder)!r}).save({KEY!r}, np.zeros(100_000))
except CacheError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stderr == ""
    assert done.stdout.startswith(f"cannot write in the cache {store.folder}: File too large: ")
    assert not store.has(KEY)
    assert list((store.folder / "tmp").iterdir()) == []


def test_one_holds_the_lock_and_no_file_is_left(store):
    inside, most = [], []

    def work():
        for _ in range(3):
            with store.lock(KEY):
                inside.append(1)
                most.append(len(inside))
                inside.pop()

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1] * 9
    assert list((store.folder / "locks").iterdir()) == []


@pytest.mark.parametrize("fault", [errno.ENOSYS, errno.ENOLCK])
def test_a_file_system_without_locks_is_refused_and_no_substitute_left(store, monkeypatch, fault):
    def no_lock(*arguments):
        raise OSError(fault, os.strerror(fault))

    store.save(KEY, 1)
    monkeypatch.setattr("fcntl.flock", no_lock)
    for lock in (store.lock(KEY), collector_lock(store.folder)):
        with pytest.raises(CacheError, match="locks"), lock:
            raise AssertionError("held")
    with pytest.raises(CacheError, match="locks"):
        store.check_writable()
    monkeypatch.undo()
    assert list((store.folder / "tmp").iterdir()) == []
    with store.lock(KEY), collector_lock(store.folder):
        assert store.load(KEY) == 1
