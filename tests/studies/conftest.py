"""Tiny studies by the real command line, and one with a report made for the tests."""

import json

import pytest
import study_toy

from stixel_cli.cli.app import main


class Studies:
    """Runs `stixel study` and reads what it leaves."""

    def __init__(self, results, capsys):
        self.results = results
        self._capsys = capsys
        self.error = ""

    def run(self, *arguments, code=0):
        """What the command prints as JSON, after it has ended with `code`."""
        self._capsys.readouterr()
        found = main(
            [
                "study",
                *map(str, arguments),
                "--json",
                "--trust-code",
                "--results",
                str(self.results),
            ]
        )
        said = self._capsys.readouterr()
        # What --trust-code lets through is told first.
        lines = [f"{line}\n" for line in said.err.splitlines() if "(--trust-code)" not in line]
        self.error = "".join(lines)
        assert found == code, said.err
        return json.loads(said.out) if said.out else None

    @property
    def messages(self):
        """The lines on stderr, without those of the progress on a slow machine."""
        return [line for line in self.error.splitlines() if " nodes cached" not in line]

    def refused(self, *arguments):
        """The one line of a refused command; nothing is written."""
        before = sorted(self.results.rglob("*"))
        assert self.run(*arguments, code=2) is None
        assert self.error.count("\n") == 1, self.error
        assert sorted(self.results.rglob("*")) == before
        return self.error


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """A cache in which nothing is yet."""
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def studies(tmp_path, capsys):
    return Studies(tmp_path / "results", capsys)


@pytest.fixture
def toy(tmp_path):
    """Writes the file of a toy study, with changes to its entries; `seen`: the report's data."""
    study_toy.SEEN.clear()

    def write(content=study_toy.TOY, name="toy"):
        return study_toy.write(tmp_path, content, name)

    write.seen = study_toy.SEEN
    return write
