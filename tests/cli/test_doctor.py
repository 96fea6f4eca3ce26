"""`stixel doctor`, with stand-ins for renderers that die or hang."""

import json
import sys
from collections import namedtuple

import pytest

from stixel_cli.cli.app import main
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.store import Store
from stixel_cli.machine import health
from stixel_cli.rendering.filament import probe_filament

HANGS = (sys.executable, "-c", "import time; time.sleep(60)")
DIES = (sys.executable, "-c", "import os; os.abort()")
SAYS = (sys.executable, "-c", "import sys; sys.exit('\\nlibusb-1.0.so.0: no such file\\n')")


def works():
    return None


@pytest.fixture
def renderers(monkeypatch):
    """Stand-ins for the renderers: both work, if nothing else is said."""

    def stand_in(raycast=works, filament=works):
        monkeypatch.setattr(health, "probe_raycast", raycast)
        monkeypatch.setattr(health, "_probe_filament", filament)

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


def test_filament_may_be_absent_and_rays_may_not(renderers, capsys):
    renderers(filament=lambda: "filament did not start within 60 s")
    code, checks = doctor(capsys)
    assert (code, checks["renderer filament"]["status"]) == (0, "absent")
    renderers(raycast=lambda: "libusb-1.0.so.0: no such file")
    code, checks = doctor(capsys)
    assert (code, checks["renderer raycast"]["status"]) == (1, "fails")
    assert main(["doctor"]) == 1
    assert "renderer raycast fails: libusb-1.0.so.0" in capsys.readouterr().out


def test_a_renderer_that_hangs_is_left():
    assert "within 0.5 s" in health.probe_raycast(0.5, HANGS)
    assert "within 0.5 s" in probe_filament(0.5, HANGS)


def test_a_renderer_that_dies_is_survived():
    assert "signal 6" in health.probe_raycast(600.0, DIES)
    assert health.probe_raycast(600.0, SAYS).endswith("code 1: libusb-1.0.so.0: no such file")


def test_rays_are_cast_in_a_process_of_their_own():
    assert health.probe_raycast(600.0) is None


def test_a_cache_that_cannot_be_written_fails(renderers, tmp_path):
    (tmp_path / "file").write_text("mine")
    checks = {one.name: one for one in health.examine(Store(tmp_path / "file"))}
    assert checks["cache folder"].status == "fails"
    below = {one.name: one for one in health.examine(Store(tmp_path / "file" / "a"))}
    assert below["cache folder"].status == "fails"


def test_a_full_disk_fails(renderers, tmp_path, monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr("shutil.disk_usage", lambda folder: usage(10, 9, 1))
    checks = {one.name: one for one in health.examine(Store(tmp_path))}
    assert checks["disk free"].status == "fails"


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
