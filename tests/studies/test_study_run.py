"""Studies by the real command line: sweeps, derived axes, going on, refusing."""

import csv
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from study_toy import changed

from stixel_cli.cli.app import main
from stixel_cli.engine import execute as execution
from stixel_cli.engine import keys
from stixel_cli.studies import run as study_run
from stixel_cli.studies.file import read_study
from stixel_cli.studies.folder import differences
from stixel_cli.studies.plan import StudyPlan
from stixel_cli.sweeps import run as sweep_run


def test_a_study_from_its_file_to_its_report(studies, toy):
    file = toy()
    answer = studies.run(file)
    folder = studies.results / "toy"
    assert answer["complete"] and answer["answer"] == ["4 runs <b>."]
    assert answer["report"] == str(folder / "report.html")
    assert {name: sweep["done"] for name, sweep in answer["sweeps"].items()} == {
        "first": 4,
        "second": 2,
    }
    assert {path.name for path in folder.iterdir()} == {
        "study.yaml",
        "sweeps",
        "report.html",
        "tables",
        "figures",
        "extra",
    }
    assert (folder / "extra/note.txt").read_text() == "kept\n"
    (data,) = toy.seen
    first, second = data.sweeps["first"], data.sweeps["second"]
    assert (data.name, data.title) == ("toy", "A <toy> & its title")
    assert first.keys == ("road_user", "path", "seed")
    assert [(p.setting["road_user"], p.seed) for p in first.runs] == [
        ("car", 0),
        ("car", 1),
        ("pedestrian", 0),
        ("pedestrian", 1),
    ]
    # The second sweep's axis follows from how many points the first has.
    assert [p.setting for p in second.runs] == [
        {"tracker.sigma_f": "0.1"},
        {"tracker.sigma_f": "4.1"},
    ]
    point = first.runs[0]
    assert point.configuration.road_user.kind == "car"
    scans, track = point.load("scans"), point.load("track")
    assert np.array_equal(scans.times, point.scores.times)
    assert len(track.means) == len(scans)
    assert {"scenario", "scans", "track", "scores"} <= set(point.cpu_seconds)
    assert all(seconds >= 0.0 for seconds in point.cpu_seconds.values())
    with pytest.raises(KeyError):
        point.load("render")


