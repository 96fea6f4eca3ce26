"""The study rq3 from the command line, tiny: it answers, and its preset is one that runs.

To render would take most of the time. So fabricated scans stand in for the simulated ones, of other
noise than the study's own, and the fit has to find that noise.
"""

import csv
import io
from pathlib import Path

import pytest
import yaml

from stixel_cli.config.compose import from_resolved
from stixel_cli.config.folders import shipped_folder
from stixel_cli.studies.file import find_study

TINY = (
    "road_user=car",
    "path=approach",
    "path.start=[1,12]",
    "path.duration=1",
    "tracker=point",
    "executor=threads",
    "seed=0,1",
)


@pytest.fixture
def study(tmp_path):
    """A study's file like the shipped one, with scans of another noise for the simulated ones."""
    content = yaml.safe_load(find_study("rq3").read_text("utf-8"))
    for name in ("training", "simulated"):
        content["sweeps"][name]["fixed"] = {
            "measurement": "fabricated",
            "measurement/noise": "stereo",
            "measurement.noise.disparity_std": 0.3,
        }
    file = tmp_path / "tiny.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return file


def test_a_tiny_study_gives_a_complete_report_and_a_preset(studies, study):
    folder = Path(studies.run(study, *TINY)["folder"])
    page = (folder / "report.html").read_text("utf-8")
    assert "These runs are too few for a significant test of the points and trackers." in page
    assert "With n = 2 pairs, the smallest p" in page
    for words in ("means over n pairs", "rank-biserial", "Holm"):
        assert words in page
    assert "seeds 0 and 1 are in both" in page
    for name in ("point_errors", "range_law", "neighbours", "edges", "tracker_differences"):
        assert (folder / "figures" / f"{name}.svg").stat().st_size > 2000
    table = (folder / "tables" / "point_differences.csv").read_text("utf-8")
    assert table.count("\n") >= 12

    fitted = folder / "sweeps" / "fitted" / "runs"
    one = next(path for path in fitted.rglob("config.yaml"))
    noise = yaml.safe_load((folder / "noise" / "fitted_car.yaml").read_text("utf-8"))
    plain = yaml.safe_load(one.read_text("utf-8"))
    assert plain["measurement"]["noise"] == noise
    assert abs(noise["disparity_std"] - 0.3) < 0.02
    assert from_resolved(plain).measurement.noise.kind == "fitted"


def test_the_report_names_the_compared_noise(studies, study):
    noise = ("measurement/noise=constant", "measurement.noise.range_std=0.2")
    page = Path(studies.run(study, *TINY, *noise)["report"]).read_text("utf-8")
    assert "white noise of the range (0.200\u202fm) along the ray" in page
    assert "white noise of the disparity" not in page


def test_a_path_is_evaluated_with_a_noise_fitted_to_other_paths(studies, study):
    overrides = (*TINY[:1], "path=depart,crossing", *TINY[3:])
    folder = Path(studies.run(study, *overrides)["folder"])
    runs = [
        yaml.safe_load(path.read_text("utf-8"))
        for path in (folder / "sweeps" / "fitted" / "runs").rglob("config.yaml")
    ]
    assert len(runs) == 2 * 2
    used = {run["path"]["kind"]: run["measurement"]["noise"]["disparity_std"] for run in runs}
    table = (folder / "tables" / "held_out_noise.csv").read_text("utf-8")
    with io.StringIO(table) as file:
        held_out = {row["fitted to"]: float(row["disparity_std"]) for row in csv.DictReader(file)}
    assert used == {path: held_out[f"car, without {path}"] for path in ("depart", "crossing")}
    assert used["depart"] != used["crossing"]
    page = (folder / "report.html").read_text("utf-8")
    assert "fitted to the training runs of the other paths" in page


def test_shipped_presets_name_their_origin():
    for user in ("car", "cyclist", "pedestrian"):
        path = shipped_folder("conf") / "measurement" / "noise" / f"fitted_{user}.yaml"
        text = path.read_text("utf-8")
        assert "stixel study rq3" in text
        assert user in text.splitlines()[1]


def test_several_noise_values_are_compared_with_simulated_runs(studies, study):
    content = yaml.safe_load(study.read_text("utf-8"))
    axes = content["sweeps"]["fabricated"]["axes"]
    axes = axes | {"measurement.noise.disparity_std": [0.1, 0.2]}
    content["sweeps"]["fabricated"]["axes"] = axes
    study.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    folder = Path(studies.run(study, *TINY)["folder"])
    rows = list(csv.DictReader(io.StringIO((folder / "tables/noise_levels.csv").read_text())))
    noises = [row["noise"] for row in rows]
    assert noises == [f"measurement.noise.disparity_std={value}" for value in ("0.1", "0.2")]
    assert all(row["n"] == "2" for row in rows)
    for row in rows:
        assert abs(float(row["centre RMSE − simulated"])) < 1.0
        # Two pairs have no interval.
        assert row["low centre RMSE − simulated"] == row["high centre RMSE − simulated"] == ""
    assert "measurement.noise.disparity_std=0.1 and " in (folder / "report.html").read_text()


def test_the_cost_is_compared_with_the_sample_time(studies, study):
    folder = Path(studies.run(study, *TINY)["folder"])
    rows = list(csv.DictReader(io.StringIO((folder / "tables" / "cost.csv").read_text("utf-8"))))
    by_stage = {row["stage"]: row for row in rows}
    one = by_stage["images to track, point tracker, one core"]
    two = by_stage["images to track, point tracker, two cores at least"]
    assert {"track, point tracker", "scans"} <= by_stage.keys()
    assert float(two["simulated"]) <= float(one["simulated"])
    assert float(one["simulated / T"]) == pytest.approx(10.0 * float(one["simulated"]))
