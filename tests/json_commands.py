"""Commands by the real command line, with --json."""

import csv
import json

from stixel_cli.cli.app import main


class JsonCommand:
    """Runs a command that writes into `results`, and reads what it prints and leaves.

    `more` are its further words, and `error` is what it said last on stderr.
    """

    def __init__(self, name, results, capsys, *more):
        self.results, self.error = results, ""
        self._name, self._capsys, self._more = name, capsys, more

    def run(self, *arguments, code=0):
        """What the command prints as JSON, after it has ended with `code`."""
        self._capsys.readouterr()
        words = [*map(str, arguments), "--json", *self._more, "--results", str(self.results)]
        found = main([self._name, *words])
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
