"""The tracks of the study of real motion, of made labels."""

import sys
from pathlib import Path

import pytest

from stixel_cli.errors import MissingData
from stixel_cli.studies import motions
from stixel_cli.studies.file import read_study
from stixel_cli.studies.report import data_folder
from stixel_cli.sweeps.design import find_file

sys.path.append(str(Path(__file__).parents[1] / "recordings"))
from made_argoverse import TARGET, make_motion

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
    assert motions.LEAST_FRAMES == 30
    monkeypatch.setattr(motions, "LEAST_FRAMES", FEW)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Clips 0000 with cars and 0001 with a cyclist and a pedestrian, and an ego car that drives;
    beside them a log with a bicycle, which the ego car no longer sees at the end."""
    folder = tmp_path_factory.mktemp("data")
    make_motion(folder / motions.LOGS / LOG, mounted=True)
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
    found = motions.real_tracks(data_folder(motions.NEEDED, motions.CLIPS))
    named = [(one.sequence, one.target, one.kind, len(one.frames)) for one in found]
    assert named == [
        ("0000", 3, "Car", 6),
        ("0000", 8, "Car", 7),
        ("0001", 0, "Cyclist", 6),
        ("0001", 1, "Pedestrian", 6),
        (None, TARGET, "Cyclist", 9),
    ]
    (axes,) = motions.every_track()
    assert axes["path.target"] == [3, 8, 0, 1, TARGET] and axes["seed"] == [0, 1, 2, 3, 4]
    assert axes["path.frames"][1] == "0:7" and axes["path.frames"][-1] == "0:9"
    assert [Path(folder).name for folder in axes["path.folder"][3:]] == [motions.CLIPS, LOG]
    monkeypatch.setattr(motions, "MOST_SIMULATED", 1)
    (some,) = motions.some_tracks()
    assert some["path.target"] == [3, 0, 1] and some["seed"] == [0, 2, 3]


def test_without_data_it_is_refused_in_one_line_and_left_out_of_all(studies, monkeypatch, tmp_path):
    monkeypatch.delenv("STIXEL_DATA", raising=False)
    assert "STIXEL_DATA: must name a folder that has kitti_tracking" in studies.refused("motions")
    monkeypatch.setenv("STIXEL_DATA", str(tmp_path))
    with pytest.raises(MissingData):
        motions.every_track()
    monkeypatch.delenv("STIXEL_DATA", raising=False)
    monkeypatch.setattr("stixel_cli.cli.study.STUDIES", ["motions"])
    (answer,) = studies.run("all")["studies"]
    assert not answer["complete"] and "STIXEL_DATA" in answer["error"]


def test_the_shipped_study_has_the_eight_paths_and_a_shape_for_each_seed():
    study = read_study(find_file("motions", study=True))
    assert len(study.sweeps[0].content["axes"]["path"]) == 8
    for sweep in study.sweeps:
        assert sweep.content["fixed"]["road_user.shape_seed"] == "${seed}"
