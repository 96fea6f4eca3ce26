"""The blocks of "Start here", the tutorials and the notebook run, in order, with their output."""

import ast
import json
import os
import sys
from pathlib import Path

import pytest
from tutorial_blocks import LANGUAGES, Reader, apply_diff, matches, read_blocks

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "docs" / "README.md", *sorted((ROOT / "docs" / "tutorials").glob("*.md"))]
DRAWN = ("1_first_run", "5_results_in_python")
"""Those whose blocks show pictures of runs, or their stage."""


def test_they_are_in_order():
    assert [page.name[:2] for page in PAGES] == ["RE", "1_", "2_", "3_", "4_", "5_", "6_", "7_"]


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=page.stem, marks=[pytest.mark.sketched] if page.stem in DRAWN else [])
        for page in PAGES
    ],
)
def test_tutorial(page, tmp_path, monkeypatch):
    folder = tmp_path / "work"
    folder.mkdir()
    scripts = str(Path(sys.executable).parent)
    environment = {
        "COLUMNS": "100",
        "MPLBACKEND": "Agg",
        "PATH": os.pathsep.join([scripts, os.environ["PATH"]]),
        "STIXEL_CACHE": str(tmp_path / "cache"),
    }
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(folder)
    reader = Reader(folder, environment)
    blocks = read_blocks(page)
    assert blocks
    for block in blocks:
        assert block.language in LANGUAGES, f"line {block.line}: {block.language}"
        try:
            reader.follow(block)
        except AssertionError as error:
            pytest.fail(f"{page.name}, the block at line {block.line}: {error}", pytrace=False)


def test_output_is_compared():
    assert matches("a 0.25 m  \nb\nc\n", "a 0.2… m\n…\nc")
    assert matches("a\n", "…\na\n…\n")
    assert matches("a 0.26 m   \n", "a  0.25 m")
    assert matches("a 12.9 m\n", "a 12.0 m")
    assert matches("a 9 cm, 90 %\n", "a 8 cm, 99 %")
    assert not matches("a 11 cm\n", "a 8 cm")
    assert not matches("a 9 of 9\n", "a 8 of 9")
    assert not matches("a 0.35 m\n", "a 0.25 m")
    assert not matches("13 nodes of 0.2.1\n", "12 nodes of 0.2.1")
    assert not matches("a 0.35 m\n", "a 0.2… m")
    assert not matches("a\nb\n", "a")
    assert not matches("", "a")


def test_diff_applies_once(tmp_path):
    file = tmp_path / "file"
    file.write_text("one\ntwo\ntwo\nthree\n")
    apply_diff(file, " one\n-two\n+2\n")
    assert file.read_text() == "one\n2\ntwo\nthree\n"
    with pytest.raises(AssertionError, match="0 times"):
        apply_diff(file, " two\n+and\n four\n")


NOTEBOOKS = sorted((Path(__file__).parents[2] / "examples").glob("*.ipynb"))


def run_cell(source: str, names: dict):
    """Run a cell as a notebook does, and give the value of its last expression, or None."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "<cell>", "exec"), names)
    return (
        None if last is None else eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)
    )


def test_there_is_one():
    assert [path.name for path in NOTEBOOKS] == ["first_run.ipynb"]


@pytest.mark.sketched
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    names: dict = {}
    shown = []
    for cell in notebook["cells"]:
        assert cell["id"] and cell["source"]
        if cell["cell_type"] == "code":
            shown.append(run_cell("".join(cell["source"]), names))
            # It is read on pages that run nothing.
            assert cell["outputs"] and cell["execution_count"] == len(shown), "ship the outputs"
            kinds = {kind for output in cell["outputs"] for kind in output.get("data", ())}
            if hasattr(shown[-1], "savefig"):
                assert shown[-1]._repr_png_().startswith(b"\x89PNG") and "image/png" in kinds
            elif hasattr(shown[-1], "_repr_html_"):
                assert "text/html" in kinds
    assert "data:image/png" in shown[0]._repr_html_()
    assert any(hasattr(value, "axes") for value in shown), "a figure"
    assert "rig.width" in capsys.readouterr().out
    assert [file.name for file in tmp_path.iterdir()] == ["cache"], "nothing is written"
