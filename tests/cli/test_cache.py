"""`stixel cache …`, on a cache with a few entries made by hand, and `stixel doctor`."""

import io
import json
import os
import sys
import time
from collections import namedtuple

import numpy as np
import pytest

from stixel_cli.cli.app import main
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.store import META, VALUE, Store
from stixel_cli.machine import health
from stixel_cli.rendering.filament import probe

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


def test_ls_of_a_cache_and_of_none(store, capsys, tmp_path, monkeypatch):
    found = answer(capsys, "ls")
    assert found["folder"] == str(store.folder)
    assert found["entries"] == 6
    assert found["stages"]["render"]["entries"] == 4
    assert main(["cache", "ls"]) == 0
    said = capsys.readouterr().out
    assert "render" in said
    assert "7 d ago" in said
    assert "6 results" in said
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


HANGS = (sys.executable, "-c", "import time; time.sleep(60)")
SAYS = (sys.executable, "-c", "import sys; sys.exit('\\nlibusb-1.0.so.0: no such file\\n')")


def works():
    return None


@pytest.fixture
def renderers(monkeypatch):
    """Stand-ins for the renderers: both work, if nothing else is said."""

    def stand_in(raycast=works, filament=works):
        found = {"raycast": raycast, "filament": filament}
        monkeypatch.setattr("stixel_cli.rendering.filament.probe", lambda name, *_: found[name]())

    stand_in()
    return stand_in


def doctor(capsys):
    capsys.readouterr()
    code = main(["doctor", "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert answer["ok"] == (code == 0)
    return code, {check["name"]: check for check in answer["checks"]}


def test_all_is_well(renderers, capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    code, checks = doctor(capsys)
    assert code == 0
    assert {"stixel", "Python", "cores", "renderer raycast", "renderer filament"} <= set(checks)
    assert {"numpy", "cache folder", "cache size", "disk free"} <= set(checks)
    assert not (tmp_path / "cache").exists()
    assert main(["doctor"]) == 0
    said, told = capsys.readouterr()
    assert "the default experiment can run here" in said
    assert "raycast draws a picture" in told and "filament draws" in told


def test_filament_may_be_absent_and_rays_the_cache_and_free_space_may_not(
    renderers, capsys, tmp_path, monkeypatch
):
    renderers(filament=lambda: "filament did not start within 60 s")
    code, checks = doctor(capsys)
    assert (code, checks["renderer filament"]["status"]) == (0, "absent")
    renderers(raycast=lambda: "libusb-1.0.so.0: no such file")
    code, checks = doctor(capsys)
    assert (code, checks["renderer raycast"]["status"]) == (1, "fails")
    assert main(["doctor"]) == 1
    assert "renderer raycast fails: libusb-1.0.so.0" in capsys.readouterr().out
    (tmp_path / "file").write_text("mine")
    checks = {one.name: one for one in health.examine(Store(tmp_path / "file"))}
    assert checks["cache folder"].status == "fails"
    below = {one.name: one for one in health.examine(Store(tmp_path / "file" / "a"))}
    assert below["cache folder"].status == "fails"
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr("shutil.disk_usage", lambda folder: usage(10, 9, 1))
    checks = {one.name: one for one in health.examine(Store(tmp_path))}
    assert checks["disk free"].status == "fails"


def test_rays_are_cast_in_a_process_of_their_own_that_may_hang_or_fail():
    """Or die, as any renderer's: `tests/rendering/test_filament.py`."""
    assert probe("raycast", 600.0, health.PROBES["raycast"]) is None
    assert "within 0.5 s" in probe("raycast", 0.5, HANGS)
    assert probe("raycast", 600.0, SAYS).endswith("code 1: libusb-1.0.so.0: no such file")


def test_a_read_only_cache_serves_what_it_holds(renderers, tmp_path, monkeypatch):
    store = Store(tmp_path)

    def refuse(self):
        raise CacheError(f"cannot write in the cache {self.folder}: Read-only file system")

    store.save("ab" * 32, 1, stage="scenario", label="scenario")
    monkeypatch.setattr(Store, "check_writable", refuse)
    checks = {one.name: one for one in health.examine(store)}
    assert checks["cache folder"].status == "limited"
    assert "Read-only file system; only cached experiments can run" in checks["cache folder"].text
    store.entry("ab" * 32).rename(tmp_path / "gone")
    checks = {one.name: one for one in health.examine(store)}
    assert checks["cache folder"].status == "fails"
