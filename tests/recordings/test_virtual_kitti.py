"""Recordings in the layout of Virtual KITTI 2, and JPEG images."""

import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from damages import GIT_LFS, cut, is_refused, missing, put, text
from made_clip import make_clip, tracking, truth_of

from stixel_cli.errors import UserError
from stixel_cli.recordings.find import find_recording, guess_layout
from stixel_cli.recordings.image_files import grey, image_size, read_image, rgb
from stixel_cli.recordings.kitti_tables import read_labels, read_poses
from stixel_cli.recordings.parameters import LabelledFolder
from stixel_cli.recordings.stereo_images import read_pairs

PLACE = "{0}_space_X {0}_space_Y {0}_space_Z "
PLACE += "rotation_{0}_space_y rotation_{0}_space_x rotation_{0}_space_z"
POSE = "frame cameraID trackID alpha width height length "
POSE += f"{PLACE.format('world')} {PLACE.format('camera')}"
BOX = "frame cameraID trackID left right top bottom "
BOX += "number_pixels truncation_ratio occupancy_ratio isMoving"


def make_variation(clip, folder, baseline=0.5, sequence="0003"):
    """Write the files of `clip`, in KITTI tracking's layout, in that of Virtual KITTI 2."""
    for i in (0, 1):
        images = folder / f"frames/rgb/Camera_{i}"
        images.mkdir(parents=True)
        for file in sorted((clip / f"image_0{2 + i}" / sequence).iterdir()):
            name = f"rgb_{int(file.stem):05d}.jpg"
            cv2.imwrite(str(images / name), cv2.imread(str(file), cv2.IMREAD_COLOR))
    poses = read_poses(clip / "ego_poses" / f"{sequence}.txt")
    extrinsic, intrinsic = ["frame cameraID r1,1 …"], ["frame cameraID K[0,0] K[1,1] …"]
    # Any world: its axes and its origin are not those of the first camera.
    world = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    world *= np.linalg.det(world)
    for k, pose in enumerate(poses):
        turn = world @ pose[:, :3]
        for i in (0, 1):
            place = world @ (pose[:, 3] + pose[:, 0] * baseline * i) + (100.0, -7.0, 3.0)
            rows = np.vstack([np.column_stack([turn.T, -turn.T @ place]), [0, 0, 0, 1]])
            extrinsic.append(" ".join(map(repr, [k, i, *map(float, rows.ravel())])))
            intrinsic.append(f"{k} {i} 150 150 78 40")
    pose, box = [POSE], [BOX]
    (labels,) = read_labels(clip / "label_02" / f"{sequence}.txt").values()
    for row, k in enumerate(labels.frames):
        height, width, length = labels.sizes[row]
        left, top, right, bottom = labels.boxes[row]
        x, y, z = labels.places[row]
        for i in (0, 1):
            place = f"{x - baseline * i} {y} {z} {labels.yaws[row]} 0 0"
            pose.append(f"{k} {i} 4 0 {width} {height} {length} 0 0 0 0 0 0 {place}")
            box.append(f"{k} {i} 4 {left} {right} {top} {bottom} 900 0 0.85 True")
    info = ["trackID label model color", "4 Car Sedan4Door Black"]
    files = {"extrinsic": extrinsic, "intrinsic": intrinsic, "pose": pose, "bbox": box}
    for name, lines in (files | {"info": info}).items():
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A clip of KITTI tracking, and the same as Virtual KITTI 2."""
    folder = tmp_path_factory.mktemp("clip")
    make_clip(folder / "kitti")
    make_variation(folder / "kitti", folder / "Scene01" / "clone")
    return folder / "kitti", folder / "Scene01" / "clone"


@pytest.fixture
def copy(folders, tmp_path):
    """A variation to damage."""
    return shutil.copytree(folders[1], tmp_path / "clone")


def source(folder, **changes):
    values = {"target": 4, "frames": None, "sample_time": 0.1}
    return LabelledFolder(kind="virtual_kitti", folder=str(folder), **values | changes)


def test_a_variation_has_the_recording_of_the_clip_it_was_made_from(folders):
    clip, variation = folders
    there, found = find_recording(tracking(clip)), find_recording(source(variation))
    assert guess_layout(variation) == "virtual_kitti"
    assert (found.frames, found.width, found.height) == (range(5), 160, 96)
    assert found.label == "Car" and found.first_box == there.first_box
    assert found.calibration.baseline == pytest.approx(0.5)
    assert replace(found.calibration, baseline=0.5, camera_height=1.65) == there.calibration
    truth, expected = truth_of(found), truth_of(there)
    np.testing.assert_allclose(truth.ego_poses_world, expected.ego_poses_world, atol=1e-6)
    np.testing.assert_allclose(truth.target_poses_world, expected.target_poses_world, atol=1e-5)
    np.testing.assert_allclose(truth.contour_target(0), expected.contour_target(0), atol=1e-9)
    assert truth.scored.tolist() == expected.scored.tolist()
    part = find_recording(source(variation, frames="1:3"))
    assert [file.name for file in part.right] == ["rgb_00001.jpg", "rgb_00002.jpg"]
    pairs = read_pairs(part.images, range(2))
    assert np.mean(np.abs(pairs.left[0] - grey(read_image(there.left[1])).astype(float))) < 5.0


def test_occluded_and_truncated_frames_do_not_count(copy):
    put(3, 8, "0.02")(copy / "bbox.txt")
    put(5, 9, "0.55")(copy / "bbox.txt")
    scored = truth_of(find_recording(source(copy))).scored
    assert np.flatnonzero(~scored).tolist() == [1, 2] and len(scored) == 5


def test_files_without_labels_will_do_without_a_target(copy):
    for name in ("pose", "bbox", "info"):
        (copy / f"{name}.txt").unlink()
    found = find_recording(source(copy, target=None))
    assert found.label_files == () and found.count == 5 and found.label is None


RIGHT = "frames/rgb/Camera_1/rgb_00003.jpg"
DAMAGE = {
    "no image": (RIGHT, missing, "Camera_1: the image of frame 3 is missing"),
    "not JPEG": (RIGHT, text("image"), "rgb_00003.jpg: not a JPEG image"),
    "cut": (RIGHT, cut(40), "rgb_00003.jpg: a damaged or incomplete JPEG image"),
    "Git LFS": (RIGHT, GIT_LFS, "rgb_00003.jpg: a Git LFS pointer"),
    "short pose": ("pose.txt", lambda f: f.write_text(f.read_text() + "7 0"), "row 12: 19 columns"),
    "no column": ("bbox.txt", put(0, 8, "x"), "the column truncation_ratio is miss"),
    "NaN": ("pose.txt", put(3, 15, "nan"), "row 4: nan must be within ±1e+09"),
    "twice": ("bbox.txt", put(3, 0, "0"), "row 4: track 4 is labelled twice in fr"),
    "size": ("pose.txt", put(1, 4, "0"), "row 2: height, width and length must be"),
    "no kind": ("info.txt", put(1, 0, "5"), "info.txt: track 4 of pose.txt is miss"),
    "other target": ("info.txt", lambda f: None, "has no track 9; it has 4 (Car)"),
    "no poses": ("extrinsic.txt", missing, "extrinsic.txt is missing"),
    "a gap": ("extrinsic.txt", put(3, 0, "2"), "row 4: frame 1 is missing before it"),
    "no rotation": ("extrinsic.txt", put(3, 2, "3"), "row 4: not a rigid pose"),
    "one camera": ("intrinsic.txt", text("frame cameraID a b c d"), "cameraID 0"),
    "two cameras": ("intrinsic.txt", put(2, 2, "151"), "not rectified to one camera"),
    "empty": ("intrinsic.txt", text(""), "row 1: the column frame is missing"),
    "turned": ("extrinsic.txt", put(2, 2, "0.5"), "are not a rectified pair"),
}


@pytest.mark.parametrize(("file", "damage", "said"), DAMAGE.values(), ids=DAMAGE)
def test_a_wrong_folder_is_refused_in_one_line(file, damage, said, copy):
    damage(copy / file)
    is_refused(source(copy, target=9 if "no track 9" in said else 4), said, str(copy))


def test_cameras_without_a_baseline_are_refused(folders, tmp_path):
    make_variation(folders[0], tmp_path, baseline=-0.3)
    with pytest.raises(UserError, match=r"no baseline: camera 1 is -0\.3 m to the right"):
        find_recording(source(tmp_path))


def frame(kind, bits, height, channels):
    """The header of a frame (ITU-T T.81, B.2.2), 16 px wide, and the begin of its scan (B.2.3)."""
    size = bytes([bits, *height.to_bytes(2, "big"), 0, 16, channels])
    size += b"".join(bytes([i + 1, 0x11, 0]) for i in range(channels))
    return b"\xff" + kind + (len(size) + 2).to_bytes(2, "big") + size + b"\xff\xda\x00\x02"


def test_jpeg_images_are_read_as_png_images_are(tmp_path, capfd):
    ramp = np.repeat(np.arange(0, 240, 4, dtype=np.uint8)[None], 30, axis=0)
    for name, image in (("grey", ramp), ("rgb", np.dstack([ramp, ramp // 2, ramp // 4]))):
        file = tmp_path / f"{name}.jpg"
        cv2.imwrite(str(file), image, [cv2.IMWRITE_JPEG_QUALITY, 100])
        assert image_size(file) == (60, 30)
        data = file.read_bytes()
        # A segment before the frame's, longer than the head of a PNG.
        file.write_bytes(data[:2] + b"\xff\xfe\x03\x00" + bytes(0x2FE) + data[2:])
        assert image_size(file) == (60, 30)
        assert rgb(read_image(file)).shape == (30, 60, 3)
        assert grey(read_image(file)).shape == (30, 60)
        cut(len(data))(file)
        with pytest.raises(UserError, match=rf"{name}\.jpg: a damaged or incomplete JPEG image"):
            read_image(file)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("head", "said"),
    [
        (frame(b"\xc0", 12, 16, 3), "a damaged or incomplete JPEG image, or not of 8 bits"),
        (frame(b"\xc0", 8, 16, 4), "a JPEG in CMYK: must be grey or RGB"),
        (frame(b"\xc2", 8, 65296, 3), "16 × 65296 px: each side must be"),
        (b"\xff\xd8\xff\xff", "a damaged or incomplete JPEG image"),
        (b"\xff\xe0\x00\x00" * 9, "a damaged or incomplete JPEG image"),
    ],
)
def test_other_jpeg_images_are_refused(head, said, tmp_path):
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8" + head)
    with pytest.raises(UserError, match=said):
        image_size(tmp_path / "a.jpg")
