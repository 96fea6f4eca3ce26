"""The study of real motion: tiny, by the real command line, on made labels."""

import csv
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.stats import ttest_ind

from stixel_cli.errors import MissingData
from stixel_cli.report.statistics import Statistic, excludes_zero, statistic
from stixel_cli.studies.data import data_folder
from stixel_cli.studies.file import find_study, read_study
from stixel_cli.studies.motions import tracks
from stixel_cli.studies.motions.report import (
    ALIKE,
    NEW,
    REVERSED,
    SAME,
    TOO_FEW,
    UNCONFIRMED,
    Finding,
    findings_forest,
)

sys.path.append(str(Path(__file__).parents[1] / "recordings"))
from made_argoverse import TARGET, make_motion

SMALL = {"rig.width": 160, "rig.height": 96, "rig.focal_length": 150.0, "stereo.disparities": 48}
SMALL |= {"stereo.nearest": 6.0, "occupancy.nearest": 3.0, "executor": "threads"}

SIZES = {"Car": "1.5 1.8 4.2", "Cyclist": "1.7 0.6 1.8", "Pedestrian": "1.7 0.6 0.7"}


def label(frame, target, kind, x, z, truncated=0, occluded=0):
    return (
        f"{frame} {target} {kind} {truncated} {occluded} 0 0 0 9 9 {SIZES[kind]} {x} 1.65 {z} -1.5"
    )


def row(*rows):
    return " ".join(repr(value) for line in rows for value in line)


LOG = "7fab2350-7eaf"

FEW = 6
"""Frames of the made tracks, in the place of 30."""


