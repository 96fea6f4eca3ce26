"""The folder of a study, its request, and overrides of a study of several trackers and paths."""

import re
from pathlib import Path

import pytest
import study_toy
import yaml

from stixel_cli.border.origins import TYPED
from stixel_cli.config.compose import Composer
from stixel_cli.config.overrides import parse
from stixel_cli.errors import ConfigurationError
from stixel_cli.studies.file import read_study
from stixel_cli.studies.plan import StudyPlan, overridden, plan_study
from stixel_cli.studies.report import Material, Report
from stixel_cli.studies.run import Study
from stixel_cli.sweeps.design import Axis, Design, design_runs


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
        git = {"git": {"revision": revision}}
        monkeypatch.setattr("stixel_cli.studies.run.provenance", lambda own=git: own)
        study = Study(plan, tmp_path / "study", f"command of {revision}")
        study.begin(fresh=False)
        if found:
            # Not before its results: a sweep that is refused leaves the file as it is.
            study.write_report()
            assert yaml.safe_load((study.path / "study.yaml").read_text()) == found[0]
        study.report = Report((), (), Material())
        study.write_report()
        found.append(yaml.safe_load((study.path / "study.yaml").read_text()))
    first, resumed = found
    assert resumed["git"]["revision"] == "new"
    assert resumed | {"git": first["git"]} == first
    assert study.check(fresh=False)


def test_a_too_small_cache_keeps_what_the_report_reads(studies, toy, own_cache, monkeypatch):
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


def axis(key, *values):
    return Axis((key,), tuple((parse(f"{key}={value}", TYPED),) for value in values))


def texts_of(design):
    return [one.text for one in design.fixed]


def fixed(*texts):
    """A design without axes."""
    return Design(tuple(parse(text, TYPED) for text in texts), ())


SENSORS = axis("measurement", "stixels", "fabricated", "lidar")
AXES = SENSORS, axis("tracker", "gp_ekf", "point"), axis("seed", 0, 1)
TRACKING = Design((parse("path.duration=1", TYPED),), AXES)
STEREO_ONLY = Design((parse("measurement=stixels", TYPED),), (axis("seed", 0, 1),))


def test_an_override_applies_to_sweeps_all_of_whose_runs_accept_it():
    rays = Design((parse("measurement=fabricated", TYPED),), (axis("seed", 0, 1),))
    text = "measurement/noise=constant"
    sweeps = [TRACKING, STEREO_ONLY, rays]
    designs, notes = overridden(sweeps, [text], ["tracking", "stereo", "rays"])
    assert designs[:2] == sweeps[:2] and text in texts_of(designs[2])
    assert len(design_runs(designs[2], Composer())) == 2
    (note,) = notes
    assert note.startswith(f"{text}: left out of sweeps tracking and stereo: measurement/noise: ")


def test_a_key_inside_an_option_follows_it_and_several_values_need_an_axis_in_range():
    texts = ["measurement.noise.range_std=0.2", "measurement/noise=constant"]
    for order in (["measurement=fabricated", *texts], [*texts, "measurement=fabricated"]):
        (design,), notes = overridden([TRACKING], order, ["tracking"])
        assert {*texts, "path.duration=1"} == set(texts_of(design)) and not notes
        assert design.swept[0].text == "measurement=fabricated"
    with pytest.raises(ConfigurationError, match=r"tracker.basis_points: is on no axis here"):
        overridden([STEREO_ONLY], ["tracker.basis_points=20,30"], ["stereo"])
    (design,), _ = overridden([TRACKING], ["tracker=point,contour", "seed=3,4"], ["tracking"])
    assert design.axes[1:] == (axis("tracker", "point", "contour"), axis("seed", 3, 4))
    fabricated = fixed("measurement=fabricated", "measurement/noise=constant")
    sweeps, negative = [STEREO_ONLY, fabricated], ["measurement.noise.range_std=-1"]
    with pytest.raises(ConfigurationError, match="range_std: -1 is out of range"):
        overridden(sweeps, negative, ["stereo", "rays"])
    with pytest.raises(ConfigurationError, match="belongs to measurement=fabricated"):
        overridden([STEREO_ONLY], ["measurement/noise=constant"], ["stereo"])


def test_keys_that_distinguish_sweeps_cannot_be_overridden():
    rays = fixed("measurement=fabricated", "path=turn")
    stereo = fixed("measurement=stixels", "path=turn")
    names = "measurement=fabricated in rays, measurement=stixels in stereo"
    with pytest.raises(ConfigurationError, match=names):
        overridden([rays, stereo], ["measurement=lidar"], ["rays", "stereo"])
    designs, notes = overridden([rays, stereo], ["path=circle"], ["rays", "stereo"])
    assert all("path=circle" in texts_of(design) for design in designs) and not notes
    # A sweep whose axes are derived keeps its own, and so stands in nobody's way.
    fitted = fixed("measurement=fabricated", "measurement/noise=fitted_car")
    plain = fixed("measurement=fabricated", "measurement/noise=stereo")
    given = [plain, fitted], ["measurement/noise=constant"], ["plain", "fitted"]
    (changed, kept), _ = overridden(*given, derived=["fitted"])
    assert "measurement/noise=constant" in texts_of(changed)
    assert kept == fitted
