"""The blocks of "Start here", the tutorials and the notebook run, in order, with their output."""

import ast
import json
import math
import os
import re
import shlex
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import pytest

from stixel_cli.cli.app import main

_FENCE = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LOOSE = re.compile(r"…|(?<![\w.])\d+(?:\.\d*(?![\w.…])|(?= cm|°| %))| +")
LANGUAGES = {"sh", "console", "python", "text", "yaml", "diff"}


@dataclass(frozen=True)
class Block:
    language: str
    options: dict[str, str]
    content: str
    before: str
    line: int

    @property
    def file(self) -> str | None:
        return self.options.get("file")


def read_blocks(page: Path) -> list[Block]:
    """Blocks of a page in order, each with the text before it."""
    text = page.read_text(encoding="utf-8")
    blocks, end = [], 0
    for found in _FENCE.finditer(text):
        options = dict(option.split("=", 1) for option in found[2].split())
        line = text.count("\n", 0, found.start()) + 1
        blocks.append(Block(found[1], options, found[3], text[end : found.start()], line))
        end = found.end()
    return blocks


def matches(printed: str, stated: str) -> bool:
    """Whether output matches the page: its texts, and its numbers within their tolerance."""
    pattern, numbers = "", []
    for line in stated.rstrip().splitlines():
        if line.strip() == "…":
            pattern += r"(?:.*\n)*?"
            continue
        texts = _LOOSE.split(line.rstrip())
        pattern += re.escape(texts[0])
        for loose, text in zip(_LOOSE.findall(line.rstrip()), texts[1:], strict=True):
            numbers += [loose] if loose[0].isdigit() else []
            pattern += {"…": ".*", " ": " +"}.get(loose[0], r"(\d+\.?\d*)") + re.escape(text)
        pattern += r" *\n"
    found = re.fullmatch(pattern, "".join(f"{line}\n" for line in printed.rstrip().splitlines()))
    return found is not None and all(
        math.isclose(float(one), float(number), rel_tol=0.1, abs_tol=2.01 * last_digit(number))
        for one, number in zip(found.groups(), numbers, strict=True)
    )


def last_digit(number: str) -> float:
    """What one more in the last digit of a decimal number is: 0.01 of "0.25"."""
    return 10.0 ** -len(number.partition(".")[2])


def apply_diff(path: Path, diff: str) -> None:
    """Apply a diff without line numbers to a file."""
    lines = diff.splitlines()
    assert all(line[:1] in {"", " ", "-", "+"} for line in lines), diff
    old = "".join(f"{line[1:]}\n" for line in lines if not line.startswith("+"))
    new = "".join(f"{line[1:]}\n" for line in lines if not line.startswith("-"))
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{path} has this {text.count(old)} times:\n{old}"
    path.write_text(text.replace(old, new), encoding="utf-8")


def _call(command: str) -> subprocess.CompletedProcess:
    """A command line of stixel in this process: a new one takes seconds to import all."""
    out, errors = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(errors):
        code = main(shlex.split(command)[1:])
    return subprocess.CompletedProcess(command, code, out.getvalue(), errors.getvalue())


class Reader:
    """Runs the blocks of one page in one folder."""

    def __init__(self, folder: Path, environment: dict[str, str]):
        self.folder = folder
        self.environment = os.environ | environment
        self.names: dict = {}
        self.printed = ""

    def follow(self, block: Block) -> None:
        """Run a block; AssertionError if its result differs from the page."""
        if block.file is not None:
            path = self.folder / block.file
            assert f"`{block.file}`" in block.before, f"the text does not name {block.file}"
            if block.language == "diff":
                apply_diff(path, block.content)
            else:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(block.content, encoding="utf-8")
        elif block.language == "sh":
            lines = block.content.strip().splitlines()
            plain = all(line.startswith("stixel ") for line in lines)
            for script in lines if plain else [block.content]:
                done = self._run(script)
                assert done.returncode == 0, done.stdout + done.stderr
        elif block.language == "console":
            self._type(block)
        elif block.language == "python":
            out = StringIO()
            with redirect_stdout(out):
                exec(compile(block.content, f"<line {block.line}>", "exec"), self.names)
            self.printed = out.getvalue()
        else:
            assert block.language == "text", f"a {block.language} block without file="
            assert matches(self.printed, block.content), self.printed

    def _type(self, block: Block) -> None:
        status = int(block.options.get("exit", "0"))
        assert block.content.startswith("$ ")
        for entry in block.content.removeprefix("$ ").split("\n$ "):
            command, _, stated = entry.partition("\n")
            done = self._run(command)
            assert done.returncode == status, f"{command}\n{done.stdout}{done.stderr}"
            shown = done.stderr if status else done.stdout
            if stated.strip():
                assert matches(shown, stated), f"$ {command}\n{shown}"

    def _run(self, script: str) -> subprocess.CompletedProcess:
        if script.startswith("stixel ") and not set(script) & set(";|>&\n"):
            return _call(script)
        return subprocess.run(
            ["bash", "-euo", "pipefail", "-c", script],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=1800,
        )


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