def test_the_tables_hold_what_was_computed(studies, toy, capsys):
    studies.run(toy())
    folder = studies.results / "toy"
    with (folder / "sweeps/first/runs.csv").open(encoding="utf-8") as file:
        runs = list(csv.DictReader(file))
    assert (folder / "tables/answer.csv").read_text() == "who,seed\ncar,7\n"
    with (folder / "tables/numbers.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["IoU"] for row in rows] == [run["iou_mean"] for run in runs]
    assert [row["± IoU"] for row in rows] == ["0.25"] * 4
    shown = f"{float(runs[0]['iou_mean']):.2f} ± 0.25"
    assert shown in (folder / "tables/numbers.md").read_text()
    latex = (folder / "tables/numbers.tex").read_text()
    assert r"50 \% of a\_b." in latex and shown.replace("±", r"$\pm$") in latex
    assert "| – | 1.50 |\n| x\\|y | – |" in (folder / "tables/gaps.md").read_text()
    assert (folder / "tables/gaps.csv").read_text() == "a,b\n,1.5\nx|y,\n"
    # A sweep of a study is a sweep like any other.
    assert main(["sweep", "--resume", str(folder / "sweeps/first")]) == 0
    assert "4 of 4 runs done; nodes: 0 computed" in capsys.readouterr().out


def test_the_same_command_again_computes_nothing(studies, toy, own_cache):
    file = toy()
    assert studies.run(file)["nodes"]["computed"] > 0
    folder = studies.results / "toy"
    before = {path: path.read_bytes() for path in (folder / "tables").iterdir()}
    again = studies.run(file, "--workers", 1)
    assert again["complete"] and again["nodes"]["computed"] == 0
    assert before == {path: path.read_bytes() for path in (folder / "tables").iterdir()}
    # Results beside the scores are in the store alone: without it they are computed again.
    shutil.rmtree(own_cache)
    last = studies.run(file)
    assert last["complete"] and last["nodes"]["computed"] > 0
    assert len(toy.seen[-1].sweeps["first"].runs[0].load("scans")) == 3
    assert before == {path: path.read_bytes() for path in (folder / "tables").iterdir()}


def test_points_that_are_computed_again_are_told(studies, toy, monkeypatch):
    file = toy()
    studies.run(file)
    assert "computed again" not in studies.error
    monkeypatch.setattr(keys, "LAYOUT", keys.LAYOUT + 1)
    assert studies.run(file)["complete"]
    assert "first: 4 of 4 finished runs are out of date" in studies.error
    assert "second: 2 of 2 finished runs are out of date" in studies.error


def test_another_configuration_is_refused_but_for_name_or_fresh(studies, toy):
    file = toy()
    same = ("--name", "same")
    studies.run(file, "road_user=car", "seed=0", *same)
    error = studies.refused(file, "road_user=car", "seed=1,2", *same)
    folder = studies.results / "same"
    # What differs comes first and whole.
    assert error.startswith(f"stixel: seed of sweep first: 0 in {folder}, 1,2 here (and 1 more); ")
    assert "--name" in error and "--fresh" in error
    assert studies.run(file, "road_user=car", "seed=1", "--name", "other")["complete"]
    fresh = studies.run(file, "road_user=car", "seed=1", "--fresh", *same)
    assert fresh["complete"] and fresh["sweeps"]["first"]["done"] == 1
    (studies.results / "mine").mkdir()
    (studies.results / "mine/text").write_text("mine\n")
    assert "is not a study folder" in studies.refused(file, "--name", "mine", "--fresh")
    assert "is not a valid folder name" in studies.refused(file, "--name", "a/b")
    assert "at most 200 characters" in studies.refused(file, "--name", "a" * 201)
    for dry_run in ((), ("--dry-run",)):
        assert "--name: '' is not a valid folder name" in studies.refused(file, "--name=", *dry_run)
    for content in (
        "[1",
        "[]",
        "sweeps: 3",
        "{study: toy, template: t, module: r, sweeps: {first: {fixed: 3}}}",
    ):
        (folder / "study.yaml").write_text(content)
        assert "study.yaml: not a valid study file" in studies.refused(file, *same)


def test_what_differs_is_shown_however_long_the_values():
    before = {
        "study": "a",
        "template": "t",
        "module": "b",
        "sweeps": {"first": study_sweep("seed", range(40))},
    }
    after = {
        "study": "a",
        "template": "t",
        "module": "b",
        "sweeps": {"first": study_sweep("seed", (*range(39), 77))},
    }
    assert differences(before, before, "F") == []
    (text,) = differences(before, after, "F")
    assert text.startswith("seed: …") and len(text) < 200
    there, here = text.split(" in F, ")
    assert there.endswith("38,39") and here.endswith("38,77 here")
    assert differences(before, {**after, "study": "c"}, "F")[0] == "study: a in F, c here"
    after["sweeps"]["first"] |= {
        "fixed": ["path.duration=2"],
        "axes": before["sweeps"]["first"]["axes"],
    }
    assert differences(before, after, "F") == ["path.duration: not set in F, 2 here"]
    assert differences(after, before, "F") == ["path.duration: 2 in F, not set here"]


def study_sweep(key, values):
    axis = {"keys": [key], "steps": [[f"{key}={value}"] for value in values]}
    return {"fixed": [], "axes": [axis], "leave_out": [], "results": [], "derive": None}


def test_overrides_name_the_folder_so_that_commands_do_not_collide(studies, toy):
    file = toy()
    assert studies.run(file, "executor.workers=2")["folder"] == str(studies.results / "toy")
    few = studies.run(file, "seed=range(0,2)", "path.duration=0.2")
    assert few["folder"] == str(studies.results / "toy-path.duration=0.2-seed=0,1")
    # The same results by another command line.
    again = studies.run(file, "path.duration=0.2", "seed=0,1")
    assert again["folder"] == few["folder"] and again["nodes"]["computed"] == 0
    assert studies.run(file)["folder"] == str(studies.results / "toy")


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        (["measurement/noise=constant"], r"toy-measurement-noise=constant-[0-9a-f]{8}"),
        (["path.heading=[0.5]"], r"toy-path\.heading=-0\.5--[0-9a-f]{8}"),
        (["seed=range(0,90)"], r"toy-seed=0,1,[0-9,]{87}-[0-9a-f]{8}"),
    ],
)
def test_a_folder_name_is_one_that_disks_take(toy, overrides, name):
    plan = StudyPlan(read_study(toy()), tuple(overrides), (), ())
    assert re.fullmatch(name, plan.folder_name)
    other = StudyPlan(plan.study, (*overrides, "tracker.sigma_f=3"), (), ())
    assert other.folder_name != plan.folder_name


