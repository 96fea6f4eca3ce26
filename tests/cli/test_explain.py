"""`stixel explain`: why something would run."""

import json

import pytest

from stixel_cli.cli.app import main

pytestmark = pytest.mark.sketched

FABRICATED = ("measurement=fabricated", "path.duration=0.3", "pictures.frames=[0]")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A result folder, and a cache that holds its results."""
    root = tmp_path_factory.mktemp("explained")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(root / "cache"))
        assert main(["run", *FABRICATED, "--results", str(root), "--name", "first"]) == 0
    return root / "first"


@pytest.fixture
def explained(folder, capsys, monkeypatch):
    """What `stixel explain` says, by stage."""
    monkeypatch.setenv("STIXEL_CACHE", str(folder.parent / "cache"))

    def explain(*words):
        capsys.readouterr()
        assert main(["explain", "--json", *words]) == 0
        found = json.loads(capsys.readouterr().out)
        return {one["stage"]: [why["text"] for why in one["why"]] for one in found}

    return explain


def test_nothing_would_run(explained, folder, capsys):
    assert explained(*FABRICATED) == {}
    assert explained(str(folder)) == {}
    assert main(["explain", str(folder)]) == 0
    assert capsys.readouterr().out == "nothing to recompute: all results are cached\n"


def test_a_setting_that_changed(explained, capsys):
    why = explained(*FABRICATED, "tracker.sigma_f=0.77")
    assert any("sigma_f changed from" in text and "to 0.77" in text for text in why["track"])
    assert why["scores"] == ["input changed: track"]
    assert main(["explain", *FABRICATED, "tracker.sigma_f=0.77"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("track: ")


def test_an_empty_cache(explained, folder, monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "none"))
    capsys.readouterr()
    assert main(["explain", str(folder)]) == 0
    assert "new: no result of track is stored" in capsys.readouterr().out
    assert not (tmp_path / "none").exists()


def test_folder_and_overrides_do_not_mix(folder, capsys):
    assert main(["explain", str(folder), "seed=1"]) == 2
    assert "either one result folder or overrides" in capsys.readouterr().err
