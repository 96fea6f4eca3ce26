"""Text on a terminal: tables of several widths, and text of others that never controls it."""

import io
import json
import sys

import pytest
import yaml

from stixel_cli.cli.app import main
from stixel_cli.cli.terminal import escaping, print_table, say_wrapped
from stixel_cli.engine.progress import Display
from stixel_cli.errors import escaped

PATH = "results/a-folder-with-a-very-long-name-20260101-120000"
COLUMNS = ("folder", "changed settings", "mean IoU", "centre RMSE")
ROWS = [(PATH, "car turn fabricated with many words", "0.792", "0.211"), ("b", "", "0.8", "1")]


def printed(capsys, monkeypatch, width, **options):
    monkeypatch.setenv("COLUMNS", str(width))
    print_table(COLUMNS, ROWS, right=(2, 3), **options)
    return capsys.readouterr().out


@pytest.mark.parametrize("width", [60, 80, 100, 120])
def test_a_table_breaks_no_word_and_fits_if_its_words_do(capsys, monkeypatch, width):
    text = printed(capsys, monkeypatch, width, leave_out=(3, 2))
    assert {"car", "turn", "fabricated", "with", "many", "words", PATH} <= set(text.split())
    longest = max(map(len, text.splitlines()))
    assert longest <= width or width == 60


def test_columns_are_left_out_in_order_and_named(capsys, monkeypatch):
    wide = printed(capsys, monkeypatch, 200, leave_out=(3, 2))
    assert "0.211" in wide and "Not shown" not in wide
    less = printed(capsys, monkeypatch, 85, leave_out=(3, 2))
    assert "0.792" in less and "0.211" not in less
    assert less.rstrip().endswith("Not shown on a screen of 85 columns: centre RMSE")
    least = printed(capsys, monkeypatch, 70, leave_out=(3, 2))
    assert "0.792" not in least
    assert "columns: mean IoU; centre RMSE" in " ".join(least.split())


def test_a_text_is_wrapped_and_its_path_stays_whole(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    say_wrapped(f"the results are in the folder {PATH} [not markup]")
    lines = capsys.readouterr().out.splitlines()
    assert PATH in lines and lines[0] == "the results are in the folder"
    assert lines[-1] == "[not markup]"


def test_a_bar_cuts_its_text_only(monkeypatch):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("TERM", "dumb-but-wide")
    monkeypatch.setenv("COLUMNS", "60")
    bar = Display()
    bar.show(0.42, "about 4 min left; " + "render 80/100 frames, " * 5)
    bar.close()
    shown = terminal.getvalue().replace("\r", "\n").splitlines()
    (line,) = {line for line in shown if "left" in line}
    assert " 42%" in line and "0:00:0" in line and "about 4 min left" in line and "…" in line


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


def test_escaping_keeps_lines_letters_and_the_styles_of_a_terminal(monkeypatch):
    text = "Größe ±\u00a0µ 漢\n\tend"
    assert escaped(text) == text
    assert escaped(STRANGE) == f"{SHOWN}\\r\\x07"

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
