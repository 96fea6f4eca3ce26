"""A benchmark of a few fabricated scans: its definitions are a file, so others can be given."""

from itertools import count
from types import SimpleNamespace

import pytest
import yaml

from stixel_cli.benchmark import sequences
from stixel_cli.cli.app import main

DEFINITIONS = {
    "version": "1.0",
    "whole": ["frozen", "hard"],
    "road_users": ["car", "cyclist"],
    "sensors": {"fabricated": {"measurement": "fabricated", "path.duration": 1.2}},
    "mini_seeds": [0, 1],
    "parts": {
        "frozen": {
            "seeds": {"fabricated": [0, 1, 2]},
            "cases": {"turn": {"path": "turn"}, "crossing": {"path": "crossing"}},
        },
        "hard": {
            "seeds": {"fabricated": [0]},
            "cases": {"size": {"path": "turn", "prior.length": {"car": 5.0, "cyclist": 1.9}}},
        },
    },
}


@pytest.fixture(autouse=True)
def _no_tracker_is_late(monkeypatch):
    """Every track takes 10 ms, however busy the machine is: late estimates do not count."""
    clock = SimpleNamespace(perf_counter=count(0.0, 0.01).__next__)
    monkeypatch.setattr("stixel_cli.benchmark.run.time", clock)


@pytest.fixture
def small_bench(tmp_path, monkeypatch):
    """The working directory, with small definitions in place of version 1.0."""
    folder = tmp_path / "definitions"
    folder.mkdir()
    (folder / "sequences.yaml").write_text(yaml.safe_dump(DEFINITIONS), encoding="utf-8")
    monkeypatch.setattr(sequences, "bench_folder", lambda: folder)
    sequences.definitions.cache_clear()
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    sequences.definitions.cache_clear()


@pytest.fixture
def rendered(small_bench):
    """The folder of its mini set."""
    assert main(["bench", "render", "--mini", "--data", "data"]) == 0
    return small_bench / "data"
