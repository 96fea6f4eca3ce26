"""Parse and run the fenced blocks of a tutorial.

    ```sh                  bash script that must succeed
    ```console             `$ command` and its stdout
    ```console exit=2      `$ command` that exits with 2, and its stderr
    ```python              runs in the namespace of the page's earlier Python blocks
    ```text                stdout of the Python block before
    ```LANGUAGE file=PATH  file that the reader saves
    ```diff file=PATH      edit of a file: its lines without `+` occur once in the file, together

In output, `…` matches any text within a line; on a line of its own it matches any lines. A number
with a decimal point, or before cm, ° or %, may differ by a tenth or by two of its last digit.
Several spaces are as one.
"""

import math
import os
import re
import shlex
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

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
