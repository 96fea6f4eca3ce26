"""What is refused before anything is computed leaves no results folder; what is there serves."""

import pytest

from stixel_cli.cli.app import main
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.store import Store

FEW = ("measurement=fabricated", "path.duration=0.3", "pictures.frames=[0]")
NOBODY = ("executor=dask", "executor.address=tcp://127.0.0.1:9")


@pytest.fixture
def refusing(monkeypatch, tmp_path):
    """A cache that is read-only once this is called."""
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))

    def refuse(self):
        raise CacheError(f"cannot write in the cache {self.folder}: Read-only file system")

    return lambda: monkeypatch.setattr(Store, "check_writable", refuse)


@pytest.mark.parametrize("words", [("run", *FEW), ("sweep", *FEW, "seed=0,1")])
def test_a_read_only_cache(refusing, tmp_path, capsys, words):
    results = tmp_path / "results"
    refusing()
    assert main([*words, "--results", str(results)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "Read-only file system; it lacks " in said
    assert "STIXEL_CACHE or cache.folder=…" in said
    assert not results.exists()


@pytest.mark.parametrize("words", [("run", *FEW), ("sweep", *FEW, "seed=0,1")])
def test_a_scheduler_that_is_not_there(monkeypatch, tmp_path, capsys, words):
    pytest.importorskip("distributed", reason="Dask is not installed")
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("stixel_cli.engine.dask_pool.PATIENCE", 0.5)
    results = tmp_path / "results"
    assert main([*words, *NOBODY, "--results", str(results)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "no Dask scheduler at tcp://127.0.0.1:9" in said
    assert not results.exists()


def test_a_read_only_cache_that_holds_all_serves(refusing, tmp_path, capsys):
    results = tmp_path / "results"
    sweep = ("sweep", *FEW, "seed=0,1", "--results", str(results), "--name")
    assert main([*sweep, "first"]) == 0
    refusing()
    assert main([*sweep, "again"]) == 0
    # Nothing is lacking, so that nobody needs to be there to compute it.
    assert main([*sweep[:-3], *NOBODY, *sweep[-3:], "alone"]) == 0
    capsys.readouterr()
    for name in ("again", "alone"):
        runs = [(results / which / "summary.csv").read_text() for which in ("first", name)]
        assert runs[0] == runs[1]
