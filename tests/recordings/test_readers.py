"""The readers of recordings: what they find, and one line for each wrong folder."""

import re
import shutil

import cv2
import numpy as np
import pytest
from damages import GIT_LFS, cut, is_refused, missing, put, text
from made_clip import (
    LENGTH,
    WIDTH,
    make_clip,
    plain_folder,
    small_rig,
    small_scenario,
    tracking,
    truth_of,
)
from made_files import RIG_FILES, png_of

from stixel_cli.calibration.road_pose import compared_rows, contradiction, road_pose
from stixel_cli.config.compose import compose
from stixel_cli.config.folders import real_image_parameters
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.export.export import calibration_text
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.find import find_recording, guess_layout
from stixel_cli.recordings.image_files import grey, image_size, read_image, rgb
from stixel_cli.recordings.kitti_tables import read_calibration
from stixel_cli.recordings.rig_files import read_named_calibration
from stixel_cli.recordings.stereo_images import read_left, read_pairs
from stixel_cli.recordings.truth import recorded_motion, rocking, slopes
from stixel_cli.recordings.types import Tables
from stixel_cli.rendering.images import encode_png
from stixel_cli.rendering.placement import rig_cameras


def test_the_folder_above_training_will_do(clip, tmp_path):
    shutil.copytree(clip, tmp_path / "training")
    assert find_recording(tracking(tmp_path)).count == 5
    assert guess_layout(tmp_path) == guess_layout(clip) == "kitti_tracking"


def test_frames_are_those_that_images_labels_and_poses_have(copy):
    for name, kept in (("label_02", slice(1, None)), ("ego_poses", slice(4))):
        file = copy / name / "0003.txt"
        file.write_text("".join(file.read_text().splitlines(keepends=True)[kept]))
    assert find_recording(tracking(copy)).frames == range(1, 4)
    assert find_recording(tracking(copy, frames="2:4")).frames == range(2, 4)
    with pytest.raises(UserError, match=r"source\.frames: 0:3 is not within 1:5, the frames of tr"):
        find_recording(tracking(copy, frames="0:3"))


@pytest.mark.parametrize("pitch", [0.0, 2.0])
def test_truth_comes_back_in_the_world_of_the_first_frame(pitch, tmp_path):
    scenario, rig = make_clip(tmp_path, rig=small_rig(pitch=pitch))
    found = truth_of(find_recording(tracking(tmp_path)), rig=rig)
    for name in ("times", "ego_poses_world", "target_poses_world"):
        np.testing.assert_allclose(getattr(found, name), getattr(scenario, name), atol=1e-9)
    np.testing.assert_allclose(found.target_rates_world, scenario.target_rates_world, atol=1e-7)
    assert np.ptp(found.box_target, axis=0) == pytest.approx([LENGTH, WIDTH])
    assert found.scored.all()


def test_a_later_first_frame_is_the_world(clip):
    whole = truth_of(find_recording(tracking(clip)))
    part = truth_of(find_recording(tracking(clip, frames="2:5")))
    np.testing.assert_allclose(part.ego_poses_world[0], [0.0, 0.0, np.pi / 2], atol=1e-12)
    for found in (whole, part):
        found.target_poses_world[:, :2] -= found.ego_poses_world[:, :2]
    distances = [np.hypot(*found.target_poses_world[-3:, :2].T) for found in (whole, part)]
    np.testing.assert_allclose(*distances, atol=1e-9)


def test_labels_are_in_the_frame_of_camera_0_and_the_rig_is_camera_2(copy):
    calibration = copy / "calib" / "0003.txt"
    # Camera 2 is 0.06 m to the left of camera 0, camera 3 is 0.44 m to the right of it.
    for i, shift in ((2, 0.06), (3, -0.44)):
        put(i, 4, repr(150.0 * shift))(calibration)
    found = read_calibration(calibration, ("P2", "P3"))
    assert found.baseline == pytest.approx(0.5)
    assert found.left_camera == pytest.approx((-0.06, 0.0, 0.0))
    moved = truth_of(find_recording(tracking(copy))).target_poses_world[0]
    assert moved[0] == pytest.approx(small_scenario().target_poses_world[0, 0] + 0.06)