@pytest.fixture(autouse=True)
def few_frames(monkeypatch):
    assert tracks.LEAST_FRAMES == 30
    monkeypatch.setattr(tracks, "LEAST_FRAMES", FEW)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Clips 0000 with cars and 0001 with a cyclist and a pedestrian, and an ego car that drives;
    beside them a log with a bicycle, which the ego car no longer sees at the end."""
    folder = tmp_path_factory.mktemp("data")
    make_motion(folder / tracks.LOGS / LOG, mounted=True)
    root = folder / "kitti_tracking" / "training"
    few = FEW
    clips = {
        "0000": [label(k, 3, "Car", 0.5, 9.0 + 0.1 * k) for k in range(few)]
        # Too far, too short, hidden, cut; and one whose middle frame is.
        + [label(k, 4, "Car", 1.0, 41.0) for k in range(few)]
        + [label(k, 5, "Car", 1.0, 12.0) for k in range(few - 1)]
        + [label(k, 6, "Car", 1.0, 12.0, occluded=3) for k in range(few)]
        + [label(k, 7, "Car", 1.0, 12.0, truncated=1) for k in range(few)]
        + [label(k, 8, "Car", 3.0, 10.0, occluded=3 * (k == 2)) for k in range(few + 1)],
        "0001": [label(k, 0, "Cyclist", 1.0, 8.0) for k in range(few)]
        + [label(k, 1, "Pedestrian", -1.0, 7.0) for k in range(few)],
    }
    camera = ([150.0, 0.0, 78.0], [0.0, 150.0, 40.0], [0.0, 0.0, 1.0])
    for name, rows in clips.items():
        texts = {
            "label_02": "\n".join(rows),
            "calib": "\n".join(
                f"{p}: {row(*([*line, t if i == 0 else 0.0] for i, line in enumerate(camera)))}"
                for p, t in (("P2", 0.0), ("P3", -75.0))
            ),
            "ego_poses": "\n".join(
                row([1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0.2 * k]) for k in range(few + 5)
            ),
        }
        for kind, text in texts.items():
            (root / kind).mkdir(parents=True, exist_ok=True)
            (root / kind / f"{name}.txt").write_text(text + "\n")
    return folder


def test_tracks_that_count(data, monkeypatch):
    monkeypatch.setenv("STIXEL_DATA", str(data))
    found = tracks.real_tracks(data_folder(tracks.NEEDED, tracks.CLIPS))
    named = [(one.sequence, one.target, one.kind, len(one.frames)) for one in found]
    assert named == [
        ("0000", 3, "Car", 6),
        ("0000", 8, "Car", 7),
        ("0001", 0, "Cyclist", 6),
        ("0001", 1, "Pedestrian", 6),
        (None, TARGET, "Cyclist", 9),
    ]
    (axes,) = tracks.every_track()
    assert axes["path.target"] == [3, 8, 0, 1, TARGET] and axes["seed"] == [0, 1, 2, 3, 4]
    assert axes["path.frames"][1] == "0:7" and axes["path.frames"][-1] == "0:9"
    assert [Path(folder).name for folder in axes["path.folder"][3:]] == [tracks.CLIPS, LOG]
    monkeypatch.setattr(tracks, "MOST_SIMULATED", 1)
    (some,) = tracks.some_tracks()
    assert some["path.target"] == [3, 0, 1] and some["seed"] == [0, 2, 3]


def test_without_data_it_is_refused_in_one_line(studies, monkeypatch, tmp_path):
    monkeypatch.delenv("STIXEL_DATA", raising=False)
    assert "STIXEL_DATA: must name a folder that has kitti_tracking" in studies.refused("motions")
    monkeypatch.setenv("STIXEL_DATA", str(tmp_path))
    with pytest.raises(MissingData):
        tracks.every_track()


def test_all_studies_leave_it_out_without_data(studies, monkeypatch):
    monkeypatch.delenv("STIXEL_DATA", raising=False)
    monkeypatch.setattr("stixel_cli.cli.study.STUDIES", ["motions"])
    (answer,) = studies.run("all")["studies"]
    assert not answer["complete"] and "STIXEL_DATA" in answer["error"]


@pytest.fixture
def tiny(tmp_path):
    """The file of the shipped study with fewer paths, frames and pixels."""
    content = yaml.safe_load(find_study("motions").read_text(encoding="utf-8"))
    for name, sweep in content["sweeps"].items():
        sweep["fixed"] = {**sweep["fixed"], **SMALL}
        if name == "hand_made":
            sweep["fixed"] |= {"path.duration": 0.3}
            sweep["axes"] |= {"path": ["depart", "approach"], "road_user": ["car"]}
            sweep["seeds"] = [0]
    file = tmp_path / "motions.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return file


def table(folder, name):
    with (folder / "tables" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_tiny_study_gives_a_complete_report(studies, tiny, data, monkeypatch):
    monkeypatch.setenv("STIXEL_DATA", str(data))
    answer = studies.run(tiny, f"path.target=3,0,{TARGET}")
    folder = Path(answer["folder"])
    assert answer["complete"], answer
    runs = {name: sweep["runs"] for name, sweep in answer["sweeps"].items()}
    assert runs == {"hand_made": 2 * 3 * 2, "real": 3 * 2 * 2, "real_simulated": 3 * 2}
    text = " ".join(answer["answer"])
    assert not re.search(r"\bnan\b|\binf\b", text)
    for part in (
        "Of 8 differences",
        "(RQ2), 0 hold",
        "Of 6 differences",
        "and 1 of Argoverse 2: 1 car, 2 cyclists;",
    ):
        assert part in text
    rows = table(folder, "answers")
    assert {row["question"] for row in rows} == {"RQ2", "RQ3"}
    overlaps = [row for row in rows if "IoU" in row["measure"]]
    assert {row["n, hand-made"] for row in overlaps} == {"2"}
    assert {row["n, real"] for row in overlaps} == {"1"}
    assert (folder / "figures" / "answer_forest.svg").exists()
    assert (folder / "figures" / "scenes.svg").exists()
    cyclists = table(folder, "cyclists")
    scans = {row["clip/track"]: row["scans"] for row in cyclists}
    assert scans == {"0001/0": "6", "7fab2350/022c398c": "9"} and len(cyclists) == 12


VERDICTS = {
    SAME: ((0.1, 0.3), (0.2, 0.9)),
    ALIKE: ((-0.1, 0.3), (-0.2, 0.9)),
    UNCONFIRMED: ((-0.3, -0.1), (-0.2, 0.9)),
    NEW: ((-0.3, 0.1), (0.2, 0.9)),
    REVERSED: ((-0.3, -0.1), (0.2, 0.9)),
    TOO_FEW: ((None, None), (0.2, 0.9)),
}


@pytest.mark.parametrize(("verdict", "ends"), VERDICTS.items())
def test_verdicts(verdict, ends):
    sides = [Statistic(0.0, *one, 5, 0.1) for one in ends]
    assert Finding("RQ2", "", "car", "iou_mean", *sides).verdict == verdict


def test_the_plot_has_a_row_for_each_kind_of_motion_and_a_panel_for_each_difference(monkeypatch):
    drawn = []

    def keep(figure):
        drawn.append(figure)
        return b"<svg"

    monkeypatch.setattr("stixel_cli.pictures.style.svg", keep)
    sides = [statistic("", [0.1, 0.3, 0.2]), statistic("", [0.5])]
    unknown = [statistic("", []), statistic("", [])]
    found = [
        Finding("RQ2", "stixels − lidar", "car", "centre_rmse_m", *sides),
        Finding("RQ2", "stixels − lidar", "cyclist", "centre_rmse_m", *unknown),
        Finding("RQ2", "stixels − lidar", "car", "iou_mean", *sides),
        Finding("RQ3", "fabricated − stixels", "car", "centre_rmse_m", *sides),
    ]
    assert findings_forest(found).name == "answer_forest"
    panels = drawn[0].axes
    assert [axes.get_xlabel() for axes in panels] == [
        "centre RMSE, stixels − lidar (m)",
        "centre RMSE, fabricated − stixels (m)",
    ]
    for axes in panels:
        assert [label.get_text() for label in axes.get_yticklabels()] == [
            "car, hand-made",
            "car, real",
        ]
    assert findings_forest(found[1:2]) is None


def test_a_change_has_welchs_interval():
    """Against `scipy.stats.ttest_ind(…, equal_var=False)`."""
    hand, real = [0.1, 0.3, 0.2, 0.6], [0.9, 0.5, 0.8]
    found = Finding("RQ2", "", "car", "iou_mean", statistic("", hand), statistic("", real))
    expected = ttest_ind(real, hand, equal_var=False).confidence_interval(0.95)
    ends = [found.change.low, found.change.high]
    np.testing.assert_allclose(ends, [expected.low, expected.high], rtol=1e-9)
    assert excludes_zero(found.change) == (expected.low > 0.0)
    one = Finding("RQ2", "", "car", "iou_mean", statistic("", hand), statistic("", [1.0]))
    assert one.change == Statistic() and not excludes_zero(one.change)


def test_the_shipped_study_has_the_eight_paths_and_a_shape_for_each_seed():
    study = read_study(find_study("motions"))
    assert len(study.sweeps[0].content["axes"]["path"]) == 8
    for sweep in study.sweeps:
        assert sweep.content["fixed"]["road_user.shape_seed"] == "${seed}"