def test_what_fails_is_told_and_gone_on_with(studies, toy, tmp_path):
    mesh = tmp_path / "bad.obj"
    mesh.write_text("this is no mesh\n", encoding="utf-8")
    file = toy(changed(("sweeps", "first", "axes"), {"road_user.mesh": [None, str(mesh)]}))
    answer = studies.run(file, "seed=0", code=1)
    folder = studies.results / "toy-seed=0"
    assert not answer["complete"] and answer["answer"] is None
    assert answer["sweeps"]["first"]["done"] == 2
    # The second sweep's axes would follow from the first.
    assert answer["sweeps"]["second"] == {
        "runs": None,
        "done": 0,
        "folder": str(folder / "sweeps/second"),
        "faults": ["its axes follow from the sweeps before"],
    }
    assert "no statistics yet: runs are missing: first 2 of 4, second 0 of ?" in studies.error
    command = f"stixel study {file} seed=0 --results {studies.results}"
    assert studies.error.endswith(f"{command}\n")
    page = (folder / "report.html").read_text()
    assert "no statistics" in page and "bad.obj" in page and command in page
    assert not (folder / "tables").exists() and not toy.seen
    mesh.write_text(_BOX, encoding="utf-8")
    answer = studies.run(file, "seed=0")
    assert answer["complete"] and answer["sweeps"]["first"]["done"] == 4
    assert "no statistics" not in (folder / "report.html").read_text()


_BOX = """v -2 -0.9 0
v 2 -0.9 0
v 2 0.9 0
v -2 0.9 0
v -2 -0.9 1.5
v 2 -0.9 1.5
v 2 0.9 1.5
v -2 0.9 1.5
f 1 3 2
f 1 4 3
f 5 6 7
f 5 7 8
f 1 2 6
f 1 6 5
f 2 3 7
f 2 7 6
f 3 4 8
f 3 8 7
f 4 1 5
f 4 5 8
"""


def test_what_is_interrupted_is_gone_on_with(studies, toy, monkeypatch, own_cache):
    file = toy()

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(sweep_run, "execute", interrupted)
        assert studies.run(file, code=130) is None
    assert "interrupted in sweep first" in studies.error
    assert f"go on with: stixel study {file}" in studies.error
    assert "no statistics" in (studies.results / "toy/report.html").read_text()
    assert sweep_run.execute is execution.execute
    assert studies.run(file)["complete"]


