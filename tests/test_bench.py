"""The scripts of bench/ run: each once, with small inputs, without a look at the times."""

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[1] / "bench"


def sections(page):
    """Titles of the sections without their numbers, which are sizes."""
    return {re.sub(r"\d+", "", line) for line in page.splitlines() if line.startswith("## ")}


def test_the_page_and_every_benchmark(tmp_path):
    pytest.importorskip("pytest_benchmark")
    page = (BENCH.parent / "docs" / "benchmark.md").read_text(encoding="utf-8")
    # pytest-benchmark measures nothing in a worker of xdist, and looks for its variables.
    environment = {key: value for key, value in os.environ.items() if "XDIST" not in key} | {
        "STIXEL_BENCH_SMALL": str(tmp_path),
        "STIXEL_CACHE": str(tmp_path / "cache"),
        "STIXEL_DATA": str(tmp_path / "none"),
        # What the cases of a benchmark do is the same: their sizes and names differ.
        "PYTEST_PLUGINS": "one_of_each",
        "PYTHONPATH": os.pathsep.join(
            [str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
        ),
    }
    done = subprocess.run(
        [sys.executable, str(BENCH / "write_page.py")],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    small = (tmp_path / "benchmark.md").read_text(encoding="utf-8")
    assert sections(page) <= sections(small)
    assert (BENCH.parent / "docs" / "benchmark.md").read_text(encoding="utf-8") == page


# The table of `phase_table.py` is on the page.
@pytest.mark.parametrize("name", ["bench_objects", "occluded_columns"])
def test_a_script_that_prints_a_table(name, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STIXEL_BENCH_SMALL", str(tmp_path))
    monkeypatch.setenv("STIXEL_DATA", str(tmp_path / "none"))
    monkeypatch.setattr(sys, "argv", [name])
    monkeypatch.syspath_prepend(BENCH)
    before = set(sys.modules)
    runpy.run_path(str(BENCH / f"{name}.py"), run_name="__main__")
    for module in {file.stem for file in BENCH.glob("*.py")} - before:
        sys.modules.pop(module, None)
    assert len(capsys.readouterr().out.splitlines()) >= 4
