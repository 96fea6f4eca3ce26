"""KITTI as one downloads it: oxts of the tracking benchmark, raw drives, files of results."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from damages import is_refused
from made_clip import tracking, truth_of
from made_drive import make_drive, make_official
from real_data import DATA
from scipy.spatial.transform import Rotation

from stixel_cli import compose
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.recordings.find import find_recording, guess_layout
from stixel_cli.recordings.kitti_tables import (
    read_calibration,
    read_labels,
    read_packets,
    read_poses,
)
from stixel_cli.recordings.parameters import LabelledFolder

CLIP = DATA / "kitti_tracking/training"
OXTS = DATA / "kitti_tracking_oxts/0005.txt"


def raw(folder, **changes):
    values = {"target": 0, "frames": None, "sample_time": 0.1}
    return LabelledFolder(kind="kitti_raw", folder=str(folder), **values | changes)


def same_truth(found, expected):
    for name in ("ego_poses_world", "target_poses_world"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-4)
    assert found.scored.tolist() == expected.scored.tolist()


@pytest.mark.skipif(not OXTS.is_file(), reason=f"{OXTS} is missing")
def test_the_oxts_of_clip_0005_give_its_poses():
    found = read_packets(*[CLIP / "calib/0005.txt"] * 3, OXTS)
    expected = read_poses(CLIP / "ego_poses/0005.txt")
    assert found.shape == expected.shape
    assert np.abs(found[:, :, 3] - expected[:, :, 3]).max() < 0.001
    turns = Rotation.from_matrix(found[:, :, :3].mT @ expected[:, :, :3])
    assert np.degrees(turns.magnitude()).max() < 0.001


def test_a_clip_as_one_downloads_it_has_the_same_truth(clip, copy):
    make_official(copy)
    recording = find_recording(tracking(copy))
    assert [file.parent.name for file in recording.pose_files] == [*["calib"] * 3, "oxts"]
    same_truth(truth_of(recording), truth_of(find_recording(tracking(clip))))
    # Poses of one's own come first.
    shutil.copytree(clip / "ego_poses", copy / "ego_poses")
    assert len(find_recording(tracking(copy)).pose_files) == 1
    shutil.rmtree(copy / "ego_poses")
    words = ["path=recorded", f"path.folder={copy}", "path.sequence=0003", "path.target=0"]
    assert compose(words).recording.frames == range(5)
    shutil.rmtree(copy / "oxts")
    with pytest.raises(UserError, match=r"oxts/0003\.txt: no such file"):
        compose(words)
    words = [f"source.folder={copy}", "source.sequence=0003", "source.target=0"]
    with pytest.raises(ConfigurationError, match=r"no poses of the ego car \(oxts/NNNN\.txt\)"):
        compose(words)


def test_a_raw_drive_has_the_same_truth(clip, tmp_path):
    drive = make_drive(clip, tmp_path)
    assert guess_layout(drive) == "kitti_raw"
    recording, expected = find_recording(raw(drive)), find_recording(tracking(clip))
    assert (recording.label, recording.frames) == ("Car", range(5))
    assert (recording.width, recording.height) == (expected.width, expected.height)
    assert recording.calibration == expected.calibration
    # The label's box is cut at the image; that of the drive is of the same corners.
    np.testing.assert_allclose(recording.first_box, expected.first_box, atol=0.01)
    same_truth(truth_of(recording), truth_of(expected))
    made = compose([f"source.folder={drive}", "source.target=0"])
    assert made.choices["source"] == "kitti_raw"
    assert made.configuration.prior.length == 4.0


def test_states_of_a_tracklet(clip, tmp_path):
    drive = make_drive(clip, tmp_path, kind="Person (sitting)")
    file = drive / "tracklet_labels.xml"
    text = file.read_text()
    for name, states in (("occlusion", (1, -1, 0, 0, 0)), ("truncation", (0, 0, 1, 2, 0))):
        first, *parts = text.split(f"<{name}>0</{name}>")
        words = [f"<{name}>{state}</{name}>" for state in states]
        text = first + "".join(map(str.__add__, words, parts))
    file.write_text(text)
    recording = find_recording(raw(drive))
    assert recording.road_user == "pedestrian"
    truth = truth_of(recording)
    assert truth.scored.tolist() == [False, False, False, False, True]
    assert np.isnan(truth.target_poses_world[3]).all()


def test_a_raw_drive_without_labels_or_packets(clip, tmp_path):
    drive = make_drive(clip, tmp_path)
    (drive / "tracklet_labels.xml").unlink()
    assert find_recording(raw(drive, target=None)).label_files == ()
    shutil.rmtree(drive / "oxts")
    assert find_recording(raw(drive, target=None)).pose_files == ()


ENTITIES = '<!DOCTYPE a [<!ENTITY x "xxx"><!ENTITY y "&x;&x;">]><a>&y;</a>'
IMU, VELODYNE, CAMERAS = map("../calib_{}.txt".format, ("imu_to_velo", "velo_to_cam", "cam_to_cam"))
LABELS, PACKET = "tracklet_labels.xml", "oxts/data/0000000002.txt"
DAMAGE = {
    "entities": (LABELS, lambda text: ENTITIES, "must declare no entities"),
    "no XML": (LABELS, lambda text: text[:500], "not valid XML: "),
    "no size": (LABELS, lambda text: text.replace("<h>", "<h>-"), "width and length must"),
    "words": (LABELS, lambda text: text.replace("<tx>", "<tx>about", 1), "row 1: 'about"),
    "no value": (LABELS, lambda text: text.replace("rz>", "rx>"), "row 1: '' is not a number"),
    "no track": (LABELS, lambda text: "<a/>", "has no track 0; it has none"),
    "short packet": (PACKET, lambda text: text[:200], "30 columns are needed"),
    "empty packet": (PACKET, lambda text: "", "must have one row of 30"),
    "pole": (PACKET, lambda text: "89" + text[2:], "latitude must be within"),
    "far": (PACKET, lambda text: "50" + text[2:], "row 3: out of order"),
    "no rotation": (IMU, lambda text: text.replace("R: ", "R: 2"), "R is not a rotation"),
    "no motion": (VELODYNE, lambda text: text.replace("R:", "S:"), "or R and T is missing"),
    "no place": (VELODYNE, lambda text: text.replace("T:", "S:"), "T is missing"),
    "no turn": (CAMERAS, lambda text: text.replace("R_rect_00", "R_rect_01"), "R_rect_00 or R_"),
}


@pytest.mark.parametrize(("file", "damage", "said"), DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_drive_is_refused_in_one_line_that_names_the_file(
    file, damage, said, clip, tmp_path
):
    path = make_drive(clip, tmp_path) / file
    path.write_text(damage(path.read_text()))
    name = "oxts/data" if "oxts" in file else Path(file).name
    is_refused(raw(tmp_path / "2011_09_26_drive_0001_sync"), said, name)


def test_a_missing_packet_is_named(clip, tmp_path):
    drive = make_drive(clip, tmp_path)
    (drive / "oxts/data/0000000003.txt").unlink()
    with pytest.raises(UserError, match="all packets from 0000000000"):
        find_recording(raw(drive))


def test_labels_may_have_a_score_and_files_a_bom(copy):
    file, calibration = copy / "label_02/0003.txt", copy / "calib/0003.txt"
    plain, text = read_labels(file)[0], file.read_text()
    other = read_calibration(calibration, ("P2", "P3"))
    with_score = "".join(f"{line} 0.87\n" for line in text.splitlines())
    for changed in (with_score, "\ufeff" + text):
        file.write_text(changed, encoding="utf-8")
        assert all(np.array_equal(v, vars(plain)[n]) for n, v in vars(read_labels(file)[0]).items())
    calibration.write_text("\ufeff" + calibration.read_text(), encoding="utf-8")
    assert read_calibration(calibration, ("P2", "P3")) == other
    # Of the object benchmark.
    file.write_text(" ".join(with_score.splitlines()[0].split()[2:]))
    assert read_labels(file)[0].places.tolist() == plain.places[:1].tolist()
    file.write_text(with_score.splitlines()[0] + " 1.0")
    with pytest.raises(UserError, match="row 1: 17 columns are needed, got 19"):
        read_labels(file)