def test_occluded_truncated_and_missing_labels_do_not_count(copy):
    labels = copy / "label_02" / "0003.txt"
    put(0, 3, "1")(labels)
    put(3, 4, "2")(labels)
    labels.write_text("\n".join(np.delete(labels.read_text().splitlines(), 2)))
    found = truth_of(find_recording(tracking(copy)))
    assert found.scored.tolist() == [False, True, False, False, True]
    assert np.isnan(found.target_poses_world[2]).all() and np.isnan(found.target_rates_world[2, 0])
    assert np.isfinite(np.delete(found.target_rates_world, 2, axis=0)).all()


def test_slopes_need_three_rows_and_a_parked_ego_car_no_poses():
    times = 0.1 * np.arange(6)
    line = 3.0 * times[:, None]
    assert slopes(times, line) == pytest.approx(np.full((6, 1), 3.0))
    line[2:] = np.nan
    assert np.isnan(slopes(times, line)).all()
    motion = recorded_motion((), Tables(first=7), 3, 0.2, small_rig())
    assert motion.times == pytest.approx([0.0, 0.2, 0.4])
    assert (motion.poses_world == [0.0, 0.0, np.pi / 2]).all()


def test_colour_becomes_grey(tmp_path):
    colour = np.zeros((64, 70, 3), dtype=np.uint8)
    colour[..., 0], colour[..., 2] = 200, 50
    (tmp_path / "a.png").write_bytes(encode_png(colour))
    (tmp_path / "b.png").write_bytes(encode_png(colour[..., 0]))
    assert (rgb(read_image(tmp_path / "a.png")) == colour).all()
    assert np.ptp(grey(read_image(tmp_path / "a.png"))) == 0
    assert grey(read_image(tmp_path / "a.png"))[0, 0] == round(0.299 * 200 + 0.114 * 50)
    assert (rgb(read_image(tmp_path / "b.png")) == 200).all()


def test_pairs_are_those_of_their_frames(clip):
    recording = find_recording(tracking(clip))
    pairs = read_pairs(recording.images, range(2, 4))
    assert pairs.first == 2 and len(pairs) == 2
    assert (pairs.left[1] == grey(read_image(recording.left[3]))).all()
    assert (pairs.right[0] == grey(read_image(recording.right[2]))).all()


SHORT = put(2, slice(-3, None), [])


def _swap(path):
    lines = path.read_text().splitlines()
    first = lines[0].split()
    first[11] = "40.0"
    path.write_text("\n".join([*lines[:3], " ".join(first), *lines[3:]]))


RIGHT, LABELS = "image_03/0003/000003.png", "label_02/0003.txt"
CALIBRATION, POSES = "calib/0003.txt", "ego_poses/0003.txt"

