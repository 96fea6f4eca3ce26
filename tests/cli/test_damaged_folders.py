"""Folders that others made, damaged in every way: one line that names the file, exit code 2."""

import json
import os
import shutil
from pathlib import Path

import pytest
import yaml

from stixel_cli.cli.app import main

FEW = ("measurement=fabricated", "path.duration=0.3")
DEEP = 100_000
BOMB = "a0: &a0 [x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10)
)


def text(content):
    """Damage: other content in a file."""

    def damage(file):
        file.unlink()
        file.write_bytes(content if isinstance(content, bytes) else content.encode())

    return damage


def fifo(file):
    file.unlink()
    os.mkfifo(file)


def device(file):
    file.unlink()
    file.symlink_to("/dev/zero")


def folder(file):
    file.unlink()
    file.mkdir()


def circle(file):
    file.unlink()
    file.symlink_to(file.name)


def huge(file):
    with file.open("r+b") as stream:
        stream.truncate(2**30 + 1)


def cut(file):
    file.write_bytes(file.read_bytes()[:-40])


def value(name, new):
    """Damage: another value in a JSON or YAML file; None takes it away."""

    def damage(file):
        if file.suffix == ".json":
            content = json.loads(file.read_text())
        else:
            content = yaml.safe_load(file.read_text())
        if new is None:
            del content[name]
        else:
            content[name] = new
        file.write_text(json.dumps(content))  # JSON is YAML.

    return damage


NO_FILES = {"fifo": fifo, "device": device, "folder": folder, "huge": huge}
YAMLS = {
    **NO_FILES,
    "brackets": text("[" * DEEP),
    "bomb": text(BOMB),
    "itself": text("a: &a [*a]"),
    "python": text("!!python/object/apply:os.getcwd []"),
    "list": text("[1]"),
    "empty": text(""),
    "keys": text("{1: 2, null: 3}"),
}
"""What no reader takes, see `test_files.py`, and what only the checks after it refuse."""

JSONS = {
    **NO_FILES,
    "brackets": text("[" * DEEP),
    "infinite": text('{"a": 1e400}'),
    "list": text("[1]"),
    "empty": text(""),
}
RUN = {
    "config.yaml": YAMLS,
    "manifest.json": JSONS,
    "metrics.json": JSONS | {"text": value("centre_rmse_m", "x"), "true": value("scans", True)},
    "scores.npz": NO_FILES | {"cut": cut, "text": text("nothing")},
    "lineage.json": JSONS | {"stages": text('{"stages": 3, "code": 4}')},
}
READS = {
    "ls": ("config.yaml", "manifest.json", "metrics.json"),
    "report": ("config.yaml", "manifest.json", "metrics.json", "scores.npz"),
    "explain": ("config.yaml", "manifest.json", "metrics.json", "lineage.json"),
    "run": ("config.yaml", "manifest.json", "metrics.json", "lineage.json"),
    "report --play": ("config.yaml", "manifest.json", "metrics.json", "lineage.json"),
    "verify": ("config.yaml", "manifest.json", "metrics.json", "lineage.json", "scores.npz"),
}
"""What each command reads of a run's folder."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a run, a sweep of two runs, and their cache; not to be changed."""
    root = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(root / "cache"))
        results = ["--results", str(root / "results")]
        assert main(["run", *FEW, *results, "--name", "run"]) == 0
        assert main(["sweep", *FEW, "seed=0,1", *results, "--name", "sweep"]) == 0
    return root


@pytest.fixture
def results(made, tmp_path, monkeypatch):
    """A copy of them, to be damaged."""
    monkeypatch.setenv("STIXEL_CACHE", str(made / "cache"))
    copy = Path(shutil.copytree(made / "results", tmp_path / "results"))
    shutil.copytree(copy / "run", copy / "whole")
    monkeypatch.chdir(tmp_path)
    return copy


def one_line(capsys, *words):
    """The one line of a command that is refused."""
    capsys.readouterr()
    assert main(list(map(str, words))) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("stixel: ")
    assert said.err.count("\n") == 1
    assert "Traceback" not in said.err
    assert "defect" not in said.err
    assert len(said.err) < 500
    return said.err


USUAL = {"fifo", "list"}
"""What no reader opens, and what one reads: the others of each file are those of `verify`."""

CASES = [
    (command, name, kind)
    for command, names in READS.items()
    for name in names
    for kind in RUN[name]
    if command == "verify" or kind in USUAL or kind not in YAMLS | JSONS
]


@pytest.mark.parametrize(("command", "name", "kind"), CASES)
def test_a_run_is_refused(results, capsys, command, name, kind):
    RUN[name][kind](results / "run" / name)
    words = [results / "whole"] if command == "report" else []
    before = sorted(results.rglob("*"))
    said = one_line(capsys, *command.split(), results / "run", *words)
    assert Path(name).name in said
    assert str(results / "run") in said
    assert sorted(results.rglob("*")) == before


