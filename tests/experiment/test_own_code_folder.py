"""What a run's folder says of the user's code; no result is that of an older state of it."""

import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from own_files import QUICK, THREADS
from own_files import own as own
from refusals import refused
from run_cli import run_json

from stixel_cli import compose, run
from stixel_cli.border.own_code import all_values
from stixel_cli.cli.app import main
from stixel_cli.engine import loaded_code
from stixel_cli.results import lineage


@pytest.fixture
def words(own):
    return [*QUICK, THREADS, f"tracker={own.name}:track"]


def folder_of(own, name, *words):
    assert main(["run", "--results", str(own.results), "--name", name, *words]) == 0
    return own.results / name


def test_explain_compares_a_folder_with_its_own_code(own, words, told):
    folder = folder_of(own, "a", *words)
    helper = own.folder / f"{own.helper}.py"
    helper.write_text("OFFSET = 2.0\n")
    folder_of(own, "b", *words)
    said = "nothing to recompute: all results are cached"
    assert told("explain", folder) == f"{said}; the folder has results of other code or files\n"
    for remove in (False, True):
        helper.write_text("OFFSET = 3.0\n")
        answer = told("explain", folder)
        assert f"track: code: {own.helper} changed" in answer
        if not remove:
            # Without the folder's results in the cache, its lineage says the same.
            remove_results(folder)


def remove_results(folder):
    stages = json.loads((folder / "lineage.json").read_text())["stages"]
    for key in stages["track"]["keys"]:
        (entry,) = Path(os.environ["STIXEL_CACHE"]).glob(f"*/{key}")
        shutil.rmtree(entry)


@pytest.mark.parametrize("text", ["def (", 'FILES = ["nothing.npz"]\n'])
def test_code_that_is_no_longer_valid_is_one_line(text, own, words, told):
    folder = folder_of(own, "a", *words)
    (own.folder / f"{own.helper}.py").write_text(text)
    (line,) = told("explain", folder, code=2).splitlines()
    assert f"{own.helper}.py" in line and "internal" not in line


def test_all_values_of_parameters_are_stored_and_compared(own, words, capsys, told):
    one = folder_of(own, "one", *words)
    other = folder_of(own, "other", *words, "tracker.mode=far")
    stored = yaml.safe_load((one / "config.yaml").read_text())["tracker"]
    assert stored == {"kind": "own", "function": f"{own.name}:track", "alpha": 0.5, "mode": "near"}
    assert "tracker.mode   near   far" in told("ls", one, other)
    # The typed default is the same setting.
    again = run_json(capsys, own.results, *words, "tracker.alpha=0.5", "--name", "c")
    assert {stage["status"] for stage in again["stages"]} == {"cached"}


def test_defaults_that_a_yaml_file_cannot_have_are_left_out():
    def plain(scans, alpha=0.5, pair=(1, 2), array=object(), text="a"):  # noqa: B008
        pass

    assert all_values(plain, 1, {"alpha": 0.2}) == {"alpha": 0.2, "text": "a"}


def test_the_modules_are_stored_and_others_are_named(own, words, capsys):
    folder = folder_of(own, "a", *words)
    source = own.folder / f"{own.name}.py"
    assert (folder / "code" / f"{own.name}.py").read_bytes() == source.read_bytes()
    assert (folder / "code" / f"{own.helper}.py").read_text() == "OFFSET = 1.0\n"
    names = {file.name for file in (folder / "code").iterdir()}
    assert names == {f"{own.name}.py", f"{own.helper}.py"}
    for command in (["verify"], ["run", "--results", str(own.results)]):
        (own.folder / f"{own.helper}.py").write_text("OFFSET = 1.0\n")
        capsys.readouterr()
        assert main([*command, str(folder), "--trust-code"]) == 0
        assert "/code" not in capsys.readouterr().err
        (own.folder / f"{own.helper}.py").write_text("OFFSET = 4.0\n")
        assert main([*command, str(folder), "--trust-code"]) == (command == ["verify"])
        lines = [line for line in capsys.readouterr().err.splitlines() if "/code" in line]
        assert lines == [f"stixel: {own.helper}: is not as in {folder / 'code'}: today's is used"]


def test_a_sweep_keeps_the_values_of_its_runs_and_the_modules_once(own, words, capsys):
    line = ["sweep", "--results", str(own.results), "--name", "s", *words, "seed=0,1"]
    assert main(line) == 0
    request = yaml.safe_load((own.results / "s" / "sweep.yaml").read_text())
    assert {"tracker.alpha=0.5", "tracker.mode=near"} <= set(request["runs"][0])
    for value in (1.0, 2.0):
        (own.folder / f"{own.helper}.py").write_text(f"OFFSET = {value}\n")
        assert main(["sweep", "--resume", str(own.results / "s"), "--trust-code"]) == 0
        assert ("out of date" in capsys.readouterr().err) == (value == 2.0)
        (copy,) = (own.results / "s" / "code").glob(f"*/{own.helper}.py")
        assert copy.read_text() == f"OFFSET = {value}\n"