DAMAGE = {
    "no right image": (RIGHT, missing, "the image of frame 3 is missing"),
    "no right images": ("image_03", shutil.rmtree, "image_03/0003: no such folder"),
    "Git LFS pointer": (RIGHT, GIT_LFS, "000003.png: a Git LFS pointer"),
    "other size": (
        RIGHT,
        lambda f: f.write_bytes(encode_png(np.zeros((90, 160), np.uint8))),
        "000003.png: 160 × 90 px, but the images before have 160 × 96 px",
    ),
    "text": (RIGHT, text("an image"), "000003.png: not a PNG image"),
    "empty image": (RIGHT, cut(0), "000003.png: not a PNG image"),
    "short label": (LABELS, SHORT, "row 3: 17 columns are needed, got 14"),
    "label of words": (LABELS, put(1, 13, "near"), "row 2: 'near' is not a number"),
    "label NaN": (LABELS, put(1, 13, "nan"), "row 2: nan must be within ±1e+09"),
    "label size": (LABELS, put(0, 11, "0"), "row 1: height, width and length must"),
    "label twice": (LABELS, put(1, 0, "0"), "row 2: track 0 is labelled twice"),
    "no labels": (LABELS, missing, "0003.txt is missing"),
    "binary labels": (LABELS, lambda f: f.write_bytes(b"\xff\xfe\x00"), "not a text in UTF-8"),
    "other target": (LABELS, text(""), "has no track 0"),
    "short pose": (POSES, SHORT, "row 3: 12 columns are needed, got 9"),
    "pose NaN": (POSES, put(2, 3, "inf"), "row 3: inf must be within ±1e+09"),
    "pose too large": (POSES, put(2, 0, "1e308"), "row 3: 1e308 must be within"),
    "label too large": (LABELS, put(1, 13, "-1e300"), "row 2: -1e300 must be"),
    "pose out of order": (POSES, _swap, "row 4: out of order: 39."),
    "no rotation": (POSES, put(2, 0, "0.2"), "row 3: not a rigid pose"),
    "no pose": (POSES, text("\n"), "0003.txt: has no poses"),
    "no baseline": (CALIBRATION, put(3, 4, "0.0"), "no baseline: P3 is 0 m to the right of P2"),
    "not rectified": (CALIBRATION, put(3, 1, "151"), "P2 and P3 are not rectified"),
    "short calibration": (CALIBRATION, SHORT, "row 3: 12 columns are needed, got 9"),
    "no projection": (CALIBRATION, text("P2: 1"), "row 1: 12 columns are needed"),
    "no calibration": (CALIBRATION, missing, "0003.txt is missing"),
}


@pytest.mark.parametrize(("file", "damage", "said"), DAMAGE.values(), ids=DAMAGE)
def test_a_wrong_folder_is_refused_in_one_line_that_names_the_file(file, damage, said, copy):
    damage(copy / file)
    is_refused(tracking(copy), said, str(copy / file.split("/")[0]))


def test_the_principal_points_of_two_cameras_may_differ(copy):
    assert find_recording(tracking(copy)).calibration.principal_u_right is None
    put(3, 3, "98.5")(copy / CALIBRATION)
    calibration = find_recording(tracking(copy)).calibration
    assert calibration.principal_u == 78.0 and calibration.principal_u_right == 98.5
    assert calibration.baseline == pytest.approx(0.5)
    rig = Rig(**calibration.rig_values(160, 96) | {"camera_height": 1.65})
    assert calibration_text(rig).splitlines()[3].split()[3] == "98.5"
    left, right = rig_cameras(rig, np.zeros(3))
    assert (left.u0, right.u0) == (78.0, 98.5)


@pytest.mark.parametrize("kept", [0.3, 0.9])
def test_a_cut_off_image_is_refused_when_it_is_read(kept, copy, capfd):
    cut(kept)(copy / RIGHT)
    recording = find_recording(tracking(copy))
    with pytest.raises(UserError, match=r"000003\.png: a damaged or incomplete PNG image"):
        read_pairs(recording.images, range(5))
    assert capfd.readouterr().err == ""


def test_poses_in_space_give_pitch_and_height_but_a_slope_gives_none():
    ways = np.arange(0.0, 40.0, 0.5)
    pitches = np.radians(1.0) * np.sin(ways)
    heights = 0.03 * np.cos(ways)
    up = np.radians(4.0)
    poses = np.zeros((len(ways), 3, 4))
    for k, (way, pitch, height) in enumerate(zip(ways, pitches, heights, strict=True)):
        # Nose down by `pitch` on a road that climbs: the camera's z axis, seen in x, y down, z.
        angle = pitch - up
        cosine, sine = np.cos(angle), np.sin(angle)
        poses[k, :, :3] = [[1, 0, 0], [0, cosine, sine], [0, -sine, cosine]]
        poses[k, :, 3] = [0.0, -way * np.sin(up) - height, way * np.cos(up)]
    found = rocking(poses, np.eye(3))
    after = slice(30, None)
    np.testing.assert_allclose(found[0][after], pitches[after], atol=np.radians(0.15))
    np.testing.assert_allclose(found[1][after], heights[after], atol=0.015)
    # A frame knows nothing of later ones.
    np.testing.assert_array_equal(rocking(poses[:50], np.eye(3)), np.array(found)[:, :50])
    # The camera's own pitch is that of the rig.
    level = rocking(poses, small_rig(pitch=1.0).level_from_camera)[0]
    np.testing.assert_allclose(level[after], found[0][after] - np.radians(1.0), atol=1e-3)
    assert not rocking(poses[:8], np.eye(3))[0].any()


