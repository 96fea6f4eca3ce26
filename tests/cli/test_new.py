"""`stixel new tracker NAME`: the module is a tracker, and its test passes."""

import sys
from runpy import run_path

from stixel_cli.cli.app import main


def test_a_new_tracker_passes_its_test(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "tracker", "mine"]) == 0
    assert "stixel run tracker=mine:track" in capsys.readouterr().out
    assert {file.name for file in tmp_path.iterdir()} == {"mine.py", "test_mine.py"}
    assert len((tmp_path / "mine.py").read_text().splitlines()) <= 30
    # As pytest would: another process takes seconds to import all.
    monkeypatch.syspath_prepend(tmp_path)
    (test,) = [one for name, one in run_path("test_mine.py").items() if name.startswith("test_")]
    test()
    sys.modules.pop("mine")


def test_it_overwrites_nothing_and_needs_a_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "test_mine.py").write_text("mine")
    for words, fault in (
        (["tracker", "mine"], "test_mine.py: exists"),
        (["tracker", "my-tracker"], "must be the name of a new module"),
        (["tracker", "numpy"], "must be the name of a new module"),
        (["tracker", "class"], "must be the name of a new module"),
        (["sensor", "mine"], "no such command 'sensor'"),
    ):
        assert main(["new", *words]) == 2
        assert fault in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["test_mine.py"]
