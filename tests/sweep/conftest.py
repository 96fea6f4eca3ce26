"""Small sweeps by the real command line."""

import pytest
from json_commands import JsonCommand


@pytest.fixture
def sweeps(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    return JsonCommand("sweep", tmp_path / "results", capsys)


@pytest.fixture
def bad_mesh(tmp_path):
    """A file that passes for a mesh until a stage reads it."""
    file = tmp_path / "bad.obj"
    file.write_text("this is no mesh\n", encoding="utf-8")
    return file
