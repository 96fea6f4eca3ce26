"""Results of the user's own code are never those of its older state."""

import json
import os
import time

import numpy as np
import pytest
from own_files import QUICK, THREADS
from own_files import own as own
from run_cli import run_json

from stixel_cli import run
from stixel_cli.cli.app import main
from stixel_cli.engine import loaded_code
from stixel_cli.errors import UserError

KERNEL = """
from numba import njit

import {helper}
from {name}_track import track as base


@njit(cache=True)
def shift(x):
    return {helper}.twice(x) + {helper}.OFFSET


def track(scans, initial, prior):
    made = base(scans, initial, prior)
    made.means[:, 0] = shift(0.0) + shift(1.0)
    return made
"""

HELPER = """
from numba import njit

OFFSET = {offset}


@njit
def twice(x):
    return {factor} * x
"""


@pytest.fixture
def kernel(own):
    """A tracker in compiled code, which calls a function and has a constant of another file."""
    source = own.folder / f"{own.name}.py"
    text = source.read_text().replace("tracker: Parameters", "tracker: Parameters = Parameters()")
    (own.folder / f"{own.name}_track.py").write_text(text)
    source.write_text(KERNEL.format(name=own.name, helper=own.helper))
    own.write_helper = lambda **values: (own.folder / f"{own.helper}.py").write_text(
        HELPER.format(**values)
    )
    own.write_helper(offset=1.0, factor=2.0)
    return own


@pytest.mark.parametrize("executor", ["threads", "local"])
@pytest.mark.workers
def test_compiled_code_follows_an_edit_of_another_file(executor, kernel):
    words = [*QUICK, f"executor={executor}", f"tracker={kernel.name}:track"]
    assert run(words, workers=1).track.means[0, 0] == 4.0
    kernel.write_helper(offset=10.0, factor=3.0)
    assert run(words, workers=1).track.means[0, 0] == 23.0
    folders = list((kernel.folder / "__pycache__").glob("stixel-*"))
    assert len(folders) == 2
    assert all(list(folder.glob("*.nbc")) for folder in folders)


def test_folders_of_old_machine_code_are_removed(kernel):
    old = kernel.folder / "__pycache__" / "stixel-0123456789abcdef"
    old.mkdir(parents=True)
    os.utime(old, 2 * (time.time() - loaded_code.UNUSED - 100,))
    run([*QUICK, THREADS, f"tracker={kernel.name}:track"])
    assert not old.exists()


READER = """
from pathlib import Path

import numpy as np

from {name}_track import track as base

{files}
SHIFT = float(np.load(Path(__file__).with_name("weights.npy")))


def track(scans, initial, prior):
    made = base(scans, initial, prior)
    made.means[:, 0] = SHIFT
    return made
"""


@pytest.fixture
def reader(own):
    """A tracker that reads a file when it is imported."""
    source = own.folder / f"{own.name}.py"
    text = source.read_text().replace("tracker: Parameters", "tracker: Parameters = Parameters()")
    (own.folder / f"{own.name}_track.py").write_text(text)
    own.write = lambda files: source.write_text(READER.format(name=own.name, files=files))
    np.save(own.folder / "weights.npy", 1.0)
    return own


def test_a_declared_file_is_part_of_the_key(reader, capsys):
    reader.write('FILES = ["weights.npy"]')
    words = [*QUICK, THREADS, f"tracker={reader.name}:track"]
    assert run(words).track.means[0, 0] == 1.0
    np.save(reader.folder / "weights.npy", 2.0)
    capsys.readouterr()
    assert main(["explain", *words]) == 0
    assert f"code: {reader.name}/weights.npy changed" in capsys.readouterr().out
    assert run(words).track.means[0, 0] == 2.0
    (reader.folder / "weights.npy").unlink()
    with pytest.raises(UserError, match=r"FILES: .*: weights.npy is missing") as error:
        run(words)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_undeclared_reads_are_named_when_they_are_computed_first(command, reader, capsys):
    reader.write("")
    words = [command, "--results", str(reader.results), *QUICK, THREADS, "executor.workers=1"]
    words += [f"tracker={reader.name}:track"] + (["seed=0,1"] if command == "sweep" else [])
    assert main([*words, "--name", "a"]) == 0
    expected = f"{reader.folder / reader.name}.py, line 9: np.load(…)"
    assert [line for line in capsys.readouterr().err.splitlines() if "FILES" in line] == [
        f'stixel: {expected}: the cache does not notice changes of a file: declare FILES = '
        '["NAME"], or FILES = [] (tutorial 4)'
    ]  # fmt: skip
    assert main([*words, "--name", "b"]) == 0
    assert "FILES" not in capsys.readouterr().err


def test_undeclared_reads_are_not_named_with_json_or_if_files_are_declared(reader, capsys):
    reader.write("")
    words = [*QUICK, THREADS, f"tracker={reader.name}:track"]
    run_json(capsys, reader.results, *words, "--name", "a")
    assert "FILES" not in capsys.readouterr().err
    reader.write("FILES = []")
    assert main(["run", "--results", str(reader.results), *words, "--name", "b"]) == 0
    assert "FILES" not in capsys.readouterr().err
    stages = json.loads((reader.results / "b" / "manifest.json").read_text())["stages"]
    assert [one["status"] for one in stages if one["name"] == "track"] == ["computed"]
