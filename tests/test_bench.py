"""The scripts of bench/ run: each once, with small inputs, without a look at the times."""

import os
import re
import runpy
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import pytest
from real_data import real_data

BENCH = Path(__file__).parents[1] / "bench"


def sections(page):
    """Titles of the sections without their numbers, which are sizes."""
    return {re.sub(r"\d+", "", line) for line in page.splitlines() if line.startswith("## ")}


@pytest.fixture
def script(tmp_path, monkeypatch):
    """Runs a script of bench/, small, in this process, which has imported most of what it needs."""
    # pytest-benchmark measures nothing in a worker of xdist, and looks for its variables.
    for name in [name for name in os.environ if "XDIST" in name]:
        monkeypatch.delenv(name)
    # What the cases of a benchmark do is the same: their sizes and names differ.
    monkeypatch.setenv("PYTEST_PLUGINS", "one_of_each")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)
    monkeypatch.setenv("STIXEL_BENCH_SMALL", str(tmp_path))
    monkeypatch.setenv("STIXEL_DATA", str(tmp_path / "none"))
    monkeypatch.syspath_prepend(BENCH)

    def run(name):
        monkeypatch.setattr(sys, "argv", [name])
        before = set(sys.modules)
        runpy.run_path(str(BENCH / f"{name}.py"), run_name="__main__")
        for module in {file.stem for file in BENCH.glob("*.py")} - before:
            sys.modules.pop(module, None)

    return run


def test_the_page_and_every_benchmark(script, tmp_path, monkeypatch, capfd):
    pytest.importorskip("pytest_benchmark")
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    page = (BENCH.parent / "docs" / "benchmark.md").read_text(encoding="utf-8")
    try:
        script("write_page")
    except subprocess.CalledProcessError:
        pytest.fail(capfd.readouterr().out, pytrace=False)
    small = (tmp_path / "benchmark.md").read_text(encoding="utf-8")
    # Without figures the page has no sections.
    assert sections(page) in (set(), sections(small))
    assert (BENCH.parent / "docs" / "benchmark.md").read_text(encoding="utf-8") == page


# The table of `phase_table.py` is on the page.
@pytest.mark.parametrize("name", ["bench_objects", "occluded_columns"])
def test_a_script_that_prints_a_table(name, script, capsys):
    script(name)
    assert len(capsys.readouterr().out.splitlines()) >= 4


def test_every_pair_of_the_scores_can_be_assessed(monkeypatch, capsys):
    """Its overrides are valid; nothing is computed."""
    monkeypatch.setenv("STIXEL_DATA", str(real_data("kitti2012_more").parent))
    monkeypatch.setattr(sys, "argv", ["pair_scores"])
    main = runpy.run_path(str(BENCH / "pair_scores.py"))["main"]
    found = []

    def assessed(composition, progress):
        found.append(composition.configuration.source.disparity)
        return SimpleNamespace(values=defaultdict(lambda: 0.1 * len(found)))

    monkeypatch.setitem(main.__globals__, "assess", assessed)
    main()
    assert len(set(found)) == 4
    assert capsys.readouterr().out.count("000000") == 2