def test_a_run_with_removed_keys_is_read_and_not_computed_again(results, capsys):
    run, file = results / "run", results / "run" / "config.yaml"
    content = yaml.safe_load(file.read_text(encoding="utf-8"))
    content["tracker"]["contour_points"] = 120
    file.write_text(yaml.safe_dump(content | {"pace": {"speed": 5.0}}), encoding="utf-8")
    both = [run, results / "whole"]
    for words in (["ls", run], ["ls", results], ["ls", *both], ["report", *both]):
        assert main(list(map(str, words))) == 0
    for command in ("run", "verify"):
        assert "is no key of this version" in one_line(capsys, command, run)


@pytest.mark.parametrize("name", ["manifest.json", "metrics.json"])
@pytest.mark.parametrize("kind", [*sorted(USUAL), "circle"])
def test_ls_names_it_and_lists_the_others(results, capsys, name, kind):
    (circle if kind == "circle" else JSONS[kind])(results / "run" / name)
    capsys.readouterr()
    assert main(["ls", str(results)]) == 0
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert name in said.err
    assert all(f"\n{one} " in said.out for one in ("run", "sweep", "whole"))
    assert main(["ls", str(results), "--json"]) == 0
    listed = {Path(one["path"]).name: one for one in json.loads(capsys.readouterr().out)}
    assert listed["run"]["fault"] is not None
    assert listed["whole"]["fault"] is None


ASKED = YAMLS | {
    "axis": value("axes", [["seed"], ["path.speed"]]),
    "axes": value("axes", 3),
    "no axes": value("axes", None),
    "runs": value("runs", [["seed=0"], [3]]),
    "no runs": value("runs", []),
    "odd run": value("runs", [["[" * 1000 + "=seed=", "seed=0"]]),
    "nodes": value("nodes", 3),
    "pictures": value("pictures", 1),
}


@pytest.mark.parametrize("kind", ASKED)
@pytest.mark.parametrize("words", [["ls"], ["explain"], ["sweep", "--resume"]])
def test_a_sweep_is_refused(results, capsys, words, kind):
    ASKED[kind](results / "sweep" / "sweep.yaml")
    before = sorted(results.rglob("*"))
    if kind == "odd run" and words == ["ls"]:
        return  # `stixel ls` does not compose the runs.
    said = one_line(capsys, *words, results / "sweep")
    assert "sweep.yaml" in said or kind == "odd run"
    assert sorted(results.rglob("*")) == before


@pytest.mark.parametrize("kind", [*NO_FILES, "binary", "field"])
def test_a_damaged_table_of_a_sweep_is_not_read(results, capsys, kind):
    damages = NO_FILES | {"binary": text(b"\xff"), "field": text('a,"b\n' + "x" * 200_000)}
    damages[kind](results / "sweep" / "runs.csv")
    capsys.readouterr()
    assert main(["ls", str(results / "sweep")]) == 0
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        *(("metrics.json", kind) for kind in sorted(USUAL)),
        ("manifest.json", "list"),
        ("lineage.json", "list"),
    ],
)
def test_a_damaged_run_is_recomputed(results, capsys, name, kind):
    JSONS[kind](results / "sweep/runs/0001" / name)
    capsys.readouterr()
    assert main(["sweep", "--resume", str(results / "sweep"), "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["complete"]
    assert "Traceback" not in said.err


@pytest.mark.parametrize("kind", YAMLS)
@pytest.mark.parametrize("words", [["sweep", "--from"], ["explain", "--from"], ["study"]])
def test_a_file_of_the_user_is_refused(tmp_path, capsys, monkeypatch, words, kind):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "mine.yaml"
    file.write_text("axes: {seed: [0, 1]}\n")
    YAMLS[kind](file)
    before = os.listdir(tmp_path)
    if kind == "empty" and words[0] == "explain":
        return  # It explains the one run of no axes.
    said = one_line(capsys, *words, "mine.yaml")
    assert "mine.yaml" in said or "nothing to sweep" in said
    assert os.listdir(tmp_path) == before


@pytest.mark.parametrize("kind", sorted(USUAL))
def test_a_folder_of_a_study_is_refused(tmp_path, capsys, monkeypatch, kind):
    file = tmp_path / "results/mine/study.yaml"
    file.parent.mkdir(parents=True)
    file.write_text("")
    YAMLS[kind](file)
    monkeypatch.chdir(tmp_path)
    few = ("road_user=car", "path=turn", "tracker=gp_ekf")
    assert "mine" in one_line(capsys, "study", "rq2", *few, "--name", "mine")
    assert os.listdir(file.parent) == ["study.yaml"]
