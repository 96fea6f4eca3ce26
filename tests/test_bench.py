"""The scripts of bench/ run: each once, with small inputs, without a look at the times."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[1] / "bench"


@pytest.fixture
def script(tmp_path):
    """Runs a script with small inputs; returns what it prints."""
    pytest.importorskip("pytest_benchmark")
    # pytest-benchmark measures nothing in a worker of xdist, and looks for its variables.
    environment = {key: value for key, value in os.environ.items() if "XDIST" not in key} | {
        "STIXEL_BENCH_SMALL": str(tmp_path),
        "STIXEL_CACHE": str(tmp_path / "cache"),
        "STIXEL_DATA": str(tmp_path / "none"),
    }

    def run(name):
        done = subprocess.run(
            [sys.executable, str(BENCH / name)],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert done.returncode == 0, done.stdout
        return done.stdout

    return run


def sections(page):
    """Titles of the sections without their numbers, which are sizes."""
    return {re.sub(r"\d+", "", line) for line in page.splitlines() if line.startswith("## ")}


def test_the_page_and_every_benchmark(script, tmp_path):
    page = (BENCH.parent / "docs" / "benchmark.md").read_text(encoding="utf-8")
    script("write_page.py")
    small = (tmp_path / "benchmark.md").read_text(encoding="utf-8")
    assert sections(page) <= sections(small)
    assert (BENCH.parent / "docs" / "benchmark.md").read_text(encoding="utf-8") == page


@pytest.mark.parametrize("name", ["bench_objects.py", "occluded_columns.py", "phase_table.py"])
def test_a_script_that_prints_a_table(script, name):
    assert len(script(name).splitlines()) > 4
