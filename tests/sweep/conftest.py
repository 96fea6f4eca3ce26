"""Small sweeps by the real command line."""

import csv
import json

import pytest

from stixel_cli.cli.app import main

FEW = ("measurement=fabricated", "path.duration=0.3")
"""Three scans of fabricated measurements."""


class Sweeps:
    """Runs `stixel sweep` and reads what it leaves."""

    def __init__(self, results, capsys):
        self.results = results
        self._capsys = capsys
        self.error = ""

    def run(self, *arguments, code=0):
        """What the command prints as JSON, after it has ended with `code`."""
        self._capsys.readouterr()
        found = main(["sweep", "--json", "--results", str(self.results), *map(str, arguments)])
        said = self._capsys.readouterr()
        self.error = said.err
        assert found == code, said.err
        return json.loads(said.out) if said.out else None

    def refused(self, *arguments, code=2):
        """The one line of a refused command; nothing is written."""
        before = sorted(self.results.rglob("*"))
        assert self.run(*arguments, code=code) is None
        assert self.error.count("\n") == 1, self.error
        assert sorted(self.results.rglob("*")) == before
        return self.error

    def rows(self, name):
        """The rows of `runs.csv`."""
        with (self.results / name / "runs.csv").open(encoding="utf-8") as file:
            return list(csv.DictReader(file))


@pytest.fixture
def sweeps(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    return Sweeps(tmp_path / "results", capsys)


@pytest.fixture
def bad_mesh(tmp_path):
    """A file that passes for a mesh until a stage reads it."""
    file = tmp_path / "bad.obj"
    file.write_text("this is no mesh\n", encoding="utf-8")
    return file