def test_verify_names_the_edited_module_where_the_folder_knows_its_code(own, words, told):
    def verified(folder, code):
        return json.loads(told("verify", folder, "--cached", "--json", "--trust-code", code=code))

    assert main(["sweep", "--results", str(own.results), "--name", "s", *words, "seed=0,1"]) == 0
    run, helper = own.results / "s/runs/0001", own.folder / f"{own.helper}.py"
    # Outside its sweep's folder a run has keys but no code digests.
    alone = shutil.copytree(run, own.results / "alone/run")
    helper.write_text("OFFSET = 1.0\nUNUSED = 1\n")
    edit = [f"{own.helper} was edited"]
    assert verified(run, 0)["first_by_key"]["causes"] == edit
    helper.write_text("OFFSET = 2.0\n")
    found = verified(run, 1)
    assert found["first_by_key"]["stage"] == found["first_by_value"]["stage"] == "track"
    assert found["first_by_value"]["causes"] == edit
    assert "values differ, by up to" in found["first_by_value"]["what"]
    assert "metrics.json" in {file["file"] for file in found["files"]}
    first = verified(alone, 1)["first_by_value"]
    assert first["stage"] == "track"
    assert first["causes"][0].startswith("unknown code changes: the folder")


def test_the_repository_of_a_module_is_stored_with_its_changes(own, words, monkeypatch):
    def git(*arguments):
        line = ["git", "-C", str(own.folder), "-c", "user.name=a", "-c", "user.email=a", *arguments]
        return subprocess.run(line, check=True, capture_output=True, text=True).stdout.strip()

    git("init", "-q")
    git("add", f"{own.helper}.py")
    git("commit", "-q", "-m", "first")
    (own.folder / f"{own.helper}.py").write_text("OFFSET = 9.0\n")
    text = (folder_of(own, "a", *words) / "code" / "mine.diff").read_text()
    assert text.startswith(f"revision {git('rev-parse', 'HEAD')}\n")
    assert "-OFFSET = 1.0\n+OFFSET = 9.0\n" in text
    (own.folder / f"{own.helper}.py").write_text("OFFSET = 1.0\n")
    assert "OFFSET" not in (folder_of(own, "b", *words) / "code" / "mine.diff").read_text()
    file = own.folder / "changes.diff"
    file.write_text(text)
    git("apply", "changes.diff")
    assert (own.folder / f"{own.helper}.py").read_text() == "OFFSET = 9.0\n"
    monkeypatch.setattr(lineage, "LARGEST_DIFFERENCE", 10)
    text = (folder_of(own, "c", *words) / "code" / "mine.diff").read_text()
    assert "are left out" in text and "OFFSET" not in text


def test_describe_explains_the_parameters_of_the_users_function(own, told):
    answer = told("describe", f"tracker={own.name}:track")
    assert "tracker.alpha" in answer and "0.5" in answer and "a number > 0 and ≤ 1" in answer
    assert "one of near, far" in answer
    assert "tracker.alpha" in told("describe", f"tracker={own.name}:plain")
    answer = told("describe", f"measurement={own.name}:dots")
    assert "measurement.spread" in answer and "0.1" in answer
    assert "has no function nothing" in told("describe", f"tracker={own.name}:nothing", code=2)
    assert compose([f"tracker={own.name}:track"]).value("tracker.mode") == "near"


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
    helper = own.folder / f"{own.helper}.py"
    own.write_helper = lambda **values: helper.write_text(HELPER.format(**values))
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


def test_a_declared_file_is_part_of_the_key(reader, told):
    reader.write('FILES = ["weights.npy"]')
    words = [*QUICK, THREADS, f"tracker={reader.name}:track"]
    assert run(words).track.means[0, 0] == 1.0
    np.save(reader.folder / "weights.npy", 2.0)
    assert f"code: {reader.name}/weights.npy changed" in told("explain", *words)
    assert run(words).track.means[0, 0] == 2.0
    (reader.folder / "weights.npy").unlink()
    with refused(match=r"FILES: .*: weights.npy is missing"):
        run(words)


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_undeclared_reads_are_named_when_they_are_computed_first(command, reader, capsys):
    reader.write("")
    words = [command, "--results", str(reader.results), *QUICK, THREADS, "executor.workers=1"]
    words += [f"tracker={reader.name}:track"] + (["seed=0,1"] if command == "sweep" else [])
    assert main([*words, "--name", "a"]) == 0
    expected = f"{reader.folder / reader.name}.py, line 9: np.load(…)"
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "FILES" in line]
    assert line.startswith(f"stixel: {expected}: the cache does not notice changes of a file: ")
    assert line.endswith(': declare FILES = ["NAME"], or FILES = [] (tutorial 4)')
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