@pytest.mark.parametrize(
    ("entries", "value", "told"),
    [
        (("title",), None, "title: is required"),
        (("question",), 3, "question: is required and must be a string"),
        (("module",), "none_such", "module: no module none_such"),
        (("module",), "none_such.py", "module: no file none_such.py in"),
        (("template",), "../none.j2", "template: no file ../none.j2 in"),
        (("sweeps",), [], "sweeps: must be names"),
        (("tittle",), "x", "tittle: no such entry; did you mean title?"),
        (("sweeps", "first", "result"), [], "first: result: no such entry; did you mean results?"),
        (("sweeps", "first", "results"), ["scns"], "has a step scns; did you mean scans?"),
        (("sweeps", "second", "derive"), "width", "has no function width"),
        (("sweeps", "first", "derive"), "widths", "derive: no earlier sweep"),
        (("sweeps", "first", "fixed"), {"path.durations": 1}, "did you mean path.duration?"),
        (("sweeps", "second", "seeds"), 0, "sweeps: second: seeds: must be"),
        (("sweeps", "a b"), {}, "sweeps: a b: a name"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(studies, toy, entries, value, told):
    file = toy(changed(entries, value))
    error = studies.refused(file)
    assert told in error


def test_yaml_that_is_none_is_refused(studies, toy):
    assert "toy.yaml: line 2" in studies.refused(toy("title: [\n"))
    assert "is a sweep, not a study" in studies.refused(toy("axes:\n  seed: [0, 1]\n"))


def test_overrides_take_the_place_of_what_parts_have(studies, toy):
    file = toy()
    plan = studies.run(
        file, "road_user=car", "path.duration=0.2", "seed=3,4,5", "tracker.basis_points=20,30",
        "--dry-run",
    )  # fmt: skip
    assert plan["sweeps"]["second"] is None
    assert plan["sweeps"]["first"]["runs"] == 1 * 2 * 3
    assert plan["sweeps"]["first"]["axes"] == [
        {"keys": ["road_user", "path"], "values": 1},
        {"keys": ["tracker.basis_points"], "values": 2},
        {"keys": ["seed"], "values": 3},
    ]
    assert not studies.results.exists()


def test_an_override_that_is_left_out_of_a_part_is_told(studies, toy, capsys):
    file = toy()
    note = (
        "path=s_curve: left out of sweep first: path: goes together with road_user here: give one "
        "of turn, crossing"
    )
    assert studies.run(file, "road_user=car", "--dry-run")["notes"] == []
    assert studies.run(file, "path=s_curve", "seed=0", "--dry-run")["notes"] == [note]
    assert main(["study", str(file), "path=s_curve", "--dry-run"]) == 0
    assert capsys.readouterr().out.startswith(f"note: {note}\n")
    answer = studies.run(file, "path=s_curve", "seed=0")
    assert answer["notes"] == [note] and studies.error.startswith(f"stixel: {note}\n")
    assert note in Path(answer["report"]).read_text()


def test_an_override_that_fits_no_part_is_refused(studies, toy):
    file = toy()
    assert "there is no such key" in studies.refused(file, "tracker.sigma=1")
    assert "must be > 0" in studies.refused(file, "path.duration=-1")


def test_what_names_no_study_is_refused(studies, toy):
    assert "rq2" in studies.refused() and "all" in studies.error
    assert "name a study first" in studies.refused("road_user=car")
    assert "did you mean" in studies.refused("rq22")
    assert "stixel sweep --from prior_width" in studies.refused("prior_width")
    assert "leave it out with all" in studies.refused("all", "--name", "x")


def test_a_study_whose_file_fails_fails_alone(studies, toy, monkeypatch, tmp_path):
    good, bad = toy(name="good"), toy("title: x\n", name="bad")
    monkeypatch.setattr("stixel_cli.studies.file.shipped_studies", lambda: [str(bad), str(good)])
    monkeypatch.setattr(
        "stixel_cli.studies.folder.study_folder", lambda results, name: results / Path(name).stem
    )
    answer = studies.run("all", "road_user=car", "seed=0", code=2)
    assert [one["complete"] for one in answer["studies"]] == [False, True]
    assert re.search("bad.yaml: question: is required", studies.error)


def test_which_studies_cannot_be_run_is_told_before_the_first_runs(studies, toy, monkeypatch):
    good, bad = toy(name="good"), toy("title: x\n", name="bad")
    told = []
    monkeypatch.setattr("stixel_cli.studies.file.shipped_studies", lambda: [str(good), str(bad)])
    monkeypatch.setattr(
        "stixel_cli.studies.folder.study_folder", lambda results, name: results / Path(name).stem
    )
    monkeypatch.setattr("stixel_cli.cli.study.tell", told.append)
    run = study_run.run_study
    monkeypatch.setattr(study_run, "run_study", lambda *a, **k: told.append("runs") or run(*a, **k))
    answer = studies.run("all", "road_user=car", "seed=0", code=2)
    assert [one["complete"] for one in answer["studies"]] == [True, False]
    assert "bad.yaml: question" in told[0] and told[1] == "runs"


def test_what_was_asked_for_is_kept(studies, toy):
    answer = studies.run(toy(), "road_user=car", "seed=0")
    content = yaml.safe_load(Path(answer["folder"], "study.yaml").read_text())
    assert content["overrides"] == ["road_user=car", "seed=0"]
    assert content["sweeps"]["first"]["results"] == ["scans", "track"]
    assert content["sweeps"]["second"]["derive"] == "widths"
    assert {"git", "versions", "machine", "command", "created"} <= set(content)


def test_a_full_disk_leaves_no_empty_folder(studies, toy, monkeypatch):
    file = toy()
    to_bytes = Path.write_bytes

    def full(path, content):
        to_bytes(path, content[:1])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    assert "toy: cannot be written: No space left on device" in studies.refused(file)
    assert not studies.results.exists()


def test_a_study_outside_the_package(studies, toy, tmp_path, monkeypatch, capsys):
    file = toy()
    answer = studies.run(file, "road_user=car", "seed=0")
    assert answer["complete"]
    # A result folder's commands never import the module that made its report.
    (tmp_path / "toy.py").write_text("raise SystemExit('imported')\n", encoding="utf-8")
    folder = Path(answer["folder"])
    monkeypatch.chdir(folder)
    for command in (
        ["show", str(folder / "sweeps/first")],
        ["ls", str(studies.results)],
    ):
        assert main(command) == 0
        assert "imported" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "content", "error"),
    [
        ("toy.py", "import no_such_module\n", "toy.py: line 1: ModuleNotFoundError"),
        ("toy.py", "def widths(data):\n    return []\n", "toy.py has no function report"),
        ("toy.py", "def report(:\n", "toy.py: line 1: SyntaxError"),
        ("toy.md.j2", "Text.\n\n{% for %}\n", "template: toy.md.j2: line 3"),
    ],
)
def test_a_wrong_template_or_module_is_refused(studies, toy, tmp_path, name, content, error):
    file = toy()
    (tmp_path / name).write_text(content, encoding="utf-8")
    assert error in studies.refused(file)


def test_a_template_may_only_use_what_the_module_gives(studies, toy, tmp_path):
    file = toy()
    (tmp_path / "toy.md.j2").write_text("{{ no_such_value }}\n", encoding="utf-8")
    assert studies.run(file, "road_user=car", "seed=0", code=2) is None
    assert "template: toy.md.j2: UndefinedError: 'no_such_value' is undefined" in studies.error
