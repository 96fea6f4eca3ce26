"""`stixel cache …`, on a cache with a few entries made by hand."""

import io
import json
import os
import time

import numpy as np
import pytest

from stixel_cli.cli.app import main
from stixel_cli.engine.store import META, VALUE, Store

DAY = 86400.0


@pytest.fixture
def store(tmp_path, monkeypatch):
    """Six entries of two stages; the older a day after the other, least recently used first."""
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    store = Store(tmp_path / "cache")
    for i in range(6):
        key = f"{i:x}" * 64
        stage = "render" if i < 4 else "track"
        value = np.random.default_rng(i).bytes(1000)
        store.save(key, value, stage=stage, label=f"{stage}[{i}]", created=0.0)
        moment = time.time() - (10 - i) * DAY
        os.utime(store.entry(key), (moment, moment))
    return store


def answer(capsys, *words, code=0):
    capsys.readouterr()
    assert main(["cache", *words, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def left(store):
    return [i for i in range(6) if store.has(f"{i:x}" * 64)]


def test_ls(store, capsys):
    found = answer(capsys, "ls")
    assert found["folder"] == str(store.folder)
    assert found["entries"] == 6
    assert found["stages"]["render"]["entries"] == 4
    assert main(["cache", "ls"]) == 0
    said = capsys.readouterr().out
    assert "render" in said
    assert "7 d ago" in said
    assert "6 results" in said


def test_ls_of_no_cache(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "none"))
    assert answer(capsys, "ls")["entries"] == 0
    assert main(["cache", "ls"]) == 0
    assert not (tmp_path / "none").exists()


def test_gc_by_age_and_size(store, capsys):
    would = answer(capsys, "gc", "--older-than", "7.5d", "--dry-run")
    assert would["removed"] == 3
    assert left(store) == [0, 1, 2, 3, 4, 5]
    assert answer(capsys, "gc", "--older-than", "7.5d")["kept"] == 3
    assert left(store) == [3, 4, 5]
    assert main(["cache", "gc", "--max-size", "2KB"]) == 0
    assert "removed" in capsys.readouterr().out
    assert left(store)[-1] == 5
    assert 3 not in left(store)


def test_verify_names_what_is_bad_and_removes_it(store, capsys):
    assert answer(capsys, "verify")["bad"] == []
    file = store.entry("4" * 64) / VALUE
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    assert main(["cache", "verify"]) == 1
    said = capsys.readouterr().out
    assert "bad: track[4] 444444444444: " in said
    assert "6 results read, 1 is bad" in said
    assert left(store) == [0, 1, 2, 3, 5]
    assert answer(capsys, "verify")["bad"] == []


def test_ls_counts_what_is_damaged(store, capsys):
    for i in (1, 4):
        notes = store.entry(f"{i:x}" * 64) / META
        notes.write_bytes(notes.read_bytes().replace(b"[", b"{"))
    assert main(["cache", "ls", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["damaged"] == 2
    assert json.loads(said.out)["entries"] == 4
    assert said.err.startswith("stixel: 2 entries are damaged or of an older version")
    assert said.err.count("\n") == 1
    assert main(["cache", "ls"]) == 0
    assert capsys.readouterr().err == ""
    (store.entry("2" * 64) / META).write_text("{")
    assert main(["cache", "verify"]) == 1
    said = capsys.readouterr().out
    assert "4 results read, 1 is bad" in said and "2" * 12 in said


def test_notes_that_were_altered_are_bad_though_they_are_valid(store, capsys):
    notes = store.entry("2" * 64) / META
    content = json.loads(notes.read_bytes())
    notes.write_text(json.dumps(content | {"label": "other"}, indent=1))
    assert main(["cache", "verify"]) == 1
    said = capsys.readouterr().out
    assert "bad: ? 222222222222: its notes have changed; removed" in said
    assert left(store) == [0, 1, 3, 4, 5]


def test_clear(store, capsys):
    assert answer(capsys, "clear", "--yes")["removed"] == 6
    assert left(store) == []
    assert [path for path in store.folder.iterdir() if len(path.name) == 2] == []


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(("words", "code", "kept"), [("\n", 1, 6), ("no\n", 1, 6), ("Y\n", 0, 0)])
def test_clear_asks_on_a_terminal(store, monkeypatch, words, code, kept):
    screen = Terminal()
    monkeypatch.setattr("sys.stdin", Terminal(words))
    monkeypatch.setattr("sys.stderr", screen)
    assert main(["cache", "clear"]) == code
    assert screen.getvalue().startswith("remove 6 results, ")
    assert ("nothing was removed" in screen.getvalue()) == (code == 1)
    assert len(left(store)) == kept


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("gc", "--max-size", "much"), "--max-size: 'much' is not a valid size: write 500MB"),
        (("gc", "--older-than", "old"), "--older-than: 'old' is not a valid age: write"),
        (("clear",), "add --yes"),
        ((), "missing command"),
        (("lss",), "did you mean ls?"),
        (("verify", "all"), "unexpected extra argument"),
    ],
)
def test_wrong_words(store, words, said, capsys):
    assert main(["cache", *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error
    assert left(store) == [0, 1, 2, 3, 4, 5]


def test_a_cache_that_is_no_folder(tmp_path, capsys, monkeypatch):
    (tmp_path / "file").write_text("mine")
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "file"))
    for words in (["ls"], ["gc"], ["verify"], ["clear", "--yes"]):
        capsys.readouterr()
        code = main(["cache", *words])
        said = capsys.readouterr()
        assert "Traceback" not in said.err + said.out
        assert code in (0, 2)
        assert said.err.count("\n") == (1 if code else 0)
    assert (tmp_path / "file").read_text() == "mine"
