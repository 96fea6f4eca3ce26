"""A benchmark of a few fabricated scans: its definitions are a file, so others can be given."""

import shutil
from contextlib import contextmanager
from itertools import count
from types import SimpleNamespace

import pytest
import yaml

from stixel_cli.benchmark import sequences
from stixel_cli.cli.app import main

PATHS = {"turn": {"path": "turn"}, "crossing": {"path": "crossing"}}
SIZE = {"path": "turn", "prior.length": {"car": 5.0, "cyclist": 1.9}}
DEFINITIONS = {
    "version": "1.0",
    "whole": ["frozen", "hard"],
    "road_users": ["car", "cyclist"],
    "sensors": {"fabricated": {"measurement": "fabricated", "path.duration": 1.2}},
    "mini_seeds": [0, 1],
    "parts": {"frozen": {"seeds": {"fabricated": [0, 1, 2]}, "cases": PATHS},
              "hard": {"seeds": {"fabricated": [0]}, "cases": {"size": SIZE}}},
}  # fmt: skip


@pytest.fixture(autouse=True)
def _no_tracker_is_late(monkeypatch):
    """Every track takes 10 ms, however busy the machine is: late estimates do not count."""
    clock = SimpleNamespace(perf_counter=count(0.0, 0.01).__next__)
    monkeypatch.setattr("stixel_cli.benchmark.run.time", clock)


@contextmanager
def small_definitions(place, patch):
    """The working directory `place`, with small definitions in place of version 1.0, by `patch`.

    A test that changes the directory again must do so by the same `patch`, which goes back to the
    first one.
    """
    folder = place / "definitions"
    patch.setattr(sequences, "bench_folder", lambda: folder)
    patch.chdir(place)
    sequences.definitions.cache_clear()
    yield
    sequences.definitions.cache_clear()


@pytest.fixture(scope="session")
def computed(tmp_path_factory):
    """Small definitions, their mini set `data`, and a pack of gp_ekf; each test has a copy."""
    place = tmp_path_factory.mktemp("bench")
    (place / "definitions").mkdir()
    text = yaml.safe_dump(DEFINITIONS)
    (place / "definitions" / "sequences.yaml").write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch, small_definitions(place, patch):
        assert main(["bench", "render", "--mini", "--data", "data"]) == 0
        assert main(["bench", "run", "gp_ekf", "--data", "data"]) == 0
    return place


@pytest.fixture
def packed(computed, tmp_path, monkeypatch):
    """The working directory with the mini set, a pack of gp_ekf, `gp_ekf.zip`, and its folder."""
    shutil.copytree(computed, tmp_path, dirs_exist_ok=True)
    with small_definitions(tmp_path, monkeypatch):
        yield tmp_path


@pytest.fixture
def rendered(packed):
    """The folder of the mini set."""
    return packed / "data"
