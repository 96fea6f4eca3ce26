"""The cells of the notebook run, in order, and the last value of each can be shown."""

import ast
import json
from pathlib import Path

import pytest

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
