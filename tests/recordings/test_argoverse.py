"""Recordings in the layout of Argoverse 2's stereo cameras."""

import shutil
import sys

import numpy as np
import pytest
from damages import cut, is_refused, missing, text
from made_argoverse import MOUNTED, START, STEP, TARGET, annotations, make_log, write_table
from made_clip import make_clip, tracking, truth_of

from stixel_cli.config.compose import compose
from stixel_cli.errors import UserError
from stixel_cli.recordings.find import find_recording, guess_layout
from stixel_cli.recordings.image_files import grey, read_image
from stixel_cli.recordings.parameters import Argoverse
from stixel_cli.recordings.stereo_images import read_pairs
from stixel_cli.recordings.tables import read_labels

pyarrow = pytest.importorskip("pyarrow", reason="needs pip install 'stixel[argoverse]'")
ipc = pytest.importorskip("pyarrow.ipc")


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A clip of KITTI tracking, and the same as a log of Argoverse 2."""
    folder = tmp_path_factory.mktemp("clip")
    make_clip(folder / "kitti")
    make_log(folder / "kitti", folder / "log")
    return folder / "kitti", folder / "log"


@pytest.fixture
def copy(folders, tmp_path):
    """A log to damage."""
    return shutil.copytree(folders[1], tmp_path / "log")


def source(folder, **changes):
    values = {"target": TARGET, "frames": None, "sample_time": 0.1}
    return Argoverse(kind="argoverse", folder=str(folder), **values | changes)


def table(file):
    with open(file, "rb") as stream:
        return ipc.open_file(stream).read_all().to_pylist()


def test_a_log_has_the_truth_of_the_clip_it_was_made_from(folders):
    there, found = find_recording(tracking(folders[0])), find_recording(source(folders[1]))
    assert guess_layout(folders[1]) == "argoverse"
    assert found.frames == range(5) and found.label == "Car"
    truth, expected = truth_of(found), truth_of(there)
    np.testing.assert_allclose(truth.ego_poses_world, expected.ego_poses_world, atol=1e-3)
    np.testing.assert_allclose(truth.target_poses_world, expected.target_poses_world, atol=2e-3)
    np.testing.assert_allclose(truth.contour_target(0), expected.contour_target(0), atol=1e-9)
    assert truth.scored.all()
    # The first box, in the rectified image, is that of the clip.
    shift = found.calibration.principal_u - there.calibration.principal_u
    np.testing.assert_allclose(np.array(found.first_box) - shift, there.first_box, atol=1.0)


def test_images_are_rectified_by_the_calibration(folders):
    there, found = find_recording(tracking(folders[0])), find_recording(source(folders[1]))
    calibration, rectification = found.calibration, found.calibration.rectification
    assert calibration.focal_length == 150.0 and calibration.baseline == pytest.approx(0.5)
    assert 0.85 * 160 < found.width < 160 and 0.85 * 96 < found.height < 96
    pairs = read_pairs(found.images, range(1), rectification)
    assert pairs.left[0].shape == pairs.right[0].shape == (found.height, found.width)
    assert pairs.left[0].min(axis=0).max() > 0
    # The files are blurred, so points of the pair are compared with the calibration, not texture.
    random = np.random.default_rng(0)
    points = random.uniform((-3.0, -2.0, 8.0), (3.0, 1.0, 30.0), (50, 3))
    seen = []
    sides = (rectification.left, rectification.right)
    for homography, turn, x in zip(sides, MOUNTED, (0.0, 0.5), strict=True):
        in_file = (points - (x, 0.0, 0.0)) @ turn.as_matrix()
        in_file = in_file / in_file[:, 2:] * 150.0 + (78.0, 40.0, -149.0)
        in_pair = in_file @ np.reshape(homography, (3, 3)).T
        seen.append(in_pair[:, :2] / in_pair[:, 2:])
    np.testing.assert_allclose(seen[0][:, 1], seen[1][:, 1], atol=1e-6)
    disparities = 150.0 * 0.5 / points[:, 2]
    np.testing.assert_allclose(seen[0][:, 0] - seen[1][:, 0], disparities, atol=1e-3)
    expected = calibration.principal_u + 150.0 * points[:, 0] / points[:, 2]
    np.testing.assert_allclose(seen[0][:, 0], expected, atol=1e-2)
    # What the texture keeps after two interpolations.
    u, v = (round(c) for c in (calibration.principal_u, calibration.principal_v))
    whole = grey(read_image(there.left[0]))[40 - v :, 78 - u :][: found.height, : found.width]
    assert np.corrcoef(pairs.left[0].ravel(), whole.ravel())[0, 1] > 0.7


def test_the_axes_of_the_pair_are_along_the_baseline_and_between_the_optical_axes(copy):
    file = copy / "calibration/egovehicle_SE3_sensor.feather"
    rows = table(file)
    # Calibration of a real log, from the documentation of the data set.
    rows[1] |= dict(qw=0.500421, qx=-0.499934, qy=0.501241, qz=-0.498399)
    rows[1] |= dict(tx_m=1.625085, ty_m=0.248148, tz_m=1.222831)
    rows[2] |= dict(qw=0.500885, qx=-0.503584, qy=0.498793, qz=-0.496713)
    rows[2] |= dict(tx_m=1.633076, ty_m=-0.250872, tz_m=1.222173)
    write_table(file, rows)
    found = find_recording(source(copy, target=None))
    assert found.calibration.baseline == pytest.approx(0.4991, abs=1e-4)
    assert found.width > 140 and found.height > 85


def test_a_log_is_guessed_and_composed_and_needs_pyarrow(folders, monkeypatch):
    given = [f"source.folder={folders[1]}", f"source.target={TARGET}", "source.sample_time=0.1"]
    assert compose(given).configuration.rig.camera_height == pytest.approx(1.65, rel=0.03)
    composition = compose([*given, "rig.camera_height=1.6"])
    rig = composition.configuration.rig
    assert composition.choices["source"] == "argoverse"
    assert composition.choices["road_user"] == "car"
    assert (rig.width, rig.baseline) == (find_recording(source(folders[1])).width, 0.5)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(UserError, match=r"needs pyarrow: pip install 'stixel\[argoverse\]'"):
        find_recording(source(folders[1]))


def test_without_annotations_a_log_will_do_without_a_target(copy):
    (copy / "annotations.feather").unlink()
    found = find_recording(source(copy, target=None))
    assert found.label_files == () and found.count == 5
    with pytest.raises(UserError, match=r"annotations\.feather is missing"):
        find_recording(source(copy))


def test_labels_without_points_hidden_or_at_the_border_do_not_count(folders, copy):
    file = copy / "annotations.feather"
    rows = table(file)
    empty = [row | {"num_interior_pts": 0} for row in rows[:2]]
    write_table(file, [*empty, *rows[2:]])
    assert truth_of(find_recording(source(copy))).scored.tolist() == [False, *[True] * 4]
    near = annotations(folders[0], "near", "PEDESTRIAN", share=0.7)
    behind = annotations(folders[0], "behind", "BOLLARD", share=-1.0)
    write_table(file, [*rows, *near, *behind])
    found = find_recording(source(copy))
    assert not truth_of(found).scored.any()
    tracks = read_labels(found.label_files, found.tables)
    kinds = {track: labels.kind for track, labels in tracks.items()}
    assert kinds == {TARGET: "Car", "near": "Pedestrian"}
    assert not tracks["near"].occluded.any()
    # So near that its foot is below the image.
    write_table(file, annotations(folders[0], share=0.35))
    labels = read_labels(found.label_files, found.tables)[TARGET]
    assert labels.truncated.all() and (labels.boxes[:, 3] == found.height - 1).all()


def test_a_gap_in_the_labels_is_not_bridged(copy):
    file = copy / "annotations.feather"
    rows = table(file)
    write_table(file, [rows[0], rows[1], rows[4], rows[5]])
    found = find_recording(source(copy))
    known = np.isfinite(truth_of(found).target_poses_world[:, 0])
    assert np.flatnonzero(known).tolist() == [0, 4] and len(known) == 5


def _edit(row, **changes):
    def damage(file):
        rows = table(file)
        rows[row] |= changes
        write_table(file, rows)

    return damage


def _without(row):
    return lambda file: write_table(file, [*(rows := table(file))[:row], *rows[row + 1 :]])


RIGHT = f"sensors/cameras/stereo_front_right/{START + 3 * STEP + 1}.jpg"
LEFT = f"sensors/cameras/stereo_front_left/{START + 3 * STEP}.jpg"
SENSORS, CITY = "calibration/egovehicle_SE3_sensor.feather", "city_SE3_egovehicle.feather"
INTRINSICS, LABELS = "calibration/intrinsics.feather", "annotations.feather"
DAMAGE = {
    "no image": (RIGHT, missing, "stereo_front_right: the image of frame 3 is miss"),
    "no left image": (LEFT, missing, "frames 2 and 3 of"),
    "not JPEG": (RIGHT, text("image"), f"{START + 3 * STEP + 1}.jpg: not a JPEG"),
    "no sensors": (SENSORS, missing, "egovehicle_SE3_sensor.feather is missing"),
    "no camera": (INTRINSICS, _without(0), "must have one row of stereo_front_left, got 0"),
    "not Feather": (CITY, text("t"), "egovehicle.feather: not a valid Feather file: "),
    "cut": (CITY, cut(700), "egovehicle.feather: not a valid Feather file: "),
    "no column": (
        LABELS,
        lambda f: write_table(f, [{"track_uuid": "a", "category": "b"}]),
        "annotations.feather: the column timestamp_ns is missing",
    ),
    "text": (SENSORS, lambda f: write_table(f, [{"sensor_name": "a", **POSE}]), "must be of numb"),
    "NaN": (LABELS, _edit(2, tx_m=np.nan), "the column tx_m must be within ±1e+09 in each"),
    "too large": (LABELS, _edit(2, tx_m=-1e308), "the column tx_m must be within"),
    "null": (LABELS, _edit(2, tx_m=None), "the column tx_m must be of numbers in each row"),
    "no rotation": (LABELS, _edit(2, qw=2.0), "row 3: qw, qx, qy, qz must have the length 1"),
    "no size": (LABELS, _edit(2, width_m=0.0), "row 3: height, width and length must be > 0"),
    "twice": (LABELS, _edit(2, timestamp_ns=START - STEP // 2), "is labelled twice at a time"),
    "other target": (LABELS, _edit(0, track_uuid="x"), "has no track 9; it has 022c398c"),
    "no pose": (CITY, lambda f: write_table(f, table(f)[:6]), "has no pose round"),
    "other size": (INTRINSICS, _edit(1, width_px=200), "must have one size, > 0"),
    "one place": (SENSORS, _edit(2, tx_m=1.6, ty_m=0.25, tz_m=1.2), "is not to the right of"),
    "other way": (SENSORS, _edit(2, qw=1.0, qx=0.0, qy=0.0, qz=0.0), "do not look the same way"),
}
POSE = {name: "one" for name in ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")}


@pytest.mark.parametrize(("file", "damage", "said"), DAMAGE.values(), ids=DAMAGE)
def test_a_wrong_folder_is_refused_in_one_line(file, damage, said, copy):
    damage(copy / file)
    is_refused(source(copy, target="9" if "no track 9" in said else TARGET), said, str(copy))


def test_images_of_another_size_than_the_calibration_are_refused(copy):
    rows = table(copy / INTRINSICS)
    write_table(copy / INTRINSICS, [row | {"height_px": 100} for row in rows])
    with pytest.raises(UserError, match=r"160 × 96 px, but its calibration has 160 × 100 px"):
        find_recording(source(copy))
