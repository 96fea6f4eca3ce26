"""Tables, texts and bars on screens of several widths."""

import io

import pytest

from stixel_cli.cli.terminal import print_table, say_wrapped
from stixel_cli.engine.progress import Display

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
