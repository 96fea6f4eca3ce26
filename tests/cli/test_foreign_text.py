"""Text of files that somebody else wrote never controls the terminal."""

import io
import json
import sys

import pytest
import yaml

from stixel_cli.cli.app import main
from stixel_cli.cli.terminal import escaping, print_table, say_wrapped
from stixel_cli.errors import escaped

STRANGE = "\x1b[2J\u202emp4\x9b31m\r\x07"
SHOWN = "\\x1b[2J\\u202emp4\\x9b31m"
FEW = ("measurement=fabricated", "path.duration=0.3", "pictures.frames=[]", "executor=threads")


@pytest.fixture(scope="module")
def originals(tmp_path_factory, shared_cache):
    """Two runs and a sweep with strange text in every file that can have it."""
    place = tmp_path_factory.mktemp("strange")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        for name in ("one", "two"):
            assert main(["run", *FEW, "--results", str(place), "--name", name]) == 0
        assert main(["sweep", *FEW, "seed=0,1", "--results", str(place), "--name", "swept"]) == 0
    for name in ("one", "two"):
        file = place / name / "manifest.json"
        manifest = json.loads(file.read_text())
        manifest |= {"command": STRANGE, "overrides": [f"tracker.a={STRANGE}"]}
        manifest["choices"]["tracker"] = STRANGE
        manifest["stages"][0]["name"] = STRANGE
        manifest["versions"] = {STRANGE: "1"}
        file.write_text(json.dumps(manifest))
        file = place / name / "config.yaml"
        config = yaml.safe_load(file.read_text())
        file.write_text(yaml.safe_dump(config | {"foreign": f"{name}{STRANGE}"}))
    file = place / "swept" / "sweep.yaml"
    file.write_text(yaml.safe_dump(yaml.safe_load(file.read_text()) | {"command": STRANGE}))
    return place


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["ls", "one"], 0),
        (["ls", "swept"], 0),
        (["ls", "one", "two"], 0),
        (["ls", "."], 0),
        (["explain", "one"], 2),
        (["ls", "--json", "one"], 0),
        ([f"--{STRANGE}"], 2),
        (["ls", STRANGE], 2),
        (["run", f"seed={STRANGE}"], 2),
    ],
)
def test_no_command_prints_it_as_it_is(words, code, originals, monkeypatch, capsys):
    monkeypatch.chdir(originals)
    assert main(words) == code
    said = capsys.readouterr()
    text = said.out + said.err
    assert all(c.isprintable() or c in "\n\t\u00a0" for c in text), repr(text)
    if code == 0 and words != ["ls", "."]:
        assert "u202e" in text
    if "--json" in words:
        assert json.loads(said.out)["manifest"]["command"] == STRANGE


def test_escaping_keeps_lines_spaces_and_letters():
    text = "Größe ±\u00a0µ 漢\n\tend"
    assert escaped(text) == text
    assert escaped(STRANGE) == f"{SHOWN}\\r\\x07"


def test_styles_of_a_terminal_stay(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr(sys, "stdout", Terminal())
    stream = sys.stdout
    with escaping():
        say_wrapped(f"green {STRANGE}", "bold green")
        print_table(("head",), [(STRANGE,)])
        print(STRANGE)
    text = stream.getvalue()
    assert sys.stdout is stream
    assert "\x1b[1;32mgreen" in text
    assert text.count(SHOWN) == 3
    assert "\u202e" not in text
    assert "\x1b[2J" not in text
