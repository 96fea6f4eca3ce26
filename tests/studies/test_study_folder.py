"""The folder of a study: its name, its request, and requests that differ."""

import re
from pathlib import Path

import pytest
import study_toy
import yaml

from stixel_cli.studies.file import read_study
from stixel_cli.studies.plan import StudyPlan, plan_study
from stixel_cli.studies.report import Material, Report
from stixel_cli.studies.run import Study


def test_a_folder_with_another_request_is_refused_without_name_or_fresh(studies, toy):
    file = toy()
    same = ("--name", "same")
    answer = studies.run(file, "road_user=car", "seed=0", *same)
    content = yaml.safe_load(Path(answer["folder"], "study.yaml").read_text())
    assert content["overrides"] == ["road_user=car", "seed=0"]
    assert content["sweeps"]["first"]["results"] == "['scans', 'track']"
    assert content["sweeps"]["second"]["derive"] == "widths"
    assert {"git", "versions", "machine", "command", "created"} <= set(content)
    error = studies.refused(file, "road_user=car", "seed=1,2", *same)
    folder = studies.results / "same"
    said = f"{folder}: has another request: sweeps.first.seed: '0' became '1,2'; "
    assert error.startswith(f"stixel: {said}")
    assert "--name" in error and "--fresh" in error
    assert studies.run(file, "road_user=car", "seed=1", "--name", "other")["complete"]
    fresh = studies.run(file, "road_user=car", "seed=1", "--fresh", *same)
    assert fresh["complete"] and fresh["sweeps"]["first"]["done"] == 2
    (studies.results / "mine").mkdir()
    (studies.results / "mine/text").write_text("mine\n")
    assert "is not a study folder" in studies.refused(file, "--name", "mine", "--fresh")
    assert "is not a valid folder name" in studies.refused(file, "--name", "a/b")
    assert "at most 200 characters" in studies.refused(file, "--name", "a" * 201)
    for dry_run in ((), ("--dry-run",)):
        assert "--name: '' is not a valid folder name" in studies.refused(file, "--name=", *dry_run)
    for content in ("[1", "[]", "sweeps: 3"):
        (folder / "study.yaml").write_text(content)
        assert str(folder) in studies.refused(file, *same)


def test_a_resumed_folder_has_the_revision_of_its_results(toy, tmp_path, monkeypatch):
    plan = plan_study(read_study(toy(), trusted=True), [])
    found = []
    for revision in ("old", "new"):
        monkeypatch.setattr(
            "stixel_cli.studies.run.provenance", lambda own=revision: {"git": {"revision": own}}
        )
        study = Study(plan, tmp_path / "study", f"command of {revision}")
        study.begin(fresh=False)
        if found:
            # Not before its results: a sweep that is refused leaves the file as it is.
            study.write("")
            assert yaml.safe_load((study.path / "study.yaml").read_text()) == found[0]
        study.report = Report((), (), Material())
        study.write("")
        found.append(yaml.safe_load((study.path / "study.yaml").read_text()))
    first, resumed = found
    assert resumed["git"]["revision"] == "new"
    assert resumed | {"git": first["git"]} == first
    assert study.check(fresh=False)


def test_a_cache_that_is_too_small_keeps_what_the_report_reads(
    studies, toy, own_cache, monkeypatch
):
    plain = study_toy.material

    def reading(data):
        for sweep in data.sweeps.values():
            assert all(len(run.load("scans")) == 3 for run in sweep.runs)
        return plain(data)

    monkeypatch.setattr(study_toy, "material", reading)
    assert studies.run(toy(), "road_user=car", "seed=0", "cache.max_size=1kB")["complete"]


def test_a_folder_is_named_after_its_overrides(studies, toy):
    cars = [{"road_user": ["car"], "path": ["turn"]}]
    file = toy(study_toy.changed(("sweeps", "first", "zipped"), cars))
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
def test_a_long_folder_name_is_shortened_with_a_hash(toy, overrides, name):
    plan = StudyPlan(read_study(toy(), trusted=True), tuple(overrides), (), ())
    assert re.fullmatch(name, plan.folder_name)
    other = StudyPlan(plan.study, (*overrides, "tracker.sigma_f=3"), (), ())
    assert other.folder_name != plan.folder_name
