"""Tiny studies by the real command line, and one with a report made for the tests."""

import pytest
import study_toy
from json_commands import JsonCommand


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """A cache in which nothing is yet."""
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def studies(tmp_path, capsys):
    return JsonCommand("study", tmp_path / "results", capsys, "--trust-code")


@pytest.fixture
def toy(tmp_path):
    """Writes the file of a toy study, with changes to its entries; `seen`: the report's data."""
    study_toy.SEEN.clear()

    def write(content=study_toy.TOY, name="toy"):
        return study_toy.write(tmp_path, content, name)

    write.seen = study_toy.SEEN
    return write