def test_a_plain_folder_has_the_same_recording(clip, tmp_path):
    recording = find_recording(plain_folder(clip, tmp_path))
    assert guess_layout(tmp_path) == "folder"
    there = find_recording(tracking(clip))
    assert recording.frames == there.frames and recording.label == there.label
    assert recording.calibration.focal_length_v == 150
    found, expected = truth_of(recording), truth_of(there)
    np.testing.assert_array_equal(found.target_poses_world, expected.target_poses_world)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("focal_length: 150\n", "missing: principal_u, principal_v, baseline"),
        ("focus: 150\n", "focus: unknown; it has focal_length, "),
        ("h: 1.6\n", "h: unknown; did you mean camera_height"),
        ("Tx: 0.1\n", "Tx: unknown; did you mean baseline"),
        ("fx: 9\nfocal_length: 9\n", "a number is given twice"),
        ("K: [1, 2, 3]\n", "K: must be a camera matrix of 3 × 3 numbers"),
        ("K: [9, 0, 1, 0, 0, 1, 0, 0, 1]\nbaseline: 1\n", "focal_length_v: must be > 0, got 0"),
        ("P: [1, 2, 3]\n", "P: must have 12 numbers"),
        ("P1: [1]\nP2: {rows: 3}\n", "P1: must have 12 numbers"),
        ("P: [9, 0, 1, 0, 0, 9, 1, 0, 0, 0, 1, 0]\n", "P has no baseline: give the file of the"),
        ("P: [9, 0, 1, -9000, 0, 9, 1, 0, 0, 0, 1, 0]\n", "1000 m to the .*is it in mm"),
        ("P: [9, 0, 1, .inf, 0, 9, 1, 0, 0, 0, 1, 0]\n", "not a finite number"),
        ("[1, 2]", "must map names to values"),
        ("focal_length: x\nprincipal_u: 1\nprincipal_v: 1\nbaseline: 1\n", "focal_length: must be"),
        ("focal_length: 9\nprincipal_u: 1\nprincipal_v: 1\nbaseline: 0\n", "no baseline: .* 0 m"),
        ("focal_length: 9\nprincipal_u: 1\nprincipal_v: 1\nbaseline: 120\n", "is it in mm"),
    ],
)
def test_a_wrong_rig_is_refused(content, said, clip, tmp_path):
    wrong = plain_folder(clip, tmp_path)
    (tmp_path / "rig.yaml").write_text(content)
    with pytest.raises(UserError, match=said):
        find_recording(wrong)


@pytest.mark.parametrize("name", RIG_FILES)
def test_a_rig_is_read_as_others_write_it(name, tmp_path):
    (tmp_path / name).write_text(RIG_FILES[name])
    found = read_named_calibration(tmp_path / name)
    assert (found.focal_length, found.focal_length_v) == (150.0, 151.0)
    assert (found.principal_u, found.principal_v) == (78.0, 40.0)
    # What ROS states of one camera counts for both.
    right = None if name in ("right.yaml", "echo.yml") else 80.0
    assert found.principal_u_right == right and found.camera_height is None
    assert found.baseline == pytest.approx(0.5)
    if name == "calib.txt":
        (tmp_path / name).write_text(RIG_FILES[name].replace("baseline", "base"))
        with pytest.raises(UserError, match=r"calib\.txt: baseline is missing"):
            read_named_calibration(tmp_path / name)


