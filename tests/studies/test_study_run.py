"""Studies by the real command line: sweeps, derived axes, resuming, failing."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from result_folders import TETRAHEDRON
from study_toy import changed

from stixel_cli.cli.app import main
from stixel_cli.engine import execute as execution
from stixel_cli.engine import keys
from stixel_cli.report.metrics import number
from stixel_cli.studies import run as study_run
from stixel_cli.studies.report import study_page
from stixel_cli.sweeps import run as sweep_run

ONE = ("road_user=car", "seed=0")
"""One scenario of the toy study and one seed: two runs of each sweep."""


def test_a_study_computes_its_sweeps_and_writes_its_report(studies, toy, capsys):
    file = toy()
    answer = studies.run(file)
    folder = studies.results / "toy"
    assert answer["complete"] and answer["report"] == str(folder / "report.html")
    done = {name: sweep["done"] for name, sweep in answer["sweeps"].items()}
    assert done == {"first": 8, "second": 2}
    names = {"study.yaml", "sweeps", "report.html", "tables", "figures", "extra", "report.json"}
    assert {path.name for path in folder.iterdir()} == names
    assert (folder / "extra/note.txt").read_text() == "kept\n"
    (data,) = toy.seen
    first, second = data.sweeps["first"], data.sweeps["second"]
    assert tuple(first.runs[0].setting) == ("tracker", "road_user", "path")
    # The second sweep's axis depends on the number of runs of the first.
    assert [run.setting["tracker.sigma_f"] for run in second.runs] == ["0.1", "8.1"]
    run = first.runs[0]
    scans, track = run.load("scans"), run.load("track")
    assert np.array_equal(scans.times, run.scores.times)
    assert len(track.means) == len(scans)
    with pytest.raises(KeyError):
        run.load("render")
    assert_tables_and_text_have_the_values_of_the_runs(folder, answer)
    # A sweep of a study is a sweep like any other.
    assert main(["sweep", "--resume", str(folder / "sweeps/first")]) == 0
    assert "8 of 8 runs done; nodes: 0 computed" in capsys.readouterr().out


def assert_tables_and_text_have_the_values_of_the_runs(folder, answer):
    runs = pd.read_csv(folder / "sweeps/first/runs.csv")
    means = runs.groupby(["road_user", "tracker"])["iou_mean"].mean()
    tables = {file.name for file in (folder / "tables").iterdir()}
    names = ("trackers-car", "trackers-pedestrian", "widths")
    kinds = ("csv", "md", "tex")
    assert tables == {"own-only.csv", *(f"{name}.{kind}" for name in names for kind in kinds)}
    content = json.loads((folder / "report.json").read_text())
    assert content["answer"] == answer["answer"]
    first, second = answer["answer"]
    for user in ("car", "pedestrian"):
        table = pd.read_csv(folder / f"tables/trackers-{user}.csv")
        assert list(table["metric"]) == ["iou_mean"] * 2 + ["points_of_scans"] * 2
        assert list(table["units"]) == [2] * 4
        found = table[table["metric"] == "iou_mean"].set_index("tracker")["mean"]
        assert found["point"] == pytest.approx(means[user, "point"])
        assert f"{user}: " in first.lower() and f"point {number(found['point'])}" in first
        assert content["questions"]["trackers"][user][1]["mean"] == pytest.approx(found["point"])
    assert first.startswith("<b> IoU. car: ") and second.startswith("By width: ")
    # Two seeds: nothing is claimed.
    assert not re.search("best|differ", first)
    own = pd.read_csv(folder / "tables/own-only.csv")
    assert list(own["a_b <i>"]) == pytest.approx(list(runs["iou_mean"]))


def test_a_second_command_computes_nothing(studies, toy, own_cache):
    words = (toy(), *ONE, "--name", "toy")
    assert studies.run(*words)["nodes"]["computed"] > 0
    folder = studies.results / "toy"
    before = {path: path.read_bytes() for path in (folder / "tables").iterdir()}
    again = studies.run(*words, "--workers", 1)
    assert again["complete"] and again["nodes"]["computed"] == 0
    assert before == {path: path.read_bytes() for path in (folder / "tables").iterdir()}
    # Results other than the scores are only in the store.
    shutil.rmtree(own_cache)
    last = studies.run(*words)
    assert last["complete"] and last["nodes"]["computed"] > 0
    assert len(toy.seen[-1].sweeps["first"].runs[0].load("scans")) == 3
    assert before == {path: path.read_bytes() for path in (folder / "tables").iterdir()}


def test_recomputed_runs_are_reported(studies, toy, monkeypatch):
    file = toy()
    studies.run(file, *ONE)
    assert "computed again" not in studies.error
    monkeypatch.setattr(keys, "LAYOUT", keys.LAYOUT + 1)
    assert studies.run(file, *ONE)["complete"]
    assert "first: 2 of 2 finished runs out of date" in studies.error
    assert "second: 2 of 2 finished runs out of date" in studies.error


def test_a_study_with_failed_runs_can_be_resumed(studies, toy, tmp_path, monkeypatch):
    monkeypatch.setattr(study_run.report, "study_page", study_page)
    mesh = tmp_path / "bad.obj"
    mesh.write_text("this is no mesh\n", encoding="utf-8")
    axes = {"tracker": ["gp_ekf", "point"], "road_user.mesh": [None, str(mesh)]}
    content = changed(("sweeps", "first", "axes"), axes)
    content["questions"]["trackers"]["by"] = ["road_user", "road_user.mesh"]
    file = toy(content)
    answer = studies.run(file, "seed=0", code=1)
    folder = studies.results / "toy-seed=0"
    assert not answer["complete"] and answer["answer"] is None
    assert answer["sweeps"]["first"]["done"] == 4
    # The second sweep's axes depend on the first.
    assert answer["sweeps"]["second"] == {
        "name": "second",
        "runs": None,
        "done": 0,
        "folder": str(folder / "sweeps/second"),
        "faults": ["its axes depend on the sweeps before"],
    }
    assert "no statistics yet: runs are missing: first 4 of 8, second 0 of ?" in studies.error
    command = f"stixel study {file} seed=0 --results {studies.results} --trust-code"
    assert studies.error.endswith(f"{command}\n")
    page = (folder / "report.html").read_text()
    assert "no answer" in page and "bad.obj" in page and command in page
    assert not (folder / "tables").exists() and not toy.seen
    mesh.write_text(TETRAHEDRON.format(1.5), encoding="utf-8")
    answer = studies.run(file, "seed=0")
    assert answer["complete"] and answer["sweeps"]["first"]["done"] == 8
    assert "no answer" not in (folder / "report.html").read_text()


def test_an_interrupted_study_can_be_resumed(studies, toy, monkeypatch, own_cache):
    file = toy()

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(sweep_run, "execute", interrupted)
        assert studies.run(file, *ONE, "--name", "toy", code=130) is None
    assert "interrupted in sweep first" in studies.error
    assert f"resume with: stixel study {file}" in studies.error
    assert sweep_run.execute is execution.execute
    assert studies.run(file, *ONE, "--name", "toy")["complete"]


def test_overrides_replace_values_of_sweeps(studies, toy):
    file = toy()
    plan = studies.run(file, "road_user=car", "path.duration=0.2", "seed=3,4,5", "--dry-run")
    assert plan["sweeps"]["second"] is None
    assert plan["sweeps"]["first"]["runs"] == 2 * 3
    assert plan["sweeps"]["first"]["axes"] == [
        {"keys": ["tracker"], "values": 2},
        {"keys": ["road_user", "path"], "values": 1},
        {"keys": ["seed"], "values": 3},
    ]
    assert not studies.results.exists()


def test_an_override_that_a_sweep_does_not_accept_is_noted(studies, toy, told, monkeypatch):
    monkeypatch.setattr(study_run.report, "study_page", study_page)
    file = toy()
    note = "path=s_curve: left out of sweep first: path: goes together with road_user here: "
    note += "give one of turn, crossing"
    assert studies.run(file, "road_user=car", "--dry-run")["notes"] == []
    assert studies.run(file, "path=s_curve", "seed=0", "--dry-run")["notes"] == [note]
    said = told("study", file, "path=s_curve", "--dry-run", "--trust-code")
    assert said.startswith(f"note: {note}\n")
    assert said.rstrip().rpartition("\n")[2].startswith("all sweeps")
    answer = studies.run(file, "path=s_curve", "seed=0")
    assert answer["notes"] == [note] and studies.error.startswith(f"stixel: {note}\n")
    assert note in Path(answer["report"]).read_text()


def test_an_invalid_study_is_reported_before_all_runs_and_stops_no_other(studies, toy, monkeypatch):
    good, bad = toy(name="good"), toy("title: x\n", name="bad")
    told = []
    monkeypatch.setattr("stixel_cli.cli.study.STUDIES", [str(bad), str(good)])
    monkeypatch.setattr("stixel_cli.cli.study.tell", told.append)
    run = study_run.Study.run
    monkeypatch.setattr(study_run.Study, "run", lambda *a: told.append("runs") or run(*a))
    answer = studies.run("all", "road_user=car", "seed=0", code=2)
    assert [one["complete"] for one in answer["studies"]] == [False, True]
    assert "bad.yaml: question: is missing" in told[0] and told[1] == "runs"


def test_a_study_outside_the_package(studies, toy, tmp_path, monkeypatch, capsys):
    file = toy()
    answer = studies.run(file, "road_user=car", "seed=0")
    assert answer["complete"]
    # A result folder's commands never import the module that made its report.
    (tmp_path / "toy.py").write_text("raise SystemExit('imported')\n", encoding="utf-8")
    folder = Path(answer["folder"])
    monkeypatch.chdir(folder)
    for command in (["ls", str(folder / "sweeps/first")], ["ls", str(studies.results)]):
        assert main(command) == 0
        assert "imported" not in capsys.readouterr().err