@pytest.mark.parametrize(
    ("data", "pixels"),
    [
        (png_of(8, 6, [1, 2, 3, 9, 4, 5, 6, 0]), [[1, 2, 3], [4, 5, 6]]),
        (png_of(8, 4, [7, 0, 8, 255]), [[7, 7, 7], [8, 8, 8]]),
        (png_of(8, 3, [1, 0], bytes([1, 2, 3, 4, 5, 6])), [[4, 5, 6], [1, 2, 3]]),
        (png_of(1, 0, [0x40]), [[0, 0, 0], [255, 255, 255]]),
        # By the greatest value, 0x0800.
        (png_of(16, 0, [8, 0, 4, 0]), [[255] * 3, [128] * 3]),
        (png_of(16, 2, [8, 0, 4, 0, 0, 0] * 2), [[255, 128, 0]] * 2),
    ],
)
def test_a_png_of_every_kind_is_read(data, pixels, tmp_path):
    file = tmp_path / "a.png"
    file.write_bytes(data)
    assert image_size(file) == (2, 1)
    assert read_left((file,), 0)[0].tolist() == [pixels]


def test_both_images_of_a_pair_have_one_scale(copy):
    recording = find_recording(tracking(copy))
    for file, times in ((recording.left[1], 16), (recording.right[1], 8)):
        wide = times * cv2.imread(str(file), cv2.IMREAD_GRAYSCALE).astype(np.uint16)
        file.write_bytes(encode_png(wide))
    before = read_pairs(recording.images, range(0, 1))
    after = read_pairs(recording.images, range(1, 2))
    assert after.left[0].max() == 255 and before.right[0].max() > 200
    assert after.right[0].max() == pytest.approx(128, abs=4)


def test_jpeg_files_are_taken_in_every_layout(clip, copy):
    for file in [*copy.rglob("0000*.png")]:
        image = cv2.imread(str(file))
        cv2.imwrite(str(file.with_suffix(".JPG")), image, [cv2.IMWRITE_JPEG_QUALITY, 100])
        # A PNG beside it is preferred.
        if file.stem != "000000":
            file.unlink()
    recordings = [find_recording(tracking(folder)) for folder in (copy, clip)]
    assert [file.suffix for file in recordings[0].left] == [".png"] + 4 * [".JPG"]
    found, exact = (read_pairs(one.images, range(5)) for one in recordings)
    differences = [np.abs(found.left[k].astype(int) - exact.left[k]) for k in range(5)]
    assert differences[0].max() == 0 and 0 < np.mean(differences[1]) < 2


def test_what_a_plain_folder_does_not_state_is_required_or_seen(clip, tmp_path):
    plain_folder(clip, tmp_path)
    # As in docs/real-data.md, without its `source.sample_time`.
    words = [f"source.folder={tmp_path}", "road_user=car", "start.range=[5,15]"]
    with pytest.raises(ConfigurationError, match=r"^source\.sample_time: "):
        compose(words)
    rig = tmp_path / "rig.yaml"
    rig.write_text(rig.read_text().replace("camera_height: 1.65\n", ""))
    words.append("source.sample_time=0.1")

    def said(*more):
        composition = compose([*words, *more])
        configuration = composition.configuration
        stereo, road = real_image_parameters().stereo, configuration.road
        return contradiction(composition.recording, configuration.rig, road, stereo)

    assert compose(words).configuration.rig.camera_height == pytest.approx(1.65, rel=0.03)
    assert re.search(r"height: not given.* 1\.6\d m; rig\.disparity_error=\[0\.0, ", said())
    contradicts = said("rig.camera_height=1.2", "rig.pitch=6.0")
    assert re.search(r"set rig\.camera_height=1\.6\d rig\.pitch=-?0\.\d \(now 1\.2 ", contradicts)
    assert said("rig.camera_height=1.6") is None
    for file in (tmp_path / "left").iterdir():
        shutil.copy(file, tmp_path / "right")
    road_pose.cache_clear()
    compared_rows.cache_clear()
    with pytest.raises(ConfigurationError, match=r"^rig\.camera_height: is required.* no road: "):
        compose(words)
    assert compose([*words, "rig.camera_height=1.5"]).configuration.rig.camera_height == 1.5
